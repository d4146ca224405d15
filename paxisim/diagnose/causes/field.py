"""A magnetic field that comes with the opening of the gripper: interference."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.cause import AXES, STATIC, TAXEL_GAIN, Cause, Free, Values, one_away, register_cause
from paxisim.diagnose.problem import Problem

_FIELD = (("linear", "N/m", 1.0, 15.0), ("quadratic", "N/m^2", 50.0, 600.0))


def _interference(values: Values, problem: Problem) -> augment.Interference:
    pads = problem.measured.shape[1]
    linear, quadratic = np.reshape(values, (2, 3, pads, 3))  # the middle, from row to row, from column to column
    opening = problem.covariates["gripper_opening"]
    rest = problem.at_rest if problem.at_rest.any() else np.ones(len(opening), dtype=bool)
    home = float(np.median(opening[rest]))
    return augment.Interference(linear[0], quadratic[0], linear[1:], quadratic[1:], zeroed_at=home)


def _interference_free(problem: Problem) -> tuple[Free, ...]:
    pads = problem.measured.shape[1]
    free = []
    for power, unit, scale, spread in _FIELD:
        for place in ("", "row_", "column_"):
            material = 0.4 if power == "linear" and not place else None
            for pad in range(pads):
                for k, axis in enumerate(AXES):
                    name, shape = f"{power}_{place}pad{pad}_{axis}", power + place
                    bounds = (-1e4 * scale, 1e4 * scale)
                    free.append(Free(name, unit, 0.0, *bounds, scale, material, spread, shape, (pad, k)))
    return tuple(free)


def _interference_probes(problem: Problem) -> list[list[float]]:
    free = _interference_free(problem)
    return [one_away(len(free), index, 0.0, item.scale) for index, item in enumerate(free)]


register_cause(
    Cause(
        "interference",
        55,
        _interference_free,
        _interference,
        _interference_probes,
        covariate="gripper_opening",
        form={
            **dict.fromkeys(STATIC, 0.02),
            **dict.fromkeys(("creep", "hysteresis"), 0.01),
            **dict.fromkeys(("poisson", "axis_coupling", "rotation"), 0.004),
            TAXEL_GAIN: 0.06,
            "dead_band": 0.2,
        },
    )
)
