"""Under load: the zero of a sensor whose steps hide it while nothing is pressed.

Where the noise does not carry a reading to the next count, a small offset shows only as taxels are pressed: they reach
the edges of the steps early or late.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.sums import Sums

TURNS = 4  # of Gauss-Newton
CHORD = 0.2  # of a step, on both sides of a force, at most: what is read beyond it says nothing of what lies there
BETWEEN = 0.02  # of a step from a whole count; a mean that is nearer to one says nothing more
FARTHEST = 0.3  # of a step, that a value moves in one of them
PRIOR = 1.0  # 1/N^2, that draws each value to 0
OTHER_LOADS = 0.25  # of what an offset brings, that it must bring under loads it was not read from
SMALL, LARGEST = 0.5, 0.99  # a force up to that share of a channel's largest, which is that quantile, is small


def tells_under_load(problem: Problem) -> bool:
    """Whether small offsets show only under load: the noise at rest does not reach the next count, or a gate's edge."""
    return problem.dither < max(0.25 * problem.step, _width(problem))


def _width(problem: Problem) -> float:
    """What a dead band holds back (N), if there is one."""
    return 0.0 if problem.gate is None else float(np.max(problem.gate.width))


def _hidden_by(problem: Problem) -> float:
    """How far forces may be apart (N) that are read alike."""
    return max(problem.step, _width(problem))


@dataclass(frozen=True, eq=False)
class UnderLoad:
    """Curves of time for every channel, ahead of the steps.

    Attributes:
        values: ``(channels, curves)`` newtons.
        zero: ``(T, pads, 3, rows, cols)`` newtons, the curves with those values.
        gain: ``(episodes,)`` squared residual (noise units) that they take away, fitted on the other episodes.
    """

    values: FloatArray
    zero: FloatArray
    gain: FloatArray


def under_load(problem: Problem, prediction: FloatArray, curves: list[FloatArray], *begins: FloatArray) -> UnderLoad:
    """Fit curves of time behind `prediction` and ahead of the steps, for every channel.

    A sample tells of them as far as its mean reading moves with the force, which it does at the edge of a step.

    Args:
        problem: The recording.
        prediction: ``(T, pads, 3, rows, cols)`` newtons.
        curves: ``(T,)`` each.
        begins: ``(channels, curves)`` values to begin with, for each channel those that leave least; default: what is
            read at rest.
    """
    basis = np.stack(curves)
    shape = problem.alive.shape
    every = np.ones(len(problem.time), dtype=bool)
    if not begins:  # whole counts show without a load
        left = problem.measured - problem.read(prediction)
        begins = (_ahead_of_steps(problem, Sums(problem, left, curves, quiet_frames(problem)).values(PRIOR)),)
    farthest = FARTHEST * _hidden_by(problem) / np.abs(basis).max(axis=1)

    def zero(values: FloatArray) -> FloatArray:
        return np.einsum("ci,it->tc", values, basis).reshape(-1, *shape)

    weight = problem.weight**2
    values: FloatArray = np.zeros_like(begins[0])
    least = np.full(len(values), np.inf)
    for begin in begins:
        left = np.einsum(
            "t...,t...->...", weight, (problem.measured - problem.read(prediction + zero(begin))) ** 2
        ).ravel()
        values, least = np.where((left < least)[:, None], begin, values), np.minimum(left, least)
    best: FloatArray = values
    others: FloatArray = np.broadcast_to(values, (len(problem.episodes), *values.shape))
    least, change = np.full(len(values), np.inf), np.zeros_like(values)
    for _ in range(TURNS):
        miss, slope = at_edges(problem, prediction + zero(values))
        left = np.einsum("t...,t...->...", weight, miss**2).ravel()
        sums = Sums(problem, miss + slope * zero(values), curves, every, slope)
        better = (left < least)[:, None]
        away = np.clip(sums.values_of_others(PRIOR) - values, -farthest, farthest)
        others = np.where(better, values + away, others)
        on = np.clip(sums.values(PRIOR) - values, -farthest, farthest)
        change = np.where(better, on, change / 2)  # or it went too far
        best, least = np.where(better, values, best), np.minimum(least, left)
        values = best + change
    before = weight * (problem.measured - problem.read(prediction)) ** 2
    known = weight * (problem.measured - problem.read(prediction + zero(best))) ** 2
    gain = np.empty(len(problem.episodes))
    for number, span in enumerate(problem.episodes):
        after = weight * (problem.measured - problem.read(prediction + zero(others[number]))) ** 2
        # what is left out moves a value along a tangent, which is no good far from where it touches
        astray = _elsewhere(after, span) > _elsewhere(known, span)
        gain[number] = np.sum(before[span] - np.where(astray, known[span], after[span]))
    return UnderLoad(best, zero(best), gain)


