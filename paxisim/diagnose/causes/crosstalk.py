"""Crosstalk: a taxel also reads part of the force on its neighbours."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.cause import AXES, Cause, Free, Values
from paxisim.diagnose.causes.channel_curve import no_neighbours
from paxisim.diagnose.problem import Problem

SHARED = 0.012  # materiality of the share of its load that a taxel passes on to its neighbours


def _size(values: Values, problem: Problem) -> float:
    # the 4 nearest neighbours, and 16 more at distances up to 2.8 pitches
    return max(map(abs, values[:3])) * (4 + 7 * values[3]) / SHARED


CROSSTALK = Cause(
    "crosstalk",
    41,
    lambda v, p: augment.Crosstalk(tuple(v[:3]), length=1.0, far=v[3], taken=v[4]),
    "probe",
    lambda p: (
        # two forms: a gel moves all axes alike, a magnet's field reaches each axis differently
        *(Free(f"strength_{axis}", "1", 0.0, -0.3, 0.3, 0.02, 0.001) for axis in AXES),
        Free("far", "1", 0.5, 0.0, 3.0, 0.5, words="factor for taxels beyond the nearest neighbours"),
        # the gauge: calibrated on single taxels (0: nothing is lost), or with flat presses (1: they are read correctly)
        Free("taken", "1", 0.5, 0.0, 1.0, 0.3, words="0 if a taxel keeps its load, 1 if it loses what it passes on"),
    ),
    lambda p: [
        (*(0.02 * np.array(axes)), far, taken)
        for axes in ((1, 1, 1), (1, 1, 0), (0, 0, 1))
        for far, taken in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
    ],
    misfit=0.03,
    size=_size,
    barred=no_neighbours,
    words="A taxel also reads part of the force on its neighbours.",
    picture="neighbours",
)
