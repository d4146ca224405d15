"""Interference: an external magnetic field that changes with the pose of the gripper or hand is read as a force."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.kinds import BaselineCause
from paxisim.diagnose.causes.parameters import Values
from paxisim.diagnose.data.problem import FloatArray, Problem


def _curves(problem: Problem, shape: Values) -> FloatArray:
    """A straight line and a parabola in each direction of the pose."""
    assert problem.directions is not None
    along = problem.directions.along(problem.covariates)
    return np.concatenate([along, along**2 - 1])


def _make(amounts: FloatArray, shape: Values, problem: Problem) -> augment.CovariateField:
    assert problem.directions is not None
    names, middle, axes = problem.directions.names, problem.directions.middle, problem.directions.axes
    return augment.CovariateField(amounts, names, tuple(middle.tolist()), tuple(map(tuple, axes.tolist())))


def _barred(problem: Problem) -> str:
    if problem.directions is not None:
        return ""
    return "no covariate that varies without contact was recorded, such as gripper_opening or a joint angle"


INTERFERENCE = BaselineCause(
    name="interference",
    order=77.5,  # next to offset and drift, as it is fitted together with the zero
    make=_make,
    excites="gripper",
    amounts="amounts",
    curves=_curves,
    planes=True,  # the gauge: the field need not be zero at the start of the recording
    misfit=0.02,
    barred=_barred,
    words="An external magnetic field that changes with the pose is read as a force.",
    picture="covariate",
)
