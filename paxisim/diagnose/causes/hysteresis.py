"""Hysteresis: the reading at a given force differs between loading and unloading."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.kinds import FittedCause, Free, Gauge, Values, one_away
from paxisim.diagnose.data.problem import Problem

RADII = (0.01, 0.03, 0.08, 0.2, 0.5)  # radii of the play operators, in units of the peak

SMALL_MEANING = "0 if the sensor reads large forces correctly, 1 if it correctly reads swings too small for a loop"


def _make(values: Values, problem: Problem) -> augment.Hysteresis:
    weights, growths = np.split(np.asarray(values), 2)
    radii = problem.peak * np.array(RADII)
    return augment.Hysteresis(tuple(weights), tuple(radii), tuple(growths / problem.peak))


HYSTERESIS = FittedCause(
    name="hysteresis",
    order=30,
    make=_make,
    excites="triangles",
    # a prior that a loop has parts of all sizes: the radii are ours, not the sensor's
    free=lambda p: (
        *(Free(f"weight_{radius:g}_peak", "1", 0.0, 0.0, 0.9, 0.05, 0.012, spread=0.3) for radius in RADII),
        *(Free(f"growth_{radius:g}_peak", "1", 0.0, 0.0, 2.0, 0.05, 0.012, spread=0.3) for radius in RADII),
    ),
    starts=lambda p: [one_away(2 * len(RADII), i, 0.0, 0.1) for i in range(2 * len(RADII))],
    gauge=Gauge("calibrated_small", lambda v, p: 1 / max(1 - sum(v[: len(RADII)]), 0.04), SMALL_MEANING),
    remembers=True,
    misfit=0.06,
    words="The reading at a given force differs between loading and unloading.",
    picture="loops",
)
