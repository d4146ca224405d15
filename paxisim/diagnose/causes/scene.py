"""Causes inside the scene: the simulated contact differs from the real one, independently of the sensor.

Each cause is one or more numbers of `paxisim.Scene.parameters`. Their effects are computed from replays, for which
`paxisim.diagnose` needs the scene.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import radians

import numpy as np

from paxisim.augment.chain import Chain
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import Free, Values, one_away
from paxisim.diagnose.data.deviations import CORRELATED_SAMPLES
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.data.responses import SHOWN, SPREAD
from paxisim.scene.parameters import Group

SCENE_ORDER = -10.0
"""Place in the chain: before all effects of the sensor."""
MISFIT = 0.1
"""Share of a scene cause's effect that its form may leave unexplained: real objects and gels differ from those of the
scene, and the effect is interpolated linearly between replays."""
MOUNTING: Mapping[str, float] = {"m": 1e-3, "rad": radians(0.3)}
"""Standard deviation of the pose of a base or a hand that was measured with care."""
_UNSEEN = "no replay shows its effect (see the warnings)"
_MISSING = {
    "grip_force": "in this mode the scene follows positions, whatever force that takes",
    "object_size": "the scene has no object (a movable body without a pad)",
    "object_pose": "the scene has no object (a movable body without a pad)",
    "joint_offset": "no recorded stream drives a joint of the scene",
    "surface": "the pads have too few taxels",
    "base_pose": "no arm carries a hand with two pads",
    "hand_pose": "no arm carries a hand with two pads",
}


def _numbers(problem: Problem, group: Group) -> tuple[Free, ...]:
    """Return the numbers of a cause, in display units."""
    assert problem.scene is not None
    out = []
    for one in problem.scene.of(group):
        item = one.parameter
        unit, times = SHOWN[item.unit]
        numbers = [times * n for n in (item.nominal, item.low, item.high, item.step, item.material)]
        out.append(Free(item.name, unit, *numbers, words=item.words))
    return tuple(out)


def _scene_cause(
    group: Group, excites: str, words: str, picture: str, price: float = 1.0, prior: Mapping[str, float] | None = None
) -> FittedCause:
    def free(problem: Problem) -> tuple[Free, ...]:
        numbers = _numbers(problem, group)
        if prior is None:
            return numbers
        assert problem.scene is not None
        units = [one.parameter.unit for one in problem.scene.of(group)]
        # samples that share an error count as one against the prior
        spreads = [prior[unit] * SHOWN[unit][1] / np.sqrt(CORRELATED_SAMPLES) for unit in units]
        return tuple(replace(n, spread=spread) for n, spread in zip(numbers, spreads, strict=True))

    def starts(problem: Problem) -> list[list[float]]:
        numbers = _numbers(problem, group)
        places = []
        for index, number in enumerate(numbers):
            for sign in (1, -1):
                start = one_away(len(numbers), index, 0.0, sign * number.scale)
                places.append([n.neutral + by for n, by in zip(numbers, start, strict=True)])
        return places

    def change(values: Values, problem: Problem) -> FloatArray:
        assert problem.scene is not None
        return problem.scene.change(group, values)

    def barred(problem: Problem) -> str:
        if problem.scene is None:
            return "it belongs to the scene, and no scene was given"
        if problem.scene.of(group):
            return ""
        return _UNSEEN if group in problem.scene.failed else _MISSING.get(group, _UNSEEN)

    return FittedCause(
        name=group,
        order=SCENE_ORDER,
        make=lambda values, problem: Chain(),
        excites=excites,
        free=free,
        starts=starts,
        change=change,
        barred=barred,
        misfit=MISFIT,
        price=price,
        words=words,
        picture=picture,
    )


SCENE_CAUSES: tuple[FittedCause, ...] = (
    _scene_cause("friction", "loads", "The gel's surface is rougher or smoother than in the scene.", "slip"),
    _scene_cause("gel_stiffness", "staircase", "The gel is stiffer or softer than in the scene.", "closing"),
    _scene_cause("grip_force", "loads", "The actuators exert more or less force than in the scene.", "closing"),
    _scene_cause("mount_offset", "regrasps", "A pad is not where the scene puts it.", "mount"),
    _scene_cause("mount_tilt", "regrasps", "A pad is mounted at an angle.", "mount"),
    _scene_cause("surface", "places", "A pad's surface is uneven.", "height_map", price=2.0),
    _scene_cause("object_size", "objects", "The object is larger or smaller than in the scene.", "closing"),
    _scene_cause(
        "object_pose", "regrasps", "The object sits elsewhere in its holder, in all episodes.", "mount", price=1.5
    ),
    _scene_cause("joint_offset", "objects", "The zero of a joint is off.", "closing"),
    _scene_cause("base_pose", "regrasps", "The robot's base is not where the scene puts it.", "mount", 2.0, MOUNTING),
    _scene_cause("hand_pose", "regrasps", "The hand is not mounted as in the scene.", "mount", 2.0, MOUNTING),
)


def _by_chance(problem: Problem) -> tuple[Free, ...]:
    """Return the numbers of the mean of poses that scatter about 0, bounded to three standard errors."""
    assert problem.scene is not None
    out = []
    for number, one in zip(_numbers(problem, "object_pose"), problem.scene.poses, strict=True):
        error = SPREAD[one.parameter.unit] * SHOWN[one.parameter.unit][1] / np.sqrt(len(problem.episodes))
        held = error / np.sqrt(CORRELATED_SAMPLES)  # samples that share an error count as one against the prior
        out.append(replace(number, low=-3 * error, high=3 * error, scale=error, material=None, spread=held))
    return tuple(out)


def _no_pose(problem: Problem) -> str:
    return "" if problem.scene is not None and problem.scene.of("object_pose") else "the scene has no placed object"


MEAN_POSE = FittedCause(
    name="mean_pose",
    order=SCENE_ORDER,
    make=lambda values, problem: Chain(),
    free=_by_chance,
    change=lambda values, problem: problem.scene.mean_pose(values),  # type: ignore[union-attr]
    nuisance=True,
    tacit=True,
    misfit=0.0,
    barred=_no_pose,
)
"""The chance mean of the poses of a few episodes, fitted so that no cause is named for it."""

IMPRATIO = replace(
    _scene_cause("impratio", "varied", "MuJoCo's contacts creep under shear, at a rate that no gel has.", "plain"),
    free=lambda problem: tuple(replace(n, spread=2 * n.scale) for n in _numbers(problem, "impratio")),
    nuisance=True,
    tacit=True,
    misfit=0.0,
)
"""MuJoCo's ``impratio``, which sets how fast contacts creep: a solver setting, fitted but never named as a cause."""
