"""Rotation: the sensor's axes are rotated relative to those of the simulation, each pad's by angles of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import mixes_alike
from paxisim.diagnose.causes.kinds import AXES, FittedCause
from paxisim.diagnose.causes.parameters import Free, one_away
from paxisim.diagnose.data.problem import Problem

TILT_PRIOR = 0.01  # rad, standard deviation of the prior for the tilt of a sensor in its mount
MAX_TILT = 0.09  # rad

FREE = (
    *(Free(f"about_{axis}", "rad", 0.0, -MAX_TILT, MAX_TILT, 0.05, 0.012, TILT_PRIOR) for axis in AXES[:2]),
    Free("about_z", "rad", 0.0, -0.6, 0.6, 0.05, 0.012),
)
MOST_PADS = 4  # pads with angles of their own; more pads share theirs, as each angle adds to the time of a fit


def _pads(problem: Problem) -> int:
    """Number of pads with angles of their own; 1 if all share them."""
    pads = problem.measured.shape[1]
    return pads if pads <= MOST_PADS else 1


def _free(problem: Problem) -> tuple[Free, ...]:
    """The angles of each pad in turn; their names end in the pad's index if there are several."""
    if _pads(problem) == 1:
        return FREE
    return tuple(replace(f, name=f"{f.name}_{pad}") for pad in range(_pads(problem)) for f in FREE)


def _starts(problem: Problem) -> list[list[float]]:
    count = len(FREE) * _pads(problem)
    return [one_away(count, i, 0.0, 0.05) for i in range(count)]


ROTATION = FittedCause(
    name="rotation",
    order=51,
    make=lambda v, p: augment.Rotation(np.reshape(v, (_pads(p), len(FREE)))),
    excites="slides",
    free=_free,
    starts=_starts,
    copies=_pads,
    misfit=0.002,
    barred=mixes_alike,
    words="The sensor's axes are rotated relative to those of the simulation.",
    picture="axes",
)
