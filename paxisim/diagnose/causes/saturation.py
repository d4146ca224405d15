"""Saturation: large forces are clipped."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import bent_apart
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import Free, Gauge, Values
from paxisim.diagnose.data.problem import FloatArray, Problem

MATERIAL_LIMIT = 1.1  # materiality of the limit, in units of the peak; a larger limit acts like stiffening


def _limits(values: Values) -> FloatArray:
    """``(3,)`` N, the largest reading of x, y and z."""
    return values[0] * np.array([values[2], values[2], 1.0])


def _make(values: Values, problem: Problem) -> augment.Saturation:
    limits = _limits(values)
    return augment.Saturation(tuple(-limits), tuple(limits), values[1])


def _gain(values: Values, problem: Problem) -> FloatArray:
    read = _make(values, problem)(problem.peaks[None, None, :, None, None])[0, 0, :, 0, 0]
    gains = problem.peaks / np.maximum(read, 0.1 * problem.peaks)
    return np.maximum(gains, gains[2])  # shear may have been calibrated with the normal force's gain


def _starts(problem: Problem) -> list[Values]:
    """One limit for all axes, and limits at a share of each axis's own peak."""
    shapes = [(0.5, 0.2), (0.7, 0.2), (0.9, 0.2), (0.9, 0.8)]
    own = float(problem.peaks[0] / problem.peaks[2])
    return [(share * problem.peak, softness, shear) for share, softness in shapes for shear in (1.0, own)]


AT_PEAK_MEANING = "0 if the sensor reads small forces correctly, 1 if it reads the peak force correctly"

SATURATION = FittedCause(
    name="saturation",
    order=81,
    make=_make,
    excites="staircase",
    free=lambda p: (
        Free("limit", "N", 2.0 * p.peak, 0.15 * p.peak, 3 * p.peak, 0.1 * p.peak, 0.2 * p.peak),
        Free("softness", "1", 0.3, 0.0, 1.0, 0.2, words="share of the limit over which it sets in"),
        # two forms: one range in newtons, or one range in sensor units, which differs in newtons between axes
        Free("shear", "1", 1.0, 0.05, 2.0, 0.2, spread=0.5, words="limit of shear relative to that of normal force"),
    ),
    starts=_starts,
    gauge=Gauge("calibrated_at_peak", _gain, AT_PEAK_MEANING, by_axis=True),
    misfit=0.005,
    size=lambda v, p: MATERIAL_LIMIT * float(np.max(p.peaks / _limits(v))),
    barred=bent_apart,
    words="Large forces are clipped.",
    picture="curves",
)
