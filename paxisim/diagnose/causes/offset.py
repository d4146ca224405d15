"""Offset: the sensor does not read zero at rest."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.kinds import BaselineCause
from paxisim.diagnose.data.problem import Problem


def _zero_is_fitted(problem: Problem) -> str:
    return "the calibrated readout of each channel includes its zero" if problem.one_load else ""


OFFSET = BaselineCause(
    name="offset",
    order=76,
    make=lambda amounts, shape, p: augment.Offset(amounts),
    excites="free",
    amounts="value",
    curves=lambda problem, shape: np.ones((1, len(problem.time))),
    nuisance=True,
    unpressed_rival="dead_taxels",
    misfit=0.0,
    price=7.0,
    barred=_zero_is_fitted,
    words="The sensor does not read zero at rest.",
    picture="zero",
)
