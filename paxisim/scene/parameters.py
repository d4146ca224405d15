"""The physical numbers of a scene that may be wrong: what they are, and within which bounds."""

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
    "impratio",
]
BUMPS = ((2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
"""Half waves along the rows and along the columns of the cosines that make up a pad's surface: bowls and saddles, then
bumps of a third of the pad. A height common to all taxels belongs to a joint's zero, a plane to the mount's tilt."""
_TURN = radians(10)


@dataclass(frozen=True)
class SceneParameter:
    """One number of a scene.

    Attributes:
        name: What `paxisim.Scene.simulate` calls it.
        group: The cause that it belongs to.
        unit: ``"m"``, ``"rad"``, or ``"1"`` for a pure number.
        nominal: Its value in the scene as it is.
        low: Least value.
        high: Largest value.
        step: A change that is found, if it is there; replays are made at two of them to either side.
        material: The least change that matters.
        target: The pad, the object's body or the stream that it belongs to; empty where there is but one.
        index: Which of the target's numbers it is: an axis, or one of `BUMPS`.
        words: What it means.
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


def parameters_of(scene: Scene, rig: Rig) -> dict[str, SceneParameter]:
    """All parameters of a scene by name, with the scene's own bounds where it has some.

    Args:
        scene: The scene.
        rig: The same, compiled.

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
        words = "what the actuators exert, as a multiple of what they are told to"
        out.append(_ratio("grip_force", words, (0.2, 5.0), (0.15, 0.06)))
    words = "MuJoCo's impratio: how slowly contacts creep under shear"
    impratio = _ratio("impratio", words, (0.2, 5.0), (0.2, 0.2), float(rig.model.opt.impratio))
    return [*out, *_of_pads(rig.pads), *_of_objects(rig), *_of_joints(scene, rig), impratio]


def _ratio(
    group: Group, words: str, bounds: tuple[float, float], steps: tuple[float, float], nominal: float = 1.0
) -> SceneParameter:
    """A number whose bounds, step and least change that matters are shares of it."""
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
            name, words = f"mount_offset_{axis}{after}", f"how far the mount{of} is off, along the pad's {axis}"
            out.append(_length("mount_offset", name, 5e-3, (4e-4, 3e-4), (pad, index), words))
        for index, axis in enumerate("xy"):
            words = f"turn of the mount{of} about the pad's {axis}"
            out.append(_angle("mount_tilt", f"mount_tilt_{axis}{after}", (pad, index), words))
        for index, (down, across) in enumerate(BUMPS):
            if down < rows and across < cols:
                name = f"surface_{down}{across}{after}"
                words = f"height of {down} half waves down the rows{of} and {across} across the columns"
                out.append(_length("surface", name, 5e-4, (5e-5, 3e-5), (pad, index), words))
    return out


def objects_of(rig: Rig) -> tuple[str, ...]:
    """Names of the movable bodies that carry no pad, with nothing movable above them."""
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
    """Ids of the geoms of a body and of all bodies below it."""
    last = body
    while last + 1 < model.nbody and model.body_rootid[last + 1] == model.body_rootid[body]:
        last += 1
    used = [b for b in range(body, last + 1) if model.body_geomnum[b]]
    if not used:
        return range(0)
    return range(int(model.body_geomadr[used[0]]), int(model.body_geomadr[used[-1]] + model.body_geomnum[used[-1]]))


def _of_objects(rig: Rig) -> list[SceneParameter]:
    names = objects_of(rig)
    out = []
    for body in names:
        after = "" if len(names) == 1 else f"_{body}"
        size = _ratio("object_size", f"size of {body}, as a multiple of the scene's", (0.5, 2.0), (0.02, 0.02))
        out.append(replace(size, name=f"object_size{after}", target=body))
        for index, axis in enumerate("xyz"):
            name, words = f"object_pose_{axis}{after}", f"how far {body} is off along its own {axis}"
            out.append(_length("object_pose", name, 5e-3, (4e-4, 3e-4), (body, index), words))
        for index, axis in enumerate("xyz"):
            words = f"by how much {body} is turned about its own {axis}"
            out.append(_angle("object_pose", f"object_turn_{axis}{after}", (body, 3 + index), words))
    return out


def _of_joints(scene: Scene, rig: Rig) -> list[SceneParameter]:
    """Zeros of the streams that move joints: of the closing alone where the scene has one."""
    out: dict[str, SceneParameter] = {}
    for drive in (*rig.prescribed, *rig.followed):
        if not drive.joint or drive.source in out or (scene.closing and drive.stream != scene.closing):
            continue
        name, words = f"joint_offset_{drive.source}", f"zero of the joints that {drive.source} moves"
        place = drive.source, 0
        if int(rig.model.joint(drive.joint).type[0]) == int(mujoco.mjtJoint.mjJNT_SLIDE):
            out[drive.source] = _length("joint_offset", name, 5e-3, (1e-4, 1e-4), place, words)
        else:
            out[drive.source] = _angle("joint_offset", name, place, words)
    return list(out.values())


def height_map(layout: TaxelLayout, heights: Mapping[int, float]) -> NDArray[np.float64]:
    """``(rows, cols)`` by how much the taxels stand out, in the unit of `heights`.

    Args:
        layout: The taxels, a grid.
        heights: Of the cosines, by their index in `BUMPS`.
    """
    down, across = ((np.arange(count) + 0.5) / count for count in (layout.rows, layout.cols))
    out = np.zeros((layout.rows, layout.cols))
    for index, height in heights.items():
        i, j = BUMPS[index]
        out += height * np.outer(np.cos(np.pi * i * down), np.cos(np.pi * j * across))
    return out


def checked_values(values: Mapping[str, float], known: Mapping[str, SceneParameter]) -> None:
    """Check names and values of parameters.

    Raises:
        UnknownNameError: There is no such parameter.
        InvalidValueError: A value out of its bounds.
    """
    for name, value in values.items():
        if name not in known:
            raise UnknownNameError("parameter of a scene", name, known)
        if not known[name].low <= value <= known[name].high:
            raise InvalidValueError(
                f"{name} must lie between {known[name].low:g} and {known[name].high:g}, got {value!r}"
            )
