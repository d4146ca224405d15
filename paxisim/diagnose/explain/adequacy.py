"""Adequacy: tests for structure in the residual that noise and tolerances do not account for.

Each test yields a statistic and a limit. A single statistic above its limit is enough: a model whose residual has
structure is never reported as a full explanation. The tests process one episode at a time to save memory.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.explain.shapes import Shapes, others, shapes_of
from paxisim.diagnose.result import LeftOver
from paxisim.diagnose.rules import STRUCTURE as LIMITS

_WINDOW = 1024  # frames per spectrum


def left_over(problem: Problem, prediction: FloatArray) -> tuple[LeftOver, ...]:
    """Structure in the residual of a prediction, strongest first; empty if there is none.

    A true cause whose fitted form differs slightly from the sensor's leaves a small part of its effect in the residual.
    Each limit is therefore at least a small share of the same statistic for the plain simulation.

    Args:
        problem: The recording.
        prediction: ``(T, pads, 3, rows, cols)`` newtons, the output of the model.
    """
    found = _tests(problem, prediction)
    if any(one.statistic > one.limit for one in found.values()):
        for test, before in _tests(problem, problem.simulated).items():
            if test in found:
                found[test] = replace(found[test], limit=max(found[test].limit, LIMITS.form * before.statistic))
    results = [*found.values()]
    if problem.has_contact:  # shapes of the force; without contact there is none
        results += _shapes(shapes_of(problem, prediction))
    return tuple(sorted((f for f in results if f.statistic > f.limit), key=lambda f: -f.statistic / f.limit))


def _tests(problem: Problem, prediction: FloatArray) -> dict[str, LeftOver]:
    """The result of each test by the test's name; a test that has too few samples has none."""
    residual = _residual(problem, prediction)
    results = {test.__name__: test(problem, prediction, residual) for test in TESTS}
    return {name: result for name, result in results.items() if result is not None}


def _residual(problem: Problem, prediction: FloatArray) -> NDArray[np.float32]:
    """The residual divided by the noise, after subtracting the mean of each channel."""
    amount, weights = np.zeros(problem.alive.shape), np.zeros(problem.alive.shape)
    residual = np.empty(prediction.shape, dtype=np.float32)
    for span in problem.episodes:
        difference = problem.measured[span] - problem.read(prediction[span])
        square = problem.weight[span] ** 2
        amount += np.sum(square * difference, axis=0)
        weights += square.sum(axis=0)
        residual[span] = difference
    mean = amount / np.maximum(weights, 1e-12)
    for span in problem.episodes:
        residual[span] = (residual[span] - mean) * problem.weight[span]
    return residual


def _under_load(problem: Problem, prediction: FloatArray, residual: NDArray[np.float32]) -> LeftOver | None:
    """Test whether the residual of pressed taxels exceeds that at rest by more than the tolerances allow."""
    pressed, quiet = np.zeros(2), np.zeros(2)
    for span in problem.episodes:
        load = np.abs(prediction[span]).max(axis=2, keepdims=True) > 0.1 * problem.peak
        square, loaded, rest = residual[span] ** 2, load & problem.alive, problem.at_rest[span]
        pressed += square[loaded].sum(dtype=float), loaded.sum()
        quiet += square[rest].sum(dtype=float), rest.sum() * problem.alive.sum()
    if pressed[1] < 100:
        return None
    ratio = pressed[0] / pressed[1] / max(quiet[0] / max(quiet[1], 1), 1.0)
    return LeftOver("the residual grows under load by more than the tolerances allow", float(ratio), LIMITS.contact)


def _together(problem: Problem, prediction: FloatArray, residual: NDArray[np.float32]) -> LeftOver | None:
    """Test whether the residuals of a pad's taxels are correlated at rest; independent noise is not."""
    means, energy = [], np.zeros(problem.alive.shape[:2])
    for span in problem.episodes:
        rest = residual[span][problem.at_rest[span]].astype(float)
        means.append(rest.sum(axis=(3, 4)))
        energy += np.sum(rest**2, axis=(0, 3, 4))
    mean = np.concatenate(means)
    if len(mean) < 20:
        return None
    count = np.maximum(problem.alive.sum(axis=(2, 3)), 1)
    each = np.maximum(energy / count / len(mean), 0.1)
    ratio = np.mean(mean**2, axis=0) / count / each
    return LeftOver("the taxels of a pad change together at rest", float(ratio.max()), LIMITS.common)


