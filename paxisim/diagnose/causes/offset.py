"""Offset: the sensor does not read zero at rest."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.kinds import Cause, Course
from paxisim.diagnose.data.problem import Problem


def _zero_is_fitted(problem: Problem) -> str:
    return "the calibrated readout of each channel includes its zero" if problem.one_load else ""


OFFSET = Cause(
    "offset",
    76,
    lambda v, p: augment.Offset(np.asarray(v)),
    "free",
    course=Course("value", lambda problem, shape: np.ones((1, len(problem.time)))),
    nuisance=True,
    unpressed_rival="dead_taxels",
    misfit=0.0,
    price=7.0,
    barred=_zero_is_fitted,
    words="The sensor does not read zero at rest.",
    picture="zero",
)
