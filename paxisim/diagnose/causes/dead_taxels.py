"""Dead taxels: taxels that never respond, stop responding or are stuck at a level; read off the streams."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim import augment
from paxisim.diagnose.causes.channels import centred, loaded_taxels, response_of, rest_noise
from paxisim.diagnose.causes.kinds import DetectedCause, Reading
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import CHECKS

BoolArray = NDArray[np.bool_]


def _read(problem: Problem) -> Reading | None:
    """Return the taxels that do not respond on any axis although they are pressed, and the channels that fail."""
    level, noise = np.median(problem.measured, axis=0), rest_noise(problem)
    floor = max(CHECKS.count * problem.noise.step, 0.03)
    dead = _dead(problem, level, noise, floor)
    first = _failures(problem, noise)
    failed = first > 0
    # a taxel that failed early may seem to have been dead all along
    gone = np.where(failed.any(axis=1, keepdims=True), failed, dead[:, None])
    if not gone.any():
        return None
    for place in zip(*np.nonzero(failed), strict=True):
        level[place] = np.median(problem.measured[(slice(first[place], None), *place)])
    dead = gone.any(axis=1)
    stuck = dead & (np.abs(level * gone).max(axis=1) > floor)
    fault = augment.DeadTaxels((dead & ~stuck).astype(float), stuck.astype(float), level * stuck[:, None])
    values = {"dead": fault.dead, "stuck": fault.stuck, "value": fault.value}
    if failed.any():
        # halfway between the last frame before the failure and the first one after it
        seconds = np.where(failed, (problem.time[first - 1] + problem.time[first]) / 2 - problem.time[0], 0.0)
        since = np.where(gone | ~dead[:, None], seconds, np.inf)
        fault = augment.FailingTaxels(fault.dead, fault.stuck, fault.value, since)
        values["since"] = since.min(axis=1)
    return Reading(fault, values, replace(problem, alive=problem.alive & ~gone))


def _dead(problem: Problem, level: FloatArray, noise: FloatArray, floor: float) -> BoolArray:
    """``(pads, rows, cols)`` taxels that do not respond on any axis although pressed.

    They are pressed so clearly that they should respond. Light presses suffice for a taxel that is stuck at an unusual
    level on all axes, because no dead band suppresses a non-zero reading.
    """
    total = response_of(problem.episodes, problem.simulated, problem.measured).total
    # a late response is no multiple of the force, but it is no noise either
    missing, quiet = total.score(noise, 1.0) < -CHECKS.certain, total.is_quiet(noise)
    pressed = loaded_taxels(problem).sum(axis=0) >= CHECKS.samples
    usual = np.median(np.abs(level), axis=(2, 3), keepdims=True)
    far = (np.abs(level) > CHECKS.unusual * (usual + floor)).any(axis=1) | _unmoved(problem, floor)
    dead = (pressed & missing[:, 2] & quiet[:, 2]) | (far & missing.any(axis=1) & quiet.all(axis=1))
    dead &= total.is_missing(noise).all(axis=1)
    if dead.any():  # slow changes at rest may hide a late response
        late = problem.run(augment.LowPass(CHECKS.late), problem.simulated)
        dead &= response_of(problem.episodes, late, problem.measured).total.is_missing(noise)[:, 2]
    return dead


def _unmoved(problem: Problem, floor: float) -> BoolArray:
    """``(pads, rows, cols)`` taxels whose reading before contact stays constant while that of the others drifts."""
    spans = [span for span in problem.episodes if problem.untouched[span].any()]
    if not spans:
        return np.zeros_like(problem.alive[:, 0])
    moved = np.std([np.mean(problem.measured[span][problem.untouched[span]], axis=0) for span in spans], axis=0)
    usual = np.median(moved, axis=(2, 3), keepdims=True)
    drifting = usual > floor
    return drifting.any() & (~drifting | (moved < CHECKS.unmoved * usual)).all(axis=1)


def _failures(problem: Problem, noise: FloatArray) -> NDArray[np.intp]:
    """``(pads, 3, rows, cols)`` frame from which a channel fails during the recording; 0 if it does not.

    Before that frame, the reading is a multiple of the simulated force plus a constant, after it a constant. The frame
    minimises the squared residual. A taxel that fails on all axes has one such frame. Where its shear is too weak to
    show a failure, the shear channels follow the normal force.
    """
    if not problem.runs_through:
        return np.zeros(noise.shape, dtype=np.intp)
    gains = [_gains(problem, noise, pad) for pad in range(len(noise))]
    own = np.stack([gain.argmax(axis=0) for gain in gains]) + 1
    shared = np.stack([gain.sum(axis=1, keepdims=True).argmax(axis=0) for gain in gains]) + 1
    shared = np.broadcast_to(shared, own.shape)
    some, silent = _judged(problem, noise, shared)
    whole = (some.any(axis=1) & silent.all(axis=1))[:, None]
    failed = (whole | _judged(problem, noise, own)[0]) & problem.alive
    return np.where(failed, np.where(whole, shared, own), _frozen(problem) * problem.alive)


def _frozen(problem: Problem) -> NDArray[np.intp]:
    """``(pads, 1, rows, cols)`` frame from which a taxel repeats one reading to the end, on all axes; 0 if it does not.

    No load is needed: a channel that changed at rest before, by its noise, does not stop changing. A drift may move one
    channel from the edge of a count, but hardly two of a taxel.
    """
    changes = np.diff(problem.measured, axis=0) != 0
    last = len(changes) - np.argmax(changes.any(axis=2, keepdims=True)[::-1], axis=0)
    before = problem.at_rest[1:].reshape(-1, 1, 1, 1, 1) & (np.arange(len(changes)).reshape(-1, 1, 1, 1, 1) < last)
    rate = np.sum(changes & before, axis=0) / np.maximum(before.sum(axis=0), 1)
    missing = rate * (len(changes) - last) > CHECKS.missing_changes
    frozen = missing.sum(axis=1, keepdims=True) >= CHECKS.repeats
    if frozen.all():  # the whole stream has stopped
        return np.zeros(last.shape, dtype=np.intp)
    return np.where(frozen, last, 0)


def _gains(problem: Problem, noise: FloatArray, pad: int) -> FloatArray:
    """``(T - 1, 3, rows, cols)`` decrease of a pad's squared residual by a failure at frame 1, 2, ...; in noise units.

    One pad at a time limits the memory.
    """
    x, y = centred(problem.simulated[:, pad]), centred(problem.measured[:, pad]) / noise[pad]
    before = np.arange(1, len(x)).reshape(-1, 1, 1, 1)
    sum_x, sum_y, xx, xy = (np.cumsum(values, axis=0)[:-1] for values in (x, y, x * x, x * y))
    response = (xy - sum_x * sum_y / before) ** 2 / np.maximum(xx - sum_x**2 / before, 1e-12)
    return response + sum_y**2 * (1 / before + 1 / (len(x) - before))  # all readings sum to 0


def _judged(problem: Problem, noise: FloatArray, first: NDArray[np.intp]) -> tuple[BoolArray, BoolArray]:
    """Judge channels that may each fail from frame `first` on, ``(pads, 3, rows, cols)``.

    A channel fails if it responded to forces of the same size before, and its response is missing afterwards although
    the contact is there.

    Returns:
        Two arrays ``(pads, 3, rows, cols)``: whether the channel certainly fails, and whether it is silent afterwards.
    """
    after = np.arange(len(problem.time)).reshape(-1, 1, 1, 1, 1) >= first
    size = np.abs(problem.simulated)
    most = np.max(size, axis=0, where=after, initial=0.0)
    loaded = np.broadcast_to(loaded_taxels(problem)[:, :, None], after.shape)
    streams = problem.episodes, problem.simulated, problem.measured
    before = response_of(*streams, ~after & (size <= most)).total
    slope, each = before.slope, response_of(*streams, after)
    silent = each.is_quiet(noise).all(axis=0) & each.total.is_missing(noise)
    missing, missing_each = (-np.sign(slope) * sums.score(noise, slope) for sums in (each.total, each))
    fails = silent & (np.abs(each.total.slope) < CHECKS.silent)
    fails &= (np.abs(slope) > CHECKS.responds) & (np.abs(before.score(noise)) > CHECKS.certain)
    fails &= missing > CHECKS.certain
    # the load must be released again: otherwise the channel may be saturated or late
    for frames in (loaded & ~after, loaded & after, after & (size < CHECKS.silent * most)):
        fails &= frames.sum(axis=0) >= CHECKS.samples
    sure = fails.copy()
    for place in zip(*np.nonzero(fails), strict=True):
        course = (slice(None), *place)
        touched = loaded[course] & after[course]
        seen = sum(
            score > CHECKS.certain / 2 and _fits(problem, place[0], ~fails[place[0], 2], span, touched[span])
            for span, score in zip(problem.episodes, missing_each[course], strict=True)
        )
        least = CHECKS.unusual * max(float(noise[place]), CHECKS.count * problem.noise.step)
        unlike = _is_unlike(problem.measured[course], int(first[place]), problem.at_rest, least)
        sure[place] = seen >= (1 if unlike else CHECKS.repeats)
    return sure, silent


def _fits(problem: Problem, pad: int, others: BoolArray, span: slice, loaded: BoolArray) -> bool:
    """Whether the other taxels of a pad read the simulated force while a taxel is loaded, so that the contact is there.

    Args:
        problem: The recording.
        pad: Index of the pad.
        others: ``(rows, cols)`` taxels that have not failed.
        span: Samples of an episode.
        loaded: Frames of the episode in which the taxel is loaded.
    """
    x, y = (centred(values[span, pad, 2])[loaded][:, others] for values in (problem.simulated, problem.measured))
    gain = np.sum(x * y) / max(np.sum(x * x), 1e-12)
    energy = np.sum(problem.simulated[span, pad, 2][loaded] ** 2)
    return bool(loaded.sum() >= CHECKS.samples and np.sum((y - gain * x) ** 2) < CHECKS.misfit * energy)


def _is_unlike(read: FloatArray, first: int, at_rest: BoolArray, least: float) -> bool:
    """Whether the readings of a channel from frame `first` on rule out a working, unloaded channel.

    They do if they are further than `least` (N) from those at rest, or never change although noise changed these.
    """
    rest = at_rest[:first]
    if not rest.any():
        return False
    changes = np.diff(read, prepend=read[:1]) != 0
    missing = changes[:first][rest].mean() * (len(read) - first)
    frozen = not changes[first + 1 :].any() and missing > CHECKS.missing_changes
    return bool(frozen or abs(np.median(read[first:]) - np.median(read[:first][rest])) > least)


DEAD_TAXELS = DetectedCause(
    name="dead_taxels",
    order=95,
    excites="places",
    read=_read,
    words="Some taxels do not respond to force, or stop responding.",
    picture="silent_map",
)