def _bursts(problem: Problem, prediction: FloatArray, residual: NDArray[np.float32]) -> LeftOver | None:
    """Test whether a few frames at rest carry most of the energy."""
    energy = np.concatenate(
        [np.mean(residual[span][problem.at_rest[span]] ** 2, axis=(1, 2, 3, 4)) for span in problem.episodes]
    )
    if len(energy) < 50:
        return None
    worst = np.sort(energy)[-max(3, len(energy) // 100) :].mean()
    ratio = float(worst / max(np.median(energy), 1.0))
    return LeftOver("bursts: a few frames at rest carry most of the error", ratio, LIMITS.burst)


def _lines(problem: Problem, prediction: FloatArray, residual: NDArray[np.float32]) -> LeftOver | None:
    """Test for a spectral line at rest, such as mains hum or its alias."""
    length = min(max(span.stop - span.start for span in problem.episodes), _WINDOW)
    frequency = np.fft.rfftfreq(length, problem.interval)
    window = np.hanning(length)[:, None]
    power, energy = np.zeros(len(frequency)), 0.0
    for span in problem.episodes:
        part = residual[span].reshape(span.stop - span.start, -1) * problem.at_rest[span, None]
        energy += np.sum(part**2, dtype=float)
        for start in range(0, len(part) - length + 1, length):
            power += np.sum(np.abs(np.fft.rfft(part[start : start + length] * window, axis=0)) ** 2, axis=1)
    if len(power) < 24 or energy < 0.1 * problem.at_rest.sum() * problem.alive.size:
        return None
    ratios = np.zeros(len(power))
    for i in range(6, len(power) - 3):
        beside = np.r_[max(2, i - 14) : i - 3, i + 4 : min(len(power), i + 15)]
        ratios[i] = power[i] / max(np.median(power[beside]), 1e-12)
    at = int(ratios.argmax())
    return LeftOver(f"a spectral line at {frequency[at]:.1f} Hz at rest", float(ratios[at]), LIMITS.line)


def _neighbours(problem: Problem, prediction: FloatArray, residual: NDArray[np.float32]) -> LeftOver | None:
    """Test whether a taxel reads the force on one of its neighbours."""
    rows, cols = prediction.shape[-2:]
    sides = ((0, 1), (0, -1), (1, 0), (-1, 0))
    projections = np.zeros((len(sides), len(problem.episodes), prediction.shape[1], rows, cols))
    products = np.zeros_like(projections)
    for number, span in enumerate(problem.episodes):
        x, weight = prediction[span], problem.weight[span]
        padded = np.pad(x, ((0, 0), (0, 0), (0, 0), (1, 1), (1, 1)), mode="edge")
        for side, (down, right) in enumerate(sides):
            effect = (padded[..., 1 + down : 1 + down + rows, 1 + right : 1 + right + cols] - x) * weight
            projections[side, number] = np.sum(effect * residual[span], axis=(0, 2))
            products[side, number] = np.sum(effect**2, axis=(0, 2))
    share = np.clip(others(projections, 1) / (others(products, 1) + 1.0), 0.0, 1.2)
    gain = np.sum(2 * share * projections - share**2 * products, axis=1).max(axis=0) / len(problem.time)
    pad, row, col = np.unravel_index(int(gain.argmax()), gain.shape)
    taxel = f"{problem.pads[pad] if problem.pads else f'pad {pad}'}, taxel ({row}, {col}),"
    return LeftOver(f"{taxel} reads the force on a neighbour", float(gain.max()), LIMITS.neighbour)


def _held(problem: Problem, prediction: FloatArray, residual: NDArray[np.float32]) -> LeftOver | None:
    """Test for frames that repeat although the force changes."""
    same, moved = 0, 0
    for span in problem.episodes:
        change = np.abs(np.diff(problem.simulated[span], axis=0))
        clear = np.any(change > 2 * problem.noise.step + 6 * problem.noise.sigma[span][1:], axis=(1, 2, 3, 4))
        still = np.all(np.diff(problem.measured[span], axis=0) == 0, axis=(1, 2, 3, 4))
        same, moved = same + int((clear & still).sum()), moved + int(clear.sum())
    return LeftOver("frames are repeated while the force changes", same / moved, LIMITS.held) if moved >= 20 else None


TESTS = (_under_load, _together, _bursts, _lines, _neighbours, _held)


def _shapes(shapes: Shapes) -> Iterator[LeftOver]:
    """Test whether a shape explains held-out residual energy, consistently over episodes."""
    limit = LIMITS.shape + (LIMITS.form * shapes.explained + LIMITS.tolerated**2 * shapes.load) / shapes.samples
    for name, gain in zip(shapes.names, shapes.gains(), strict=True):
        chance = float(gain.std(ddof=1)) * np.sqrt(len(gain)) if len(gain) > 1 else 0.0
        if gain.sum() > LIMITS.agree * chance:
            yield LeftOver(f"the residual correlates with {name}", float(gain.sum()) / shapes.samples, limit)
