"""The uncertain physical parameters of a scene and their bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import radians
from typing import TYPE_CHECKING, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.models.pads import Pads
from paxisim.scene.arms import arms_of
from paxisim.scene.units import LENGTH

if TYPE_CHECKING:
    from paxisim.scene.rig import Rig
    from paxisim.scene.scene import Scene

Group = Literal[
    "friction",
    "gel_stiffness",
    "grip_force",
    "mount_offset",
    "mount_tilt",
    "surface",
    "object_size",
    "object_pose",
    "joint_offset",
    "base_pose",
    "hand_pose",
    "impratio",
]
BUMPS = ((2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
"""Numbers of half waves, down the rows and across the columns, of the cosines that make up a pad's surface: bowls and
saddles, then bumps of a third of the pad. A height common to all taxels is part of a joint's zero, and a plane is part
of the mount's tilt."""
_NEAR = 1e-4  # m, smallest displacement of an object's surface along its approach that matters
_TURN = radians(10)
_MOUNTED = radians(2)  # of a base or a hand, which are screwed on


@dataclass(frozen=True)
class SceneParameter:
    """A scalar parameter of a scene.

    Attributes:
        name: Name of the parameter, as used by `paxisim.Scene.simulate`.
        group: The cause that the parameter belongs to.
        unit: ``"m"``, ``"rad"``, or ``"1"`` for a dimensionless number.
        nominal: Value in the current scene.
        low: Lower bound.
        high: Upper bound.
        step: A detectable change; replays are made at two such steps to either side.
        material: Smallest change that matters.
        target: The pad, the object's body or the stream that the parameter belongs to; empty for parameters of the
            whole scene.
        index: Index among the target's parameters: an axis, or an index into `BUMPS`.
        words: Description of the parameter.
    """

    name: str
    group: Group
    unit: str
    nominal: float
    low: float
    high: float
    step: float
    material: float
    target: str = ""
    index: int = 0
    words: str = ""

    @property
    def by_episode(self) -> bool:
        """Whether the value differs between episodes, as an object's pose in its holder does."""
        return self.group == "object_pose"


def parameters_of(scene: Scene, rig: Rig) -> dict[str, SceneParameter]:
    """Return all parameters of a scene by name, with the scene's own bounds where given.

    Args:
        scene: The scene.
        rig: The compiled scene.

    Raises:
        InvalidValueError: Bounds of the scene exclude the nominal value.
        UnknownNameError: Bounds are given for a parameter that the scene does not have.
    """
    found = {item.name: item for item in _listed(scene, rig)}
    for name, (low, high) in scene.bounds.items():
        if name not in found:
            raise UnknownNameError("parameter with bounds", name, found)
        nominal = found[name].nominal
        if not low <= nominal <= high:
            raise InvalidValueError(
                f"the bounds of {name}, {low:g} to {high:g}, exclude its value in the scene, {nominal:g}: widen them, "
                "or change the scene"
            )
        found[name] = replace(found[name], low=float(low), high=float(high))
    return found


def _listed(scene: Scene, rig: Rig) -> list[SceneParameter]:
    out = [
        _ratio("friction", "coefficient of the gel's sliding friction", (0.1, 3.0), (0.15, 0.08), scene.gel.friction),
        _ratio("gel_stiffness", "stiffness of the gel, as a multiple of the scene's", (0.2, 5.0), (0.15, 0.06)),
    ]
    if scene.mode in ("force", "servo"):
        words = "force of the actuators, as a multiple of the commanded force"
        out.append(_ratio("grip_force", words, (0.2, 5.0), (0.15, 0.06)))
    words = "MuJoCo's impratio: how slowly contacts creep under shear"
    impratio = _ratio("impratio", words, (0.2, 5.0), (0.2, 0.2), float(rig.model.opt.impratio))
    return [*out, *_of_pads(rig.pads), *_of_objects(rig), *_of_joints(scene, rig), *_of_arms(rig), impratio]


