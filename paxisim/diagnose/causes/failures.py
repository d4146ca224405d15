"""Failures: channels that stop responding at some moment, read off the streams for `dead_taxels`.

Before the moment, the reading of a channel is a multiple of the simulated force plus a constant; after it, a constant.
The moment minimises the squared residual. A failure counts only if the channel responded to forces of the same size
before the moment, and the response that should follow is missing although the contact is there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.channels import centred, loaded_taxels, response_of, rest_noise
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import CHECKS


@dataclass(frozen=True, eq=False)
class Failures:
    """Channels that have failed; each array is ``(pads, 3, rows, cols)``.

    Attributes:
        failed: Whether the channel has failed.
        since: Time of the failure in seconds after the recording's first frame, halfway between the last frame before
            the failure and the first one after it.
        level: Median reading since then (N), of all channels of a taxel.
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
    noise = rest_noise(problem)
    gains = [_gains(problem, noise, pad) for pad in range(len(noise))]
    own = np.stack([gain.argmax(axis=0) for gain in gains]) + 1
    shared = np.stack([gain.sum(axis=1, keepdims=True).argmax(axis=0) for gain in gains]) + 1
    shared = np.broadcast_to(shared, own.shape)
    some, silent = _judged(problem, noise, shared)
    whole = (some.any(axis=1) & silent.all(axis=1))[:, None]
    failed = (whole | _judged(problem, noise, own)[0]) & problem.alive
    if not failed.any():
        return None
    first = np.where(whole, shared, own)
    since = (problem.time[first - 1] + problem.time[first]) / 2 - problem.time[0]
    level = np.zeros(failed.shape)
    for place in zip(*np.nonzero(failed), strict=True):
        level[place] = np.median(problem.measured[(slice(first[place], None), *place)])
    return Failures(failed, since, level)


def _gains(problem: Problem, noise: FloatArray, pad: int) -> FloatArray:
    """``(T - 1, 3, rows, cols)`` decrease of a pad's squared residual by a failure at frame 1, 2, ...; in noise units.

    One pad at a time limits the memory.
    """
    x, y = centred(problem.simulated[:, pad]), centred(problem.measured[:, pad]) / noise[pad]
    before = np.arange(1, len(x)).reshape(-1, 1, 1, 1)
    sum_x, sum_y, xx, xy = (np.cumsum(values, axis=0)[:-1] for values in (x, y, x * x, x * y))
    response = (xy - sum_x * sum_y / before) ** 2 / np.maximum(xx - sum_x**2 / before, 1e-12)
    return response + sum_y**2 * (1 / before + 1 / (len(x) - before))  # all readings sum to 0


def _judged(
    problem: Problem, noise: FloatArray, first: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Judge channels that may each fail at some frame.

    Args:
        problem: The recording.
        noise: ``(pads, 3, rows, cols)`` N, noise of each channel.
        first: ``(pads, 3, rows, cols)`` frame at which each channel may fail.

    Returns:
        Two arrays ``(pads, 3, rows, cols)``: whether the channel certainly fails, and whether it is silent afterwards.
    """
    after = np.arange(len(problem.time)).reshape(-1, 1, 1, 1, 1) >= first
    size = np.abs(problem.simulated)
    most = np.max(size, axis=0, where=after, initial=0.0)
    loaded = loaded_taxels(problem)[:, :, None]
    # before the failure, only forces as small as those after it count
    before = response_of(problem.episodes, problem.simulated, problem.measured, ~after & (size <= most)).total
    each = response_of(problem.episodes, problem.simulated, problem.measured, after)
    silent = each.is_quiet(noise).all(axis=0) & each.total.is_missing(noise)
    sign = np.sign(before.slope)
    fails = silent & (np.abs(each.total.slope) < CHECKS.silent)
    fails &= (np.abs(before.slope) > CHECKS.responds) & (np.abs(before.score(noise)) > CHECKS.certain)
    fails &= -sign * each.total.score(noise, before.slope) > CHECKS.certain
    # the load must be released again: otherwise the channel may be saturated or late
    for frames in (loaded & ~after, loaded & after, after & (size < CHECKS.silent * most)):
        fails &= frames.sum(axis=0) >= CHECKS.samples
    missed = -sign * each.score(noise, before.slope) > CHECKS.certain / 2
    others, sure = ~fails[:, 2], fails.copy()
    for place in zip(*np.nonzero(fails), strict=True):
        pad, course = place[0], (slice(None), *place)
        touched = np.broadcast_to(loaded, after.shape)[course] & after[course]
        spans = [span for span, own in zip(problem.episodes, missed[course], strict=True) if own]
        seen = sum(_fits(problem, pad, others[pad], span, touched[span]) for span in spans)
        least = CHECKS.unusual * max(float(noise[place]), CHECKS.count * problem.noise.step)
        unlike = _is_unlike(problem.measured[course], int(first[place]), problem.at_rest, least)
        sure[place] = seen >= (1 if unlike else CHECKS.repeats)
    return sure, silent


def _fits(problem: Problem, pad: int, others: NDArray[np.bool_], span: slice, loaded: NDArray[np.bool_]) -> bool:
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


def _is_unlike(read: FloatArray, first: int, at_rest: NDArray[np.bool_], least: float) -> bool:
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
