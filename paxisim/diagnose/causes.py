"""The causes that come with paxisim, but for those that are read off the data (`checks`, `zero`)."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.augment.transform import Transform
from paxisim.diagnose.cause import TAXEL_GAIN, UNLIKE, Cause, Free, Values, register_cause
from paxisim.diagnose.channels import bent_apart, mixes_alike, zero_is_fitted
from paxisim.diagnose.gains import taxel_gains
from paxisim.diagnose.problem import Problem
from paxisim.errors import InvalidValueError

AXES = "xyz"
_STATIC = ("axis_gain", "stiffening", "crosstalk")  # what acts on how hard a taxel is pressed


def _unit(size: int, index: int, neutral: float, step: float) -> list[float]:
    values = [neutral] * size
    values[index] += step
    return values


def _gains(problem: Problem) -> tuple[Free, ...]:
    return tuple(Free(f"gain_{axis}", "1", 1.0, 0.2, 5.0, 0.1, 0.015) for axis in AXES)


register_cause(
    Cause(
        "axis_gain",
        60,
        _gains,
        lambda v, p: augment.AxisGain(tuple(v)),
        lambda p: [_unit(3, k, 1.0, 0.1) for k in range(3)],
        form={"interference": 0.01},
        barred=bent_apart,
    )
)

register_cause(
    Cause(
        "stiffening",
        10,
        lambda p: (
            Free("exponent", "1", 1.0, 0.4, 2.0, 0.1, 0.008),
            Free("scale", "N", 0.6 * p.peak, 0.02 * p.peak, 20 * p.peak, 0.3 * p.peak),
        ),
        lambda v, p: augment.Stiffening(v[0], v[1]),
        lambda p: [(0.9, 0.6 * p.peak), (0.9, 0.1 * p.peak)],
        simpler=("axis_gain",),
        form={"axis_gain": 0.03, "saturation": 0.03, TAXEL_GAIN: 0.03},
        beyond=lambda v, p: abs(v[0] - 1) / 0.008,
        barred=bent_apart,
    )
)

register_cause(
    Cause(
        "creep",
        20,
        lambda p: (
            Free("amplitude_1", "1", 0.0, -0.5, 1.0, 0.05, 0.012),
            Free("tau_1", "s", 0.6, 0.05, 20.0, 0.4),
            Free("amplitude_2", "1", 0.0, -0.5, 1.0, 0.05, 0.012),
            Free("tau_2", "s", 5.0, 0.2, 200.0, 3.0),
        ),
        lambda v, p: augment.Creep((v[0], v[2]), (v[1], v[3])),
        lambda p: [(0.1, tau, 0.0, 1.0) for tau in (0.3, 1.0, 3.0, 10.0)],
        form={
            "stiffening": 0.007,
            "interference": 0.008,
            TAXEL_GAIN: 0.03,
            **dict.fromkeys(("axis_coupling", "rotation", "dead_band", "saturation"), 0.003),
            "poisson": 0.002,
        },
    )
)

_RADII = (0.02, 0.06, 0.15, 0.4)  # of the peak

register_cause(
    Cause(
        "hysteresis",
        30,
        lambda p: tuple(Free(f"weight_{r:g}_peak", "1", 0.0, 0.0, 0.24, 0.05, 0.012) for r in _RADII),
        lambda v, p: augment.Hysteresis(tuple(v), tuple(r * p.peak for r in _RADII)),
        lambda p: [_unit(4, i, 0.0, 0.1) for i in range(4)],
        simpler=("axis_gain",),  # the static part of a loop is a gain
        form={
            **dict.fromkeys(("creep", "stiffening", TAXEL_GAIN), 0.1),
            **dict.fromkeys(("crosstalk", "axis_gain"), 0.08),
            "interference": 0.015,
            "saturation": 0.005,
            "poisson": 0.003,
            "axis_coupling": 0.002,
        },
        absorbs={TAXEL_GAIN: 0.02, "crosstalk": 0.005},
        absorbers=("stiffening", "axis_gain"),
    )
)

register_cause(
    Cause(
        "poisson",
        40,
        lambda p: (Free("cx", "1", 0.0, 0.0, 1.0, 0.05, 0.012), Free("cy", "1", 0.0, 0.0, 1.0, 0.05, 0.012)),
        lambda v, p: augment.Poisson(v[0], v[1], reach=2.9),
        lambda p: [(0.1, 0.0), (0.0, 0.1)],
        form={"interference": 0.008, "saturation": 0.003, "axis_coupling": 0.002},
        mistaken=UNLIKE,
        faint=0.4,
        barred=mixes_alike,
    )
)

register_cause(
    Cause(
        "crosstalk",
        41,
        lambda p: (
            Free("strength", "1", 0.0, -0.3, 0.3, 0.02, 0.001),
            Free("far", "1", 0.5, 0.0, 3.0, 0.5),
            Free("taken", "1", 0.5, 0.0, 1.0, 0.3),
        ),
        lambda v, p: augment.Crosstalk(v[0], length=1.0, far=v[1], taken=v[2]),
        lambda p: [(0.02, 0.0, 0.0), (0.02, 1.0, 0.0), (0.02, 1.0, 1.0)],
        simpler=("axis_gain",),
        form={
            TAXEL_GAIN: 0.05,
            **dict.fromkeys(("axis_gain", "interference"), 0.006),
            "saturation": 0.004,
            "stiffening": 0.003,
            **dict.fromkeys(("axis_coupling", "rotation"), 0.0015),
        },
        # what the 4 next neighbours get of a load in the middle of a pad, and the 16 beyond at distances up to 2.8
        beyond=lambda v, p: abs(v[0]) * (4 + 7 * v[1]) / 0.012,
        barred=mixes_alike,
    )
)

# in the plane of the pad only what is symmetric: the rest of it is a turn about the normal, and `rotation`
_COUPLED = {
    "z_to_x": ((0, 2),),
    "z_to_y": ((1, 2),),
    "x_to_z": ((2, 0),),
    "y_to_z": ((2, 1),),
    "x_and_y": ((0, 1), (1, 0)),
}


def _coupling(values: Values) -> augment.AxisCoupling:
    matrix = np.eye(3)
    for places, value in zip(_COUPLED.values(), values, strict=True):
        for place in places:
            matrix[place] = value
    return augment.AxisCoupling(matrix)


_TILT = 0.01  # rad, of a sensor in its mount, that is expected
_MOST_TILT = 0.09

register_cause(
    Cause(
        "axis_coupling",
        50,
        lambda p: tuple(Free(name, "1", 0.0, -0.6, 0.6, 0.05, 0.012) for name in _COUPLED),
        lambda v, p: _coupling(v),
        lambda p: [_unit(5, i, 0.0, 0.1) for i in range(5)],
        form={"rotation": 0.0005},
        mistaken=UNLIKE,
        barred=mixes_alike,
    )
)

register_cause(
    Cause(
        "rotation",
        51,
        lambda p: (
            *(Free(f"about_{axis}", "rad", 0.0, -_MOST_TILT, _MOST_TILT, 0.05, 0.012, _TILT) for axis in "xy"),
            Free("about_z", "rad", 0.0, -0.6, 0.6, 0.05, 0.012),
        ),
        lambda v, p: augment.Rotation((tuple(v),)),
        lambda p: [_unit(3, k, 0.0, 0.05) for k in range(3)],
        # a tilt is nearly a coupling of shear and normal force, which may be any
        behind={"axis_coupling": lambda v, p: 0.001},
        told_beside={"axis_coupling": ("about_z",)},
        form={"axis_coupling": 0.0005},
        mistaken=UNLIKE,
        barred=mixes_alike,
    )
)


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
    return [_unit(len(free), index, 0.0, item.scale) for index, item in enumerate(free)]


register_cause(
    Cause(
        "interference",
        55,
        _interference_free,
        _interference,
        _interference_probes,
        covariate="gripper_opening",
        form={
            **dict.fromkeys((*_STATIC, TAXEL_GAIN, "creep", "hysteresis", "poisson"), 0.05),
            **dict.fromkeys(("axis_coupling", "rotation"), 0.05),
            "dead_band": 0.2,
        },
    )
)

register_cause(
    Cause(
        "low_pass",
        70,
        lambda p: (Free("tau_1", "s", 0.0, 0.0, 2.0, 0.02, 0.003), Free("tau_2", "s", 0.0, 0.0, 2.0, 0.02, 0.003)),
        lambda v, p: augment.Chain([augment.LowPass(v[0]), augment.LowPass(v[1])]),
        lambda p: [(0.01, 0.005), (0.03, 0.02), (0.1, 0.05)],
        form={
            **dict.fromkeys(("stiffening", "crosstalk", "saturation"), 0.001),
            **dict.fromkeys(("axis_gain", "creep"), 0.0006),
            "latency": 0.003,
            TAXEL_GAIN: 0.006,
        },
    )
)


def _capacity(problem: Problem, delay: float) -> int:
    """Frames that a latency must keep, so that none between now and then is left out."""
    return int(max(16, 4 * delay / problem.interval + 4))


def _like_a_filter(values: Values, problem: Problem) -> float:
    """By what share of its gain a delay must be better than a low-pass.

    One that is shorter than most of the time between two frames differs from a filter by what lies between them, which
    is drawn, not known, and costs the filter more the longer it is.
    """
    delay, interval = abs(values[0]), problem.interval
    return _SHORT * delay if interval > _OFTEN and delay < _BETWEEN * interval else 0.0


_SHORT = 1.2  # of the gain, for each second of delay
_BETWEEN = 0.65  # of the time between two frames, that such a delay is shorter than
_OFTEN = 0.025  # s between frames, below which a curve through them is good enough

register_cause(
    Cause(
        "latency",
        71,
        lambda p: (Free("delay", "s", 0.0, -0.5, 0.5, 0.02, 0.003),),
        lambda v, p: augment.Latency(v[0], capacity=_capacity(p, v[0])),
        lambda p: [(-0.1,), (0.01,), (0.03,), (0.1,)],
        behind={"low_pass": _like_a_filter},
        form={
            "low_pass": 0.01,
            "saturation": 0.005,
            "interference": 0.004,
            **dict.fromkeys(("stiffening", "crosstalk"), 0.0015),
            **dict.fromkeys(("axis_gain", "creep"), 0.001),
        },
    )
)


def _least_band(problem: Problem) -> float:
    """Half-width (N) of a dead band that matters: half a count reads as 0 anyway, but for noise that reaches beyond."""
    told = problem.dither > 0.2 * problem.step
    return max(0.02, (0.45 if told else 0.55) * problem.step)


register_cause(
    Cause(
        "dead_band",
        80,
        lambda p: (
            Free("width", "N", 0.0, 0.0, 1.0, 0.05, _least_band(p)),
            Free("shrink", "1", 0.0, 0.0, 1.0, 0.3),
            Free("edge", "1", 0.2, 0.0, 1.0, 0.1, None, 0.1),
        ),
        lambda v, p: augment.DeadBand(v[0], v[1], v[2]),
        lambda p: [(width, 0.0, 0.2) for width in (0.06, 0.12, 0.2, 0.3)],
        form={
            **dict.fromkeys((TAXEL_GAIN, "interference"), 0.08),
            **dict.fromkeys(("stiffening", "axis_gain", "creep"), 0.004),
            "crosstalk": 0.008,
        },
        barred=bent_apart,
    )
)

register_cause(
    Cause(
        "saturation",
        81,
        lambda p: (
            Free("limit", "N", 1.2 * p.peak, 0.15 * p.peak, 3 * p.peak, 0.1 * p.peak, 0.2 * p.peak),
            Free("softness", "1", 0.3, 0.0, 1.0, 0.2),
        ),
        lambda v, p: augment.Saturation(-v[0], v[0], v[1]),
        lambda p: [(0.5 * p.peak, 0.2), (0.7 * p.peak, 0.2), (0.9 * p.peak, 0.2)],
        form={
            **dict.fromkeys(_STATIC, 0.01),
            TAXEL_GAIN: 0.03,
            "interference": 0.006,
            **dict.fromkeys(("axis_coupling", "rotation"), 0.002),
        },
        beyond=lambda v, p: 1.2 * p.peak / v[0],  # what nothing reaches only bends, as a stiffening does
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
        barred=bent_apart,
    )
)


def _read(name: str, order: float) -> Cause:
    """One that `checks` or `zero` reads off the data."""
    barred = {"layout": mixes_alike, "offset": zero_is_fitted}.get(name, lambda problem: "")

    def make(values: Values, problem: Problem) -> Transform:
        raise InvalidValueError(f"{name} is read off the data, it is not made from numbers")

    return Cause(name, order, lambda p: (), make, None, barred=barred)


for _name, _order in (("layout", 0), ("offset", 76), ("drift", 77), ("quantisation", 90), ("dead_taxels", 95)):
    register_cause(_read(_name, _order))