def _ratio(
    group: Group, words: str, bounds: tuple[float, float], steps: tuple[float, float], nominal: float = 1.0
) -> SceneParameter:
    """Return a parameter whose bounds, step and material change are proportional to its nominal value."""
    ends = nominal * bounds[0], nominal * bounds[1]
    return SceneParameter(group, group, "1", nominal, *ends, nominal * steps[0], nominal * steps[1], words=words)


def _length(
    group: Group, name: str, most: float, steps: tuple[float, float], place: tuple[str, int], words: str
) -> SceneParameter:
    return SceneParameter(name, group, "m", 0.0, -most, most, *steps, *place, words)


def _angle(group: Group, name: str, place: tuple[str, int], words: str) -> SceneParameter:
    return SceneParameter(name, group, "rad", 0.0, -_TURN, _TURN, radians(0.7), radians(0.5), *place, words)


def _of_pads(pads: Pads) -> list[SceneParameter]:
    out = []
    rows, cols = pads.layout.rows, pads.layout.cols
    for pad in pads.names:
        after, of = ("", "") if len(pads) == 1 else (f"_{pad}", f" of pad {pad}")
        for index, axis in enumerate("xy"):
            name, words = f"mount_offset_{axis}{after}", f"offset of the mount{of} along the pad's {axis}"
            out.append(_length("mount_offset", name, 5e-3, (4e-4, 3e-4), (pad, index), words))
        for index, axis in enumerate("xy"):
            words = f"rotation of the mount{of} about the pad's {axis}"
            out.append(_angle("mount_tilt", f"mount_tilt_{axis}{after}", (pad, index), words))
        for index, (down, across) in enumerate(BUMPS):
            if down < rows and across < cols:
                name = f"surface_{down}{across}{after}"
                words = f"height of {down} half waves down the rows{of} and {across} across the columns"
                out.append(_length("surface", name, 5e-4, (5e-5, 3e-5), (pad, index), words))
    return out


def objects_of(rig: Rig) -> tuple[str, ...]:
    """Return the names of the movable top-level bodies that carry no pad and can touch something."""
    model = rig.model
    with_pads = set()
    for body in rig.pads.bodies:
        while body:
            with_pads.add(int(body))
            body = int(model.body_parentid[body])
    found = []
    for body in range(1, model.nbody):
        touches = any(model.geom_contype[g] | model.geom_conaffinity[g] for g in _geoms(model, body))
        if model.body_parentid[body] == 0 and model.body_jntnum[body] and body not in with_pads and touches:
            found.append(model.body(body).name)
    return tuple(name for name in found if name)


def _geoms(model: mujoco.MjModel, body: int) -> range:
    """Return the ids of the geoms of a body and all its descendants."""
    last = body
    while last + 1 < model.nbody and model.body_rootid[last + 1] == model.body_rootid[body]:
        last += 1
    used = [b for b in range(body, last + 1) if model.body_geomnum[b]]
    if not used:
        return range(0)
    return range(int(model.body_geomadr[used[0]]), int(model.body_geomadr[used[-1]] + model.body_geomnum[used[-1]]))


def _reach(model: mujoco.MjModel, name: str) -> float:
    """Distance (m) from the origin of a body to its farthest point."""
    data, body = mujoco.MjData(model), model.body(name).id
    mujoco.mj_kinematics(model, data)
    geoms = list(_geoms(model, body))
    return float(np.max(np.linalg.norm(data.geom_xpos[geoms] - data.xpos[body], axis=1) + model.geom_rbound[geoms]))


