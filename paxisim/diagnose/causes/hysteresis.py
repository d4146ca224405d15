"""Hysteresis: the reading at a given force differs between loading and unloading."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.causes.kinds import FittedCause, Free, Gauge, one_away

RADII = (0.02, 0.06, 0.15, 0.4)  # radii of the play operators, in units of the peak

SMALL_MEANING = "0 if the sensor reads large forces correctly, 1 if it correctly reads swings too small for a loop"

HYSTERESIS = FittedCause(
    name="hysteresis",
    order=30,
    make=lambda v, p: augment.Hysteresis(tuple(v), tuple(radius * p.peak for radius in RADII)),
    excites="triangles",
    free=lambda p: tuple(Free(f"weight_{radius:g}_peak", "1", 0.0, 0.0, 0.24, 0.05, 0.012) for radius in RADII),
    starts=lambda p: [one_away(len(RADII), i, 0.0, 0.1) for i in range(len(RADII))],
    gauge=Gauge("calibrated_small", lambda v, p: 1 / max(1 - sum(v), 0.04), SMALL_MEANING),
    remembers=True,
    misfit=0.06,
    words="The reading at a given force differs between loading and unloading.",
    picture="loops",
)
