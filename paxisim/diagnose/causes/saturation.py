"""Saturation: large forces are clipped."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.cause import Cause, Free, Gauge, Values
from paxisim.diagnose.causes.channel_curve import bent_apart
from paxisim.diagnose.problem import Problem

REACHED = 1.1  # times the peak; a larger limit acts like stiffening


def _make(values: Values, problem: Problem) -> augment.Saturation:
    return augment.Saturation(-values[0], values[0], values[1])


def _gain(values: Values, problem: Problem) -> float:
    force = np.full((1, 1, 3, 1, 1), problem.peak)
    return float(problem.peak / max(float(_make(values, problem)(force)[0, 0, 2, 0, 0]), 0.1 * problem.peak))


AT_PEAK = "0 if the sensor reads small forces right, 1 if it reads the peak force right"

SATURATION = Cause(
    "saturation",
    81,
    _make,
    "staircase",
    lambda p: (
        Free("limit", "N", 2.0 * p.peak, 0.15 * p.peak, 3 * p.peak, 0.1 * p.peak, 0.2 * p.peak),
        Free("softness", "1", 0.3, 0.0, 1.0, 0.2, words="share of the limit over which it sets in"),
    ),
    lambda p: [(share * p.peak, 0.2) for share in (0.5, 0.7, 0.9)] + [(0.9 * p.peak, 0.8)],
    gauge=Gauge("calibrated_at_peak", _gain, AT_PEAK),
    misfit=0.005,
    size=lambda v, p: REACHED * p.peak / v[0],
    barred=bent_apart,
    words="Large forces are clipped.",
    picture="curves",
)
