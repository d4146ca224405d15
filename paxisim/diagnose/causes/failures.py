"""Failures: channels that stop responding at some moment, read off the streams for `dead_taxels`.

The moment minimises the squared residual of a channel under a model with two parts: before the moment a multiple of
the simulated force plus a constant, after it a constant. A failure counts only if the channel responded to forces of
the same size before the moment, and the response that should follow after it is missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from paxisim.diagnose.causes.channels import loaded_taxels
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import CHECKS


@dataclass(frozen=True, eq=False)
class Failures:
    """Channels that have failed; each array is ``(pads, 3, rows, cols)``.

    Attributes:
        failed: Whether the channel has failed.
        since: Time of the failure in seconds after the recording's first frame, halfway between the last frame before
            the failure and the first one after it.
        level: Reading since then (N).
    """

    failed: NDArray[np.bool_]
    since: FloatArray
    level: FloatArray


def failures_of(problem: Problem) -> Failures | None:
    """Return the channels that fail during a recording; None if there are none.

    A taxel that fails on all axes has one moment of failure. Where its shear is too weak to show a failure, the shear
    channels follow the normal force.
    """
    if not problem.runs_through:
        return None
    noise = _noise(problem)
    costs = [_costs(problem, noise, pad) for pad in range(problem.alive.shape[0])]
    together = np.stack([np.argmin(cost.sum(axis=1), axis=0) for cost in costs])
    own = np.stack([np.argmin(cost, axis=0) for cost in costs])
    moment = np.broadcast_to(together[:, None], own.shape) + 1
    failing, silent, level = _judged(problem, noise, moment)
    whole = (failing.any(axis=1) & silent.all(axis=1))[:, None]
    alone, _, own_level = _judged(problem, noise, own + 1)
    failed = (whole | alone) & problem.alive
    frozen = _frozen(problem)
    froze = (frozen > 0) & problem.alive & ~failed
    failed |= froze
    if not failed.any():
        return None
    first = np.where(froze, frozen, np.where(whole, moment, own + 1))
    since = (problem.time[first - 1] + problem.time[first]) / 2 - problem.time[0]
    return Failures(failed, since, np.where(froze, problem.measured[-1], np.where(whole, level, own_level)))


def _frozen(problem: Problem) -> NDArray[np.intp]:
    """``(pads, 1, rows, cols)`` frame from which a taxel repeats one reading to the end, on all axes; 0 if it does not.

    No load is needed: a channel whose noise changed its reading in most samples at rest does not stop changing. Coarser
    counts change too rarely to tell, as a drift may move a channel from the edge of a count.
    """
    changes = np.diff(problem.measured, axis=0) != 0
    last = len(changes) - np.argmax(changes.any(axis=2, keepdims=True)[::-1], axis=0)
    before = problem.at_rest[1:].reshape(-1, 1, 1, 1, 1) & (np.arange(len(changes)).reshape(-1, 1, 1, 1, 1) < last)
    rate = np.sum(changes & before, axis=0) / np.maximum(before.sum(axis=0), 1)
    missing = (rate > CHECKS.changes) & (rate * (len(changes) - last) > CHECKS.missing_changes)
    frozen = missing.sum(axis=1, keepdims=True) >= CHECKS.repeats
    if frozen.all():  # the whole stream has stopped
        return np.zeros(last.shape, dtype=np.intp)
    return np.where(frozen, last, 0)


def _noise(problem: Problem) -> FloatArray:
    """``(pads, 3, rows, cols)`` N, noise of each channel at rest, slow noise included; median over the episodes."""
    rests = [problem.measured[span][problem.at_rest[span]] for span in problem.episodes]
    spreads = [rest.std(axis=0) for rest in rests if len(rest) >= CHECKS.samples]
    usual = np.median(problem.noise.sigma, axis=0)
    return np.maximum(usual, np.median(spreads, axis=0)) if spreads else usual


def _costs(problem: Problem, noise: FloatArray, pad: int) -> FloatArray:
    """``(T - 1, 3, rows, cols)`` squared residuals of a pad, in noise units, if its channels fail at frame 1, 2, ..."""
    x = problem.simulated[:, pad] - problem.simulated[:, pad].mean(axis=0)
    y = (problem.measured[:, pad] - problem.measured[:, pad].mean(axis=0)) / noise[pad]
    count = np.arange(1, len(x)).reshape(-1, 1, 1, 1)

    def before(values: FloatArray) -> FloatArray:
        return np.cumsum(values, axis=0)[:-1]

    sum_x, sum_y, yy = before(x), before(y), before(y * y)
    force = np.maximum(before(x * x) - sum_x**2 / count, 1e-12)
    answer = before(x * y) - sum_x * sum_y / count
    left = yy - sum_y**2 / count - answer**2 / force
    rest = len(x) - count  # the overall means are 0, so the sums after the failure are minus those before it
    return left + np.sum(y * y, axis=0) - yy - sum_y**2 / rest


def _judged(
    problem: Problem, noise: FloatArray, moment: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], FloatArray]:
    """Judge channels that may each fail at some frame.

    Args:
        problem: The recording.
        noise: ``(pads, 3, rows, cols)`` N, noise of each channel.
        moment: ``(pads, 3, rows, cols)`` frame at which each channel may fail.

    Returns:
        Three arrays ``(pads, 3, rows, cols)``: whether the channel certainly fails, whether it is silent afterwards,
        and its reading then (N).
    """
    after = np.arange(len(problem.time)).reshape(-1, 1, 1, 1, 1) >= moment
    size = np.abs(problem.simulated)
    most = np.max(size, axis=0, where=after, initial=0.0)
    touched = loaded_taxels(problem)[:, :, None]
    # before the failure, only forces as small as those after it count
    force, answer, _ = (s.sum(axis=0) for s in _sums(problem, ~after & (size <= most)))
    slope = answer / np.maximum(force, 1e-12)
    maybe = (np.abs(slope) > CHECKS.responds) & (np.abs(answer) > CHECKS.certain * noise * np.sqrt(force))
    maybe &= (touched & ~after).sum(axis=0) >= CHECKS.samples

    forces, answers, spreads = _sums(problem, after)
    force, answer = forces.sum(axis=0), answers.sum(axis=0)
    frames = np.stack([after[span].sum(axis=0) for span in problem.episodes])
    chance = (CHECKS.quiet * noise) ** 2 * np.maximum(frames, CHECKS.samples)
    silent = np.all(spreads <= np.maximum(chance, CHECKS.silent**2 * forces), axis=0)
    silent &= (np.abs(answer) < CHECKS.silent * force) | (np.abs(answer) < CHECKS.certain * noise * np.sqrt(force))

    missing = np.abs(slope) * forces - np.sign(slope) * answers
    maybe &= (
        silent
        & (np.abs(answer) < CHECKS.silent * force)
        & (missing.sum(axis=0) > CHECKS.certain * noise * np.sqrt(force))
    )
    maybe &= (touched & after).sum(axis=0) >= CHECKS.samples
    maybe &= most > CHECKS.counts * problem.noise.step  # rounding may hide a weaker response, as a loop may
    # the load must be released again: otherwise the channel may be saturated or late
    maybe &= (after & (size < CHECKS.silent * most)).sum(axis=0) >= CHECKS.samples
    failed, level = _confirmed(
        problem, noise, after, maybe, touched, missing > CHECKS.certain / 2 * noise * np.sqrt(forces)
    )
    return failed, silent, level


def _confirmed(
    problem: Problem,
    noise: FloatArray,
    after: NDArray[np.bool_],
    maybe: NDArray[np.bool_],
    touched: NDArray[np.bool_],
    missed: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], FloatArray]:
    """Return the channels whose response is missing although the contact is there, and the readings of their taxels.

    Args:
        problem: The recording.
        noise: ``(pads, 3, rows, cols)`` N, noise of each channel.
        after: ``(T, pads, 3, rows, cols)`` frames after the failure.
        maybe: ``(pads, 3, rows, cols)`` channels that may have failed.
        touched: ``(T, pads, 1, rows, cols)`` frames in which their taxels are loaded.
        missed: ``(episodes, pads, 3, rows, cols)`` episodes in which their response is missing.

    Returns:
        Two arrays ``(pads, 3, rows, cols)``: the failed channels, and their readings (N).
    """
    failed, level = maybe.copy(), np.zeros(maybe.shape)
    for pad, axis, row, col in np.argwhere(np.broadcast_to(maybe.any(axis=1, keepdims=True), maybe.shape)):
        place, course = (pad, axis, row, col), (slice(None), pad, axis, row, col)
        least = CHECKS.unusual * max(float(noise[place]), CHECKS.count * problem.noise.step)
        level[place], unlike = _stays(problem, problem.measured[course], after[course], least)
        if maybe[place]:
            loaded, others = touched[:, pad, 0, row, col] & after[course], ~maybe[pad, 2]
            spans = [span for span, own in zip(problem.episodes, missed[course], strict=True) if own]
            seen = sum(_fits(problem, pad, others, span, loaded[span]) for span in spans)
            failed[place] = seen >= (1 if unlike else CHECKS.repeats) and _responded(problem, place, after[course])
    return failed, level


def _responded(problem: Problem, place: tuple[int, int, int, int], after: NDArray[np.bool_]) -> bool:
    """Whether a channel responded before its failure when its taxel's three forces were as they are after it.

    The forces are compared one by one, because a dead band, coarse counts or a coupling of the axes may keep a channel
    that works from responding to weak forces.
    """
    pad, axis, row, col = place
    force, read = problem.simulated[:, pad, :, row, col], problem.measured[:, pad, axis, row, col]
    acts, like = force[after, axis], min(CHECKS.samples, int((~after).sum()))
    nearest = KDTree(force[~after]).query(force[after], k=np.arange(1, like + 1))[1]  # type: ignore[arg-type]
    expected, acts = read[~after][nearest].mean(axis=1), acts - acts.mean()
    return float(expected @ acts) > CHECKS.responds * float(acts @ acts)


def _sums(problem: Problem, where: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums ``(episodes, pads, 3, rows, cols)`` (N^2) of force^2, force * reading and reading^2, means subtracted."""
    out = []
    for span in problem.episodes:
        own = where[span]
        count = np.maximum(own.sum(axis=0), 1)
        x, y = problem.simulated[span], problem.measured[span]
        x = np.where(own, x - np.sum(x, axis=0, where=own) / count, 0.0)
        y = np.where(own, y - np.sum(y, axis=0, where=own) / count, 0.0)
        out.append([np.sum(x * x, axis=0), np.sum(x * y, axis=0), np.sum(y * y, axis=0)])
    force, answer, spread = np.moveaxis(np.array(out), 1, 0)
    return force, answer, spread


