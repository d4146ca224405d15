"""Rotation: the sensor's axes are rotated relative to those of the simulation."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import mixes_alike
from paxisim.diagnose.causes.kinds import AXES, FittedCause, Free, one_away
from paxisim.diagnose.data.problem import Problem

TILT_PRIOR = 0.01  # rad, standard deviation of the prior for the tilt of a sensor in its mount
MAX_TILT = 0.09  # rad


def _free(problem: Problem) -> tuple[Free, ...]:
    tilts = (Free(f"about_{axis}", "rad", 0.0, -MAX_TILT, MAX_TILT, 0.05, 0.012, TILT_PRIOR) for axis in AXES[:2])
    return (*tilts, Free("about_z", "rad", 0.0, -0.6, 0.6, 0.05, 0.012))


ROTATION = FittedCause(
    name="rotation",
    order=51,
    make=lambda v, p: augment.Rotation((tuple(v),)),
    excites="slides",
    free=_free,
    starts=lambda p: [one_away(3, k, 0.0, 0.05) for k in range(3)],
    misfit=0.002,
    barred=mixes_alike,
    words="The sensor's axes are rotated relative to those of the simulation.",
    picture="axes",
)
