"""Failures: channels that respond until some moment and then no more, read off the streams for `dead_taxels`.

The moment is where two lines leave least of a channel: before it a multiple of the simulated force plus a constant,
after it a constant. It counts only if the channel answered forces of the same size before, and then misses what it
should have answered.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.silent import CLEAR, FRAMES, pressed_beyond

ANSWERED = 0.3  # of a force, that a channel that worked has read at least
SILENT = 0.12  # of a force, that one that has failed reads at most
TOLD = 8.0  # z-score of what was answered before, and of what is missing after
STILL = 1.8  # standard deviation of a failed channel within an episode, in units of its noise
FAR = 4.0  # times noise and rounding: a reading as far from that at rest is not one of a taxel that nothing touches
TWICE = 2  # episodes in which a taxel that reads as at rest must be missed: one contact may have passed it by
FROZEN = 20  # changes that are missing where noise would have made them
FITS = 0.1  # of the energy on a pad, that may be where it is not simulated while a taxel is missed
RESTING = 8  # frames at rest that tell a channel's noise in an episode


@dataclass(frozen=True, eq=False)
class Failures:
    """Channels that have failed, ``(pads, 3, rows, cols)`` each.

    Attributes:
        failed: Which.
        since: Seconds after the recording's first frame, halfway between the last that answered and the next.
        level: What they have read since then (N).
    """

    failed: NDArray[np.bool_]
    since: FloatArray
    level: FloatArray


def failures_of(problem: Problem) -> Failures | None:
    """The channels that fail in the course of a recording; None if there are none.

    A taxel that stops on all axes has one moment; where its shear is too weak to tell, it goes with the normal force.
    """
    if not problem.runs_through:
        return None
    noise = _noise(problem)
    costs = [_costs(problem, noise, pad) for pad in range(problem.alive.shape[0])]
    together = np.stack([np.argmin(cost.sum(axis=1), axis=0) for cost in costs])
    own = np.stack([np.argmin(cost, axis=0) for cost in costs])
    moment = np.broadcast_to(together[:, None], own.shape) + 1
    told, silent, level = _judged(problem, noise, moment)
    whole = (told.any(axis=1) & silent.all(axis=1))[:, None]
    alone, _, own_level = _judged(problem, noise, own + 1)
    failed = (whole | alone) & problem.alive
    if not failed.any():
        return None
    first = np.where(whole, moment, own + 1)
    since = (problem.time[first - 1] + problem.time[first]) / 2 - problem.time[0]
    return Failures(failed, since, np.where(whole, level, own_level))


def _noise(problem: Problem) -> FloatArray:
    """``(pads, 3, rows, cols)`` N, of each channel at rest in the usual episode, slow noise included."""
    rests = [problem.measured[span][problem.at_rest[span]] for span in problem.episodes]
    spreads = [rest.std(axis=0) for rest in rests if len(rest) >= RESTING]
    usual = np.median(problem.sigma, axis=0)
    return np.maximum(usual, np.median(spreads, axis=0)) if spreads else usual


def _costs(problem: Problem, noise: FloatArray, pad: int) -> FloatArray:
    """``(T - 1, 3, rows, cols)`` squares, in noise units, left of a pad if its channels fail at frame 1, 2, ..."""
    x = problem.simulated[:, pad] - problem.simulated[:, pad].mean(axis=0)
    y = (problem.measured[:, pad] - problem.measured[:, pad].mean(axis=0)) / noise[pad]
    count = np.arange(1, len(x)).reshape(-1, 1, 1, 1)

    def before(values: FloatArray) -> FloatArray:
        return np.cumsum(values, axis=0)[:-1]

    sum_x, sum_y, yy = before(x), before(y), before(y * y)
    force = np.maximum(before(x * x) - sum_x**2 / count, 1e-12)
    answer = before(x * y) - sum_x * sum_y / count
    left = yy - sum_y**2 / count - answer**2 / force
    rest = len(x) - count  # the means are 0 over all, so that the sums after are those before with the other sign
    return left + np.sum(y * y, axis=0) - yy - sum_y**2 / rest


def _judged(
    problem: Problem, noise: FloatArray, moment: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], FloatArray]:
    """Of channels that may each fail at some frame: whether it is told, whether they are silent after, and at what.

    Args:
        problem: The recording.
        noise: ``(pads, 3, rows, cols)`` N.
        moment: ``(pads, 3, rows, cols)`` the frame.
    """
    after = np.arange(len(problem.time)).reshape(-1, 1, 1, 1, 1) >= moment
    size = np.abs(problem.simulated)
    most = np.max(size, axis=0, where=after, initial=0.0)
    touched = (pressed_beyond(problem, max(0.06 * problem.peak, CLEAR)) & (problem.simulated > 0))[:, :, 2:]
    force, answer, _ = (s.sum(axis=0) for s in _sums(problem, ~after & (size <= most)))  # forces as there are after
    slope = answer / np.maximum(force, 1e-12)
    maybe = (np.abs(slope) > ANSWERED) & (np.abs(answer) > TOLD * noise * np.sqrt(force))
    maybe &= (touched & ~after).sum(axis=0) >= FRAMES

    forces, answers, spreads = _sums(problem, after)
    force, answer = forces.sum(axis=0), answers.sum(axis=0)
    frames = np.stack([after[span].sum(axis=0) for span in problem.episodes])
    silent = np.all(spreads <= (STILL * noise) ** 2 * np.maximum(frames, RESTING), axis=0)
    silent &= (np.abs(answer) < SILENT * force) | (np.abs(answer) < TOLD * noise * np.sqrt(force))

    missing = np.abs(slope) * forces - np.sign(slope) * answers
    maybe &= silent & (np.abs(answer) < SILENT * force) & (missing.sum(axis=0) > TOLD * noise * np.sqrt(force))
    maybe &= (touched & after).sum(axis=0) >= FRAMES
    maybe &= (after & (size < SILENT * most)).sum(axis=0) >= FRAMES  # let go again: else it may be saturated, or late
    told, level = _confirmed(problem, noise, after, maybe, touched, missing > TOLD / 2 * noise * np.sqrt(forces))
    return told, silent, level


def _confirmed(
    problem: Problem,
    noise: FloatArray,
    after: NDArray[np.bool_],
    maybe: NDArray[np.bool_],
    touched: NDArray[np.bool_],
    missed: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], FloatArray]:
    """``(pads, 3, rows, cols)`` channels that are missed where the contact is, and what their taxels read (N).

    Args:
        problem: The recording.
        noise: ``(pads, 3, rows, cols)`` N.
        after: ``(T, pads, 3, rows, cols)`` the frames after the failure.
        maybe: ``(pads, 3, rows, cols)`` channels that may have failed.
        touched: ``(T, pads, 1, rows, cols)`` where their taxels are loaded.
        missed: ``(episodes, pads, 3, rows, cols)`` where their answer is missing.
    """
    told, level = maybe.copy(), np.zeros(maybe.shape)
    for pad, axis, row, col in np.argwhere(np.broadcast_to(maybe.any(axis=1, keepdims=True), maybe.shape)):
        place, course = (pad, axis, row, col), (slice(None), pad, axis, row, col)
        least = FAR * max(float(noise[place]), 0.6 * problem.step)
        level[place], unlike = _stays(problem, problem.measured[course], after[course], least)
        if maybe[place]:
            loaded, others = touched[:, pad, 0, row, col] & after[course], ~maybe[pad, 2]
            spans = [span for span, own in zip(problem.episodes, missed[course], strict=True) if own]
            seen = sum(_fits(problem, pad, others, span, loaded[span]) for span in spans)
            told[place] = seen >= (1 if unlike else TWICE)
    return told, level


def _sums(problem: Problem, where: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """``(episodes, pads, 3, rows, cols)`` N^2: squared force, force times reading, squared reading, without means."""
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
    """Whether, while a taxel is loaded, the others of its pad read what is simulated: then the contact is there.

    Args:
        problem: The recording.
        pad: Number of the pad.
        others: ``(rows, cols)`` taxels that have not failed.
        span: An episode.
        loaded: Its frames in which the taxel is loaded.
    """
    if loaded.sum() < FRAMES:
        return False
    simulated, measured = problem.simulated[span, pad, 2], problem.measured[span, pad, 2]
    rest = problem.at_rest[span]
    zero = measured[rest].mean(axis=0) if rest.sum() >= RESTING else np.median(problem.measured[:, pad, 2], axis=0)
    x, y = simulated[loaded][:, others], (measured - zero)[loaded][:, others]
    gain = float(np.sum(x * y)) / max(float(np.sum(x * x)), 1e-12)
    return float(np.sum((y - gain * x) ** 2)) < FITS * float(np.sum(simulated[loaded] ** 2))


def _stays(problem: Problem, read: FloatArray, after: NDArray[np.bool_], least: float) -> tuple[float, bool]:
    """What a channel that may have failed reads, and whether one that works would not read it without force.

    It is far from what it read at rest, or it does not change at all although noise changed it at rest.
    """
    level, rest = float(np.median(read[after])), ~after & problem.at_rest
    if not rest.any():
        return level, False
    changes = np.diff(read, prepend=read[:1]) != 0
    changes[after.argmax()] = False  # the failure itself
    frozen = not changes[after].any() and changes[rest].mean() * after.sum() > FROZEN
    return level, bool(frozen or abs(level - float(np.median(read[rest]))) > least)