def _fits(problem: Problem, pad: int, others: NDArray[np.bool_], span: slice, loaded: NDArray[np.bool_]) -> bool:
    """Whether the other taxels of a pad read the simulated force while a taxel is loaded, so that the contact is there.

    Args:
        problem: The recording.
        pad: Index of the pad.
        others: ``(rows, cols)`` taxels that have not failed.
        span: Samples of an episode.
        loaded: Frames of the episode in which the taxel is loaded.
    """
    if loaded.sum() < CHECKS.samples:
        return False
    simulated, measured = problem.simulated[span, pad, 2], problem.measured[span, pad, 2]
    rest = problem.at_rest[span]
    zero = (
        measured[rest].mean(axis=0) if rest.sum() >= CHECKS.samples else np.median(problem.measured[:, pad, 2], axis=0)
    )
    x, y = simulated[loaded][:, others], (measured - zero)[loaded][:, others]
    gain = float(np.sum(x * y)) / max(float(np.sum(x * x)), 1e-12)
    return float(np.sum((y - gain * x) ** 2)) < CHECKS.misfit * float(np.sum(simulated[loaded] ** 2))


def _stays(problem: Problem, read: FloatArray, after: NDArray[np.bool_], least: float) -> tuple[float, bool]:
    """Return the reading (N) of a channel that may have failed, and whether it rules out a working, unloaded channel.

    It does if the reading is far from the level at rest, or never changes although noise changed it at rest.
    """
    level, rest = float(np.median(read[after])), ~after & problem.at_rest
    if not rest.any():
        return level, False
    changes = np.diff(read, prepend=read[:1]) != 0
    changes[after.argmax()] = False  # the failure itself
    frozen = not changes[after].any() and changes[rest].mean() * after.sum() > CHECKS.missing_changes
    return level, bool(frozen or abs(level - float(np.median(read[rest]))) > least)