def _of_objects(rig: Rig) -> list[SceneParameter]:
    names = objects_of(rig)
    out = []
    for body in names:
        after = "" if len(names) == 1 else f"_{body}"
        by = _NEAR / max(_reach(rig.model, body), _NEAR)  # moves the surface as far as a joint's zero
        size = _ratio("object_size", f"size of {body}, as a multiple of the scene's", (0.5, 2.0), (2 * by, by))
        out.append(replace(size, name=f"object_size{after}", target=body))
        for index, axis in enumerate("xyz"):
            name, words = f"object_pose_{axis}{after}", f"offset of {body} along its own {axis}"
            out.append(_length("object_pose", name, 5e-3, (4e-4, 3e-4), (body, index), words))
        for index, axis in enumerate("xyz"):
            words = f"rotation of {body} about its own {axis}"
            out.append(_angle("object_pose", f"object_turn_{axis}{after}", (body, 3 + index), words))
    return out


def _of_joints(scene: Scene, rig: Rig) -> list[SceneParameter]:
    """Return the zeros of the streams that move joints; only that of the closing stream if the scene has one."""
    out: dict[str, SceneParameter] = {}
    for drive in (*rig.prescribed, *rig.followed):
        if not drive.joint or drive.source in out or (scene.closing and drive.stream != scene.closing):
            continue
        name, words = f"joint_offset_{drive.source}", f"zero of the joints that {drive.source} moves"
        place = drive.source, 0
        slides = int(rig.model.joint(drive.joint).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
        if (drive.unit in LENGTH) if drive.curve else slides:
            out[drive.source] = _length("joint_offset", name, 5e-3, (2 * _NEAR, _NEAR), place, words)
        else:
            out[drive.source] = _angle("joint_offset", name, place, words)
    return list(out.values())


def _of_arms(rig: Rig) -> list[SceneParameter]:
    """Return the poses of the bases and of the hands, which are rotated about the middle of the pads."""
    arms, out = arms_of(rig.model, rig.pads), []
    for arm in arms:
        placed: tuple[tuple[Group, str, str], ...] = (
            ("base_pose", arm.base, f"of the robot's base {arm.base} in the world"),
            ("hand_pose", arm.hand, f"of the hand {arm.hand} on the arm"),
        )
        for group, body, words in placed:
            short, after = group.removesuffix("_pose"), "" if len(arms) == 1 else f"_{body}"
            for index, axis in enumerate("xyz"):
                said = f"offset {words}, along {axis}"
                out.append(_length(group, f"{group}_{axis}{after}", 5e-3, (4e-4, 3e-4), (body, index), said))
            for index, axis in enumerate("xyz"):
                turn = _angle(
                    group, f"{short}_turn_{axis}{after}", (body, 3 + index), f"rotation {words}, about {axis}"
                )
                out.append(replace(turn, low=-_MOUNTED, high=_MOUNTED, step=0.1 * _MOUNTED, material=0.07 * _MOUNTED))
    return out


def height_map(layout: TaxelLayout, heights: Mapping[int, float]) -> NDArray[np.float64]:
    """Return the surface heights ``(rows, cols)`` of the taxels, in the unit of `heights`.

    Args:
        layout: Layout of the taxels, a grid.
        heights: Amplitudes of the cosines, by their index in `BUMPS`.
    """
    down, across = ((np.arange(count) + 0.5) / count for count in (layout.rows, layout.cols))
    out = np.zeros((layout.rows, layout.cols))
    for index, height in heights.items():
        i, j = BUMPS[index]
        out += height * np.outer(np.cos(np.pi * i * down), np.cos(np.pi * j * across))
    return out


def checked_values(values: Mapping[str, float], known: Mapping[str, SceneParameter]) -> None:
    """Check the names and values of parameters.

    Raises:
        UnknownNameError: A parameter does not exist.
        InvalidValueError: A value is out of its bounds.
    """
    for name, value in values.items():
        if name not in known:
            raise UnknownNameError("parameter of a scene", name, known)
        if not known[name].low <= value <= known[name].high:
            raise InvalidValueError(
                f"{name} must lie between {known[name].low:g} and {known[name].high:g}, got {value!r}"
            )
