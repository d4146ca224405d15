"""Axis gain: each axis reads too high or too low by a constant factor."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import bent_apart
from paxisim.diagnose.causes.kinds import AXES, FittedCause
from paxisim.diagnose.causes.parameters import Free, one_away

AXIS_GAIN = FittedCause(
    name="axis_gain",
    order=60,
    make=lambda v, p: augment.AxisGain(tuple(v)),
    excites="loads",
    free=lambda p: tuple(Free(f"gain_{axis}", "1", 1.0, 0.2, 5.0, 0.1, 0.015) for axis in AXES),
    starts=lambda p: [one_away(3, k, 1.0, 0.1) for k in range(3)],
    misfit=0.002,
    barred=bent_apart,
    words="Each axis reads too high or too low by a constant factor.",
    picture="gains",
)
