"""Interference: an external magnetic field is read as a force; it changes with the gripper opening."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.cause import AXES, Cause, Free, Values, one_away
from paxisim.diagnose.problem import Problem

FIELD = (("linear", "N/m", 1.0, 15.0), ("quadratic", "N/m^2", 50.0, 600.0))
COVARIATE = "gripper_opening"


def _free(problem: Problem) -> tuple[Free, ...]:
    free = []
    for power, unit, scale, spread in FIELD:
        for place in ("", "row_", "column_"):
            material = 0.4 if power == "linear" and not place else None
            for pad in range(problem.measured.shape[1]):
                for k, axis in enumerate(AXES):
                    name, bound = f"{power}_{place}pad{pad}_{axis}", 1e4 * scale
                    free.append(Free(name, unit, 0.0, -bound, bound, scale, material, spread, power + place, (pad, k)))
    return tuple(free)


def _make(values: Values, problem: Problem) -> augment.Interference:
    pads = problem.measured.shape[1]
    linear, quadratic = np.reshape(
        values, (2, 3, pads, 3)
    )  # at the centre, gradient along rows, gradient along columns
    opening = problem.covariates[COVARIATE]
    rest = problem.at_rest if problem.at_rest.any() else np.ones(len(opening), dtype=bool)
    home = float(np.median(opening[rest]))
    return augment.Interference(linear[0], quadratic[0], linear[1:], quadratic[1:], zeroed_at=home)


def _starts(problem: Problem) -> list[list[float]]:
    free = _free(problem)
    return [one_away(len(free), index, 0.0, item.scale) for index, item in enumerate(free)]


INTERFERENCE = Cause(
    "interference",
    55,
    _make,
    "gripper",
    _free,
    _starts,
    planes=True,  # the gauge: the field need not be zero at the start of the recording
    covariate=COVARIATE,
    misfit=0.02,
    words="An external magnetic field is read as a force; it changes with the gripper opening.",
    picture="covariate",
)