def _elsewhere(energy: FloatArray, span: slice) -> FloatArray:
    """``(pads, 3, rows, cols)`` energy outside an episode."""
    return energy.sum(axis=0) - energy[span].sum(axis=0)


def _ahead_of_steps(problem: Problem, reading: FloatArray) -> FloatArray:
    """The zeros ``(channels, 1)`` behind the mean readings at rest of shear that changes between two counts.

    A normal reading is cut off below 0, where many zeros are read alike.
    """
    if problem.step == 0 or problem.gate is not None:
        return reading
    reading = reading.reshape(problem.alive.shape)
    between = np.abs(reading / problem.step - np.rint(reading / problem.step)) > BETWEEN
    between[:, 2] = False
    return np.where(between, problem.counting.unread(reading), reading).reshape(-1, 1)


def at_other_loads(problem: Problem, prediction: FloatArray) -> float:
    """The energy, in units of the noise, that a constant takes away under loads it was not read from.

    Each channel's is read where the force is small and judged where it is large, and the other way round.

    Args:
        problem: The recording.
        prediction: ``(T, pads, 3, rows, cols)`` newtons.
    """
    weight = problem.weight**2
    farthest = FARTHEST * _hidden_by(problem)
    before = problem.measured - problem.read(prediction)
    size = np.abs(prediction)
    small = size <= SMALL * np.quantile(size, LARGEST, axis=0)
    quiet = small & quiet_frames(problem)[:, None, None, None, None]
    total = 0.0
    for own, begin in ((small, quiet), (~small, np.zeros_like(small))):
        known = weight * own
        values = (weight * begin * before).sum(axis=0) / ((weight * begin).sum(axis=0) + PRIOR)
        for _ in range(TURNS):
            miss, slope = at_edges(problem, prediction + values)
            share = (known * slope * miss).sum(axis=0) / ((known * slope**2).sum(axis=0) + PRIOR)
            values = values + np.clip(share, -farthest, farthest)
        after = problem.measured - problem.read(prediction + values)
        total += float(np.sum((weight * (before**2 - after**2))[~own]))
    return total


def goes_with_load(problem: Problem, prediction: FloatArray, constant: UnderLoad) -> bool:
    """Whether a constant is the image of what another cause leaves, which is not the same under every load.

    Beside a dead band that is not told, as what passes its edge is not the same, either.
    """
    return problem.gate is None and bool(at_other_loads(problem, prediction) < OTHER_LOADS * constant.gain.sum())


def quiet_frames(problem: Problem) -> NDArray[np.bool_]:
    """``(T,)`` where nothing is pressed; all, if that is never."""
    return problem.at_rest if problem.at_rest.any() else np.ones(len(problem.time), dtype=bool)


def at_edges(problem: Problem, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``(T, pads, 3, rows, cols)`` what is read beside `force` (N), and by how much its mean reading moves with it."""
    small = CHORD * _hidden_by(problem)
    if problem.gate is None:
        small = min(small, max(1.5 * problem.dither, 0.05 * problem.step))
    slope = (problem.read(force + small) - problem.read(force - small)) / (2 * small)
    return problem.measured - problem.read(force), slope
