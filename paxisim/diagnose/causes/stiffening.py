"""Stiffening: the reading is not proportional to the force; all taxels share one curve."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import bent_apart
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import Free, Values
from paxisim.diagnose.data.problem import Problem

SCALE_MEANING = "force that is read correctly"

KNEE_MEANING = "power law if small, gain quadratic in force if large"

MATERIAL_CHANGE = 0.02  # materiality of the change in gain between a tenth of the peak and the peak


def _free(problem: Problem) -> tuple[Free, ...]:
    peak = problem.peak
    return (
        Free("exponent", "1", 1.0, 0.1, 5.0, 0.1, 0.008),
        # the gauge: the sensor may have been calibrated at any force up to the peak
        Free("scale", "N", 0.5 * peak, 0.02 * peak, 1.3 * peak, 0.2 * peak, spread=0.5 * peak, words=SCALE_MEANING),
        # two forms: a power law (small knee), or a gain that grows with the square of the force (large knee)
        Free("knee", "1", 0.3, 0.01, 30.0, 0.3, spread=3.0, words=KNEE_MEANING),
        # a gel stiffens on all axes together (1), an electronic readout on each axis separately (0)
        Free("shared", "1", 1.0, 0.0, 1.0, 0.3, spread=1.0, words="0 if axes stiffen separately, 1 if all together"),
    )


def _make(values: Values, problem: Problem) -> augment.Stiffening:
    return augment.Stiffening(*values)


def _size(values: Values, problem: Problem) -> float:
    law = _make([float(v) for v in values], problem)
    force = np.zeros((2, 1, 3, 1, 1))
    force[:, 0, 2, 0, 0] = 0.1 * problem.peak, problem.peak
    gains = (law(force) / np.where(force == 0, 1, force))[:, 0, 2, 0, 0]
    return float(abs(gains[1] - gains[0])) / MATERIAL_CHANGE


STIFFENING = FittedCause(
    name="stiffening",
    order=10,
    make=_make,
    excites="staircase",
    free=_free,
    starts=lambda p: [
        (0.9, share * p.peak, knee, shared) for share, knee in ((0.3, 0.05), (0.5, 1.0)) for shared in (1.0, 0.0)
    ],
    misfit=0.01,
    size=_size,
    barred=bent_apart,
    words="The reading is not proportional to the force.",
    picture="curves",
)
