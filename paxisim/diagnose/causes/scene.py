"""Causes inside the scene: what is simulated is not what was touched, whatever the sensor makes of it.

Each is one or several numbers of `paxisim.Scene.parameters`. What they do is read off replays, `paxisim.diagnose`
being given the scene.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paxisim.augment.chain import Chain
from paxisim.diagnose.cause import Cause, Free, Values, one_away
from paxisim.diagnose.inside.responses import SHOWN, SPREAD
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.scene.parameters import Group

FIRST = -10.0
"""Place in the chain: before all that a sensor does."""
MISFIT = 0.1
"""Share of a scene cause's effect that its form may leave: a real object and a real gel are not those of a scene, and
between the replays its effect is straight."""
_UNSEEN = "no replay shows what it does: see the warnings"
_MISSING = {
    "grip_force": "in this mode the scene follows positions, whatever force that takes",
    "object_size": "the scene has no object: a movable body that carries no pad",
    "object_pose": "the scene has no object: a movable body that carries no pad",
    "joint_offset": "no stream moves a joint of the scene",
    "surface": "the pads have too few taxels",
}


def _numbers(problem: Problem, group: Group) -> tuple[Free, ...]:
    """The numbers of a cause, in the units in which they are shown."""
    assert problem.scene is not None
    out = []
    for one in problem.scene.of(group):
        item = one.parameter
        unit, times = SHOWN[item.unit]
        numbers = [times * n for n in (item.nominal, item.low, item.high, item.step, item.material)]
        out.append(Free(item.name, unit, *numbers, words=item.words))
    return tuple(out)


def _scene_cause(group: Group, excites: str, words: str, picture: str, price: float = 1.0) -> Cause:
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
            return "it is in the scene, which the diagnosis was not given"
        if problem.scene.of(group):
            return ""
        return _UNSEEN if group in problem.scene.failed else _MISSING.get(group, _UNSEEN)

    return Cause(
        group,
        FIRST,
        lambda values, problem: Chain(),
        excites,
        lambda problem: _numbers(problem, group),
        starts,
        change=change,
        barred=barred,
        misfit=MISFIT,
        price=price,
        words=words,
        picture=picture,
    )


SCENE_CAUSES: tuple[Cause, ...] = (
    _scene_cause("friction", "loads", "The gel's surface is rougher or smoother than the scene's.", "slip"),
    _scene_cause("gel_stiffness", "staircase", "The gel is stiffer or softer than the scene's.", "closing"),
    _scene_cause("grip_force", "loads", "The actuators exert more or less than the scene's.", "closing"),
    _scene_cause("mount_offset", "regrasps", "A pad sits off its place in the scene.", "mount"),
    _scene_cause("mount_tilt", "regrasps", "A pad is mounted at an angle.", "mount"),
    _scene_cause("surface", "places", "A pad's surface is uneven.", "height_map", price=2.0),
    _scene_cause("object_size", "objects", "The object is larger or smaller than the scene's.", "closing"),
    _scene_cause(
        "object_pose", "regrasps", "The object sits elsewhere in its holder in all episodes.", "mount", price=1.5
    ),
    _scene_cause("joint_offset", "objects", "A drive's zero is off.", "closing"),
)


def _by_chance(problem: Problem) -> tuple[Free, ...]:
    """The mean of poses that scatter from episode to episode; it is within two standard errors of 0."""
    out = []
    for number, one in zip(_numbers(problem, "object_pose"), problem.scene.of("object_pose"), strict=True):  # type: ignore[union-attr]
        spread = SPREAD[one.parameter.unit] * SHOWN[one.parameter.unit][1] / np.sqrt(len(problem.episodes))
        out.append(replace(number, low=-2 * spread, high=2 * spread, scale=spread, material=None, spread=spread))
    return tuple(out)


def _no_pose(problem: Problem) -> str:
    return "" if problem.scene is not None and problem.scene.of("object_pose") else "no object was placed"


MEAN_POSE = Cause(
    "mean_pose",
    FIRST,
    lambda values, problem: Chain(),
    free=_by_chance,
    change=lambda values, problem: problem.scene.change("object_pose", values),  # type: ignore[union-attr]
    nuisance=True,
    tacit=True,
    misfit=0.0,
    barred=_no_pose,
)
"""What the poses of a few episodes have in common by chance, so that no cause is named for it."""

IMPRATIO = replace(
    _scene_cause("impratio", "varied", "MuJoCo's contacts creep under shear, at a rate that no gel has.", "plain"),
    free=lambda problem: tuple(replace(n, spread=2 * n.scale) for n in _numbers(problem, "impratio")),
    nuisance=True,
    tacit=True,
    misfit=0.0,
)
"""How slowly contacts creep: a solver setting that changes what is simulated, and for which no cause is named."""
