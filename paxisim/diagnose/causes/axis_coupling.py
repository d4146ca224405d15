"""Axis coupling: a force on one axis leaks into the reading of another axis."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import mixes_alike
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import Free, Values, one_away
from paxisim.diagnose.data.problem import Problem

# Within the plane of the pad only the symmetric part: the antisymmetric part is a `rotation` about the normal.
COUPLED = {
    "z_to_x": ((0, 2),),
    "z_to_y": ((1, 2),),
    "x_to_z": ((2, 0),),
    "y_to_z": ((2, 1),),
    "x_and_y": ((0, 1), (1, 0)),
}


def _make(values: Values, problem: Problem) -> augment.AxisCoupling:
    matrix = np.eye(3)
    for places, value in zip(COUPLED.values(), values, strict=True):
        for place in places:
            matrix[place] = value
    return augment.AxisCoupling(matrix)


AXIS_COUPLING = FittedCause(
    name="axis_coupling",
    order=50,
    make=_make,
    excites="slides",
    free=lambda p: tuple(Free(name, "1", 0.0, -0.6, 0.6, 0.05, 0.012) for name in COUPLED),
    starts=lambda p: [one_away(len(COUPLED), i, 0.0, 0.1) for i in range(len(COUPLED))],
    misfit=0.002,
    barred=mixes_alike,
    words="A force on one axis leaks into the reading of another axis.",
    picture="axes",
)
