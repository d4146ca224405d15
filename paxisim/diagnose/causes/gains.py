"""Gains: of each axis, and of each taxel."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.cause import AXES, TAXEL_GAIN, Cause, Free, Values, one_away, register_cause
from paxisim.diagnose.channels import bent_apart
from paxisim.diagnose.gains import taxel_gains
from paxisim.diagnose.problem import Problem


def _gains(problem: Problem) -> tuple[Free, ...]:
    return tuple(Free(f"gain_{axis}", "1", 1.0, 0.2, 5.0, 0.1, 0.015) for axis in AXES)


register_cause(
    Cause(
        "axis_gain",
        60,
        _gains,
        lambda v, p: augment.AxisGain(tuple(v)),
        lambda p: [one_away(3, k, 1.0, 0.1) for k in range(3)],
        form={"interference": 0.01},
        barred=bent_apart,
    )
)


def _spread(gains: Values, problem: Problem) -> float:
    """Of the taxels' gains, by how hard each was pressed on, in units of what matters."""
    load = np.sum((problem.simulated * problem.weight) ** 2, axis=(0, 2))
    mean = np.average(gains, weights=load)
    return float(np.sqrt(np.average((np.asarray(gains) - mean) ** 2, weights=load)) / 0.026)


register_cause(
    Cause(
        TAXEL_GAIN,
        75,  # filters commute with it, and a filter's fit is then not held up by that of so many gains
        lambda p: (),
        lambda v, p: augment.TaxelGain(np.asarray(v)),
        None,
        simpler=("axis_gain",),
        ahead=0.25,
        costs=3.0,
        form={
            **dict.fromkeys(("axis_coupling", "rotation"), 0.015),
            "interference": 0.01,
            "stiffening": 0.006,
            "saturation": 0.005,
            "crosstalk": 0.004,
        },
        mistaken=0.01,
        beyond=_spread,
        solve=taxel_gains,
        solves="gain",
        relative_to=("axis_gain",),
        barred=bent_apart,
    )
)
