"""Gel operator: a taxel also reads part of the loads on its neighbours, which the soft layer passes on."""

from __future__ import annotations

import math

import numpy as np

from paxisim import augment
from paxisim.augment.gel_operator import KINDS
from paxisim.diagnose.causes.channel_curve import no_neighbours
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import CausePart, Free, Values
from paxisim.diagnose.data.deviations import CORRELATED_SAMPLES
from paxisim.diagnose.data.problem import Problem

SHARED = 0.012  # materiality of the sum of what all neighbours read of a load
PROFILES = {"next": (1.0, 0.0, 0.0, 0.0, 0.0), "diagonal": (0.0, 1.0, 0.0, 0.0, 0.0), "far": (0.0, 0.0, 1.0, 0.8, 0.5)}
"""Values at the distances of two rings that one parameter stands for; the far ones fall as 1 / distance^2."""
SKEW = (1.0, 0.6, 0.3, 0.25, 0.15)  # profile of the differences between x and y
NEIGHBOURS = (4, 4, 4, 8, 4)  # neighbours of an inner taxel at each of these distances

LIMITS = {"own_shear": (-0.15, 0.03), "own_normal": (-0.08, 0.03)}
"""Changes of the own gains that layers of all designs cause.

`paxisim.nominal_operator` of pads of two sizes, with Poisson's ratios from 0.4 to 0.495 and thicknesses and magnet
depths 40 % smaller and larger than nominal, has -0.142 to 0 for shear and -0.04 to 0.021 for normal force.
"""
OWN = ("own_shear", "own_normal", "taken")
SKEWS = ("shear_skew", "poisson_skew")


def _kinds(*kinds: str) -> tuple[str, ...]:
    return tuple(f"{kind}_{place}" for kind in kinds for place in PROFILES)


SHARES = _kinds(*KINDS)


def _operator(values: Values, problem: Problem) -> augment.GelOperator:
    named = dict(zip((*OWN, *SHARES, *SKEWS), map(float, values), strict=True))
    kinds = {kind: tuple(_profile(named, kind)) for kind in KINDS}
    skews = {name: tuple(named[name] * np.array(SKEW)) for name in SKEWS}
    return augment.GelOperator(**{name: named[name] for name in OWN}, **kinds, **skews, layout=problem.off_grid)


def _profile(named: dict[str, float], kind: str) -> np.ndarray:
    return np.sum([named[f"{kind}_{place}"] * np.array(profile) for place, profile in PROFILES.items()], axis=0)


def _size(values: Values, problem: Problem) -> float:
    named = dict(zip((*OWN, *SHARES, *SKEWS), map(float, values), strict=True))
    totals = [np.abs(_profile(named, kind)) @ NEIGHBOURS for kind in KINDS]
    totals += [abs(named[name]) * np.dot(SKEW, NEIGHBOURS) for name in SKEWS]
    return float(max(totals)) / SHARED


def _held(spread: float) -> float:
    """Spread of a prior against samples that share an error, as one press in all its samples."""
    return spread / math.sqrt(CORRELATED_SAMPLES)


def _start(**shares: float) -> tuple[float, ...]:
    return tuple(shares.get(name, 0.0) for name in (*OWN, *SHARES, *SKEWS))


GEL_OPERATOR = FittedCause(
    name="gel_operator",
    order=40,
    make=_operator,
    excites="probe",
    free=lambda p: (
        Free("own_shear", "1", 0.0, -0.9, 2.0, 0.1, spread=_held(0.3), words="change of the gain for shear"),
        Free("own_normal", "1", 0.0, -0.9, 2.0, 0.1, spread=_held(0.3), words="change of the gain for normal force"),
        # the gauge: calibrated on single taxels (0: nothing is lost), or with flat presses (1: they are read correctly)
        Free("taken", "1", 0.5, 0.0, 1.0, 0.3, words="0 if a taxel keeps its load, 1 if it loses what it passes on"),
        *(Free(n, "1", 0.0, -2.0, 2.0, 0.05, 0.003, _held(0.2 if n.endswith("far") else 0.5)) for n in SHARES),
        *(Free(n, "1", 0.0, -1.0, 1.0, 0.05, 0.003, _held(0.2)) for n in SKEWS),
    ),
    starts=lambda p: [
        _start(poisson_next=0.05, poisson_diagonal=0.03),
        _start(poisson_far=0.02),
        _start(shear_next=0.02, normal_next=0.02),
        _start(shear_next=0.02, normal_next=0.02, shear_diagonal=0.015, normal_diagonal=0.015, taken=1.0),
        _start(shear_far=0.01, normal_far=0.01),
        _start(along_next=0.05, along_diagonal=0.05),
        _start(lift_next=0.05, lift_diagonal=0.05),
        _start(shear_skew=0.02),
    ],
    parts=(
        CausePart("Poisson effect", (*_kinds("poisson"), "poisson_skew"), "shear away from a neighbour's normal force"),
        CausePart(
            "crosstalk", (*_kinds("shear", "normal"), "shear_skew", "taken"), "a neighbour's force on the same axis"
        ),
        CausePart("shear along shear", _kinds("along"), "a neighbour's shear along the line to the taxel"),
        CausePart("normal from shear", _kinds("lift"), "normal force from a neighbour's shear towards the taxel"),
    ),
    limits=LIMITS,
    beyond="axis_gain",
    misfit=0.03,
    size=_size,
    barred=no_neighbours,
    words="A taxel also reads part of the loads on its neighbours, which the soft layer passes on.",
    picture="kernel",
)
