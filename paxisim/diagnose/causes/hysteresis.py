"""Hysteresis: the reading at a given force differs between loading and unloading."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from paxisim import augment
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import Derived, Free, Gauge, Values, one_away
from paxisim.diagnose.data.problem import Problem

RADII = (0.01, 0.03, 0.08, 0.2, 0.5)  # radii of the play operators, in units of the peak

FAMILY = (("weight of the play of half-width", 0.9), ("growth with the load of the play of half-width", 2.0))
MATERIAL_WIDTH = 0.004  # materiality of the width of the loop, relative to the peak

WAY = np.linspace(0, 1, 51)  # forces of a loop, relative to the peak

SMALL_MEANING = "0 if the sensor reads large forces correctly, 1 if it correctly reads swings too small for a loop"


def _make(values: Values, problem: Problem) -> augment.Hysteresis:
    weights, growths = np.split(np.asarray(values), 2)
    radii = problem.peak * np.array(RADII)
    return augment.Hysteresis(tuple(weights), tuple(radii), tuple(growths / problem.peak))


def _width(values: Values, problem: Problem) -> float:
    """Largest difference between unloading and loading at the same force, relative to the peak.

    It is that of the second cycle from 0 to the peak, as the first one begins in the virgin state.
    """
    cycle = np.concatenate([WAY, WAY[-2:0:-1]])
    force = np.zeros((2 * len(cycle) + 1, 1, 3, 1, 1))
    force[:, 0, 2, 0, 0] = problem.peak * np.append(np.tile(cycle, 2), 0.0)
    read = _make(values[: 2 * len(RADII)], problem).run(force, np.arange(len(force), dtype=np.float64))
    second = read[len(cycle) :, 0, 2, 0, 0]
    return float(np.max(second[::-1] - second)) / problem.peak


def _basis(problem: Problem, x: NDArray[np.floating]) -> list[NDArray[np.floating]]:
    lags = [problem.run(augment.Hysteresis((1.0,), (radius * problem.peak,)), x) - x for radius in RADII]
    return [*lags, *(np.abs(x) / problem.peak * lag for lag in lags)]


HYSTERESIS = FittedCause(
    name="hysteresis",
    order=30,
    make=_make,
    basis=_basis,
    excites="triangles",
    free=lambda p: tuple(
        Free(f"play_{i}", "1", 0.0, 0.0, high, 0.05, 0.01, spread=0.3, words=f"{words} {radius:g} times the peak")
        for i, (radius, words, high) in enumerate((r, *own) for own in FAMILY for r in RADII)
    ),
    derived=(Derived("loop_width", "1", _width, "largest difference between unloading and loading, over the peak"),),
    starts=lambda p: [one_away(2 * len(RADII), i, 0.0, 0.1) for i in range(2 * len(RADII))],
    gauge=Gauge("calibrated_small", lambda v, p: 1 / max(1 - sum(v[: len(RADII)]), 0.04), SMALL_MEANING),
    remembers=True,
    misfit=0.05,
    size=lambda v, p: _width(v, p) / MATERIAL_WIDTH,
    words="The reading at a given force differs between loading and unloading.",
    picture="loops",
)
