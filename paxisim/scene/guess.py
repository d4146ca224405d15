"""A first scene guessed from the names, shapes and value ranges of a model and a recording."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.models.load import compile_spec, load_spec
from paxisim.models.pads import Pads, find_pads
from paxisim.recording import Recording
from paxisim.scene import units
from paxisim.scene.drive import Drive, ObjectStart
from paxisim.scene.motion import resolution
from paxisim.scene.scene import Scene
from paxisim.scene.streams import limits_of

_OPENING = re.compile(r"opening|width|aperture|gripper", re.IGNORECASE)
_NOT_MOTION = re.compile(r"force|current|torque|effort|velocity|speed|temp|resultant|command", re.IGNORECASE)
_FREE, _SLIDE = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_SLIDE)


@dataclass(frozen=True, eq=False)
class GuessedScene:
    """Result of `guess_scene`.

    Attributes:
        scene: The guessed scene.
        found: One line per drive, with the reason for it.
        open: One line per open question that the user should check.
    """

    scene: Scene
    found: tuple[str, ...]
    open: tuple[str, ...]


def guess_scene(mjcf: Path, recording: Recording, raw: Mapping[str, NDArray[np.float64]] | None = None) -> GuessedScene:
    """Guess which streams of a recording move which parts of a model.

    Args:
        mjcf: Path of the model's MJCF file, with pads.
        recording: The recording.
        raw: Covariates as recorded, before they were resampled to one clock; these show encoder steps.

    Raises:
        InvalidValueError: The model cannot be read or has no pads, or no stream matches anything in it.
    """
    model = compile_spec(load_spec(mjcf), str(mjcf))
    pads = find_pads(model)
    streams = {name: values for name, values in recording.covariates.items() if np.isfinite(values).any()}
    drives, found = _by_name(model, streams)
    if not any(drive.joint in _moving_pads(model, pads) for drive in drives):
        opening, said = _opening(model, pads, streams, {drive.stream for drive in drives})
        drives, found = drives + opening, found + said
    if not drives:
        joints = ", ".join(name for i in range(model.njnt) if (name := model.joint(i).name)) or "none"
        raise InvalidValueError(
            f"no stream of the recording ({', '.join(recording.covariates) or 'it has none'}) has the name of a "
            f"joint, mocap body or object of the model (joints: {joints}), and none is an opening: write the scene by "
            "hand"
        )
    drives = [_measured(model, drive, streams[drive.stream], (raw or streams).get(drive.stream)) for drive in drives]
    start, placed = _objects(model, {drive.body for drive in drives})
    closing = next((drive.stream for drive in drives if drive.joint in _moving_pads(model, pads)), "")
    scene = Scene(mjcf, tuple(drives), closing=closing, start=start)
    return GuessedScene(scene, tuple(found), tuple(placed + _left(model, drives, streams)))


def _plain(name: str) -> str:
    """Normalise a name: remove case, separators and generic words."""
    name = re.sub(
        r"\b(joint_states?|state|observation|pos|position|qpos|rad|deg|mm|m)\b", "", re.sub(r"[\W_]+", " ", name)
    )
    return re.sub(r"\W+", "", name).lower()


def _by_name(model: mujoco.MjModel, streams: Mapping[str, NDArray[np.float64]]) -> tuple[list[Drive], list[str]]:
    joints = {_plain(model.joint(i).name): model.joint(i).name for i in range(model.njnt) if _is_scalar(model, i)}
    bodies = {_plain(model.body(i).name): model.body(i).name for i in range(1, model.nbody) if _is_posed(model, i)}
    drives, found = [], []
    for name, values in streams.items():
        plain = _plain(name)
        if not plain or _NOT_MOTION.search(name):
            continue
        if values.ndim == 1 and plain in joints:
            joint = joints.pop(plain)
            drives.append(Drive(name, joint=joint))
            found.append(f"stream {name!r} moves joint {joint!r}: their names agree")
        elif values.ndim == 2 and values.shape[1] in (3, 7) and plain in bodies:
            body = bodies.pop(plain)
            drives.append(Drive(name, body=body, unit="m"))
            found.append(f"stream {name!r} poses body {body!r}: their names agree")
    return drives, found


def _is_scalar(model: mujoco.MjModel, joint: int) -> bool:
    return bool(model.joint(joint).name) and int(model.jnt_type[joint]) in (_SLIDE, int(mujoco.mjtJoint.mjJNT_HINGE))


def _is_posed(model: mujoco.MjModel, body: int) -> bool:
    return model.body_mocapid[body] >= 0 or _is_object(model, body)


def _is_object(model: mujoco.MjModel, body: int) -> bool:
    first = int(model.body_jntadr[body])
    return bool(model.body(body).name) and first >= 0 and int(model.jnt_type[first]) == _FREE


def _moving_pads(model: mujoco.MjModel, pads: Pads) -> tuple[str, ...]:
    """Return the names of the joints that move the pads."""
    names = []
    for body in pads.bodies:
        while body:
            first = int(model.body_jntadr[body])
            names += (
                [model.joint(i).name for i in range(first, first + int(model.body_jntnum[body]))] if first >= 0 else []
            )
            body = int(model.body_parentid[body])
    return tuple(dict.fromkeys(name for name in names if name))


def _opening(
    model: mujoco.MjModel, pads: Pads, streams: Mapping[str, NDArray[np.float64]], taken: set[str]
) -> tuple[list[Drive], list[str]]:
    """Return the drives of a stream that is a parallel gripper's opening; empty if there is none."""
    names = [n for n, v in streams.items() if v.ndim == 1 and n not in taken and _OPENING.search(n)]
    names = [n for n in names if not _NOT_MOTION.search(n)]
    slides = [j for j in _moving_pads(model, pads) if int(model.joint(j).type[0]) == _SLIDE]
    if len(names) != 1 or len(pads) != 2 or len(slides) != 2:
        return [], []
    data = mujoco.MjData(model)
    apart = []
    for moved in ((0.0, 0.0), (1e-3, 0.0), (0.0, 1e-3)):
        for slide, value in zip(slides, moved, strict=True):
            data.joint(slide).qpos = value
        mujoco.mj_kinematics(model, data)
        into = data.xmat[pads.bodies[1]].reshape(3, 3)[:, 2]
        apart.append(float(into @ (data.xpos[pads.bodies[1]] - data.xpos[pads.bodies[0]])))
    per_metre = [(one - apart[0]) / 1e-3 for one in apart[1:]]
    if abs(abs(per_metre[0]) - 1) > 0.01 or abs(abs(per_metre[1]) - 1) > 0.01:
        return [], []
    drives = [
        Drive(names[0], joint=slide, unit="m", scale=round(0.5 * sign, 6), offset=round(-0.5 * sign * apart[0], 6))
        for slide, sign in zip(slides, np.sign(per_metre).tolist(), strict=True)
    ]
    said = (
        f"stream {names[0]!r} is taken to be the distance between the pads; {slides[0]!r} and {slides[1]!r} each move "
        "half of it"
    )
    return drives, [said]


def _measured(
    model: mujoco.MjModel, drive: Drive, values: NDArray[np.float64], raw: NDArray[np.float64] | None
) -> Drive:
    """Return the drive with unit and resolution estimated from the values."""
    if drive.body:
        return replace(drive, unit="mm" if np.nanmax(np.abs(values[:, :3])) > 10 else "m")
    family = units.LENGTH if int(model.joint(drive.joint).type[0]) == _SLIDE else units.ANGLE
    unit = next(iter(family))
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    offset = float(np.asarray(drive.offset))
    unit = units.better_unit(unit, low, high, limits_of(model, drive), drive.scale, offset) or unit
    step = resolution(values if raw is None else raw)
    return replace(drive, unit=unit, resolution=float(f"{step:.6g}") if step else None)


def _objects(model: mujoco.MjModel, driven: set[str]) -> tuple[tuple[ObjectStart, ...], list[str]]:
    starts, said = [], []
    for body in range(1, model.nbody):
        name = model.body(body).name
        if not _is_object(model, body) or name in driven:
            continue
        pose = model.qpos0[(at := int(model.jnt_qposadr[model.body_jntadr[body]])) : at + 7]
        starts.append(ObjectStart(name, tuple(pose[:3].tolist()), tuple(pose[3:].tolist())))
        said.append(f"object {name!r} starts at its pose in the MJCF: check that it was there in the experiment")
    return tuple(starts), said


def _left(model: mujoco.MjModel, drives: list[Drive], streams: Mapping[str, NDArray[np.float64]]) -> list[str]:
    lines = []
    unused = [name for name in streams if name not in {drive.stream for drive in drives}]
    if unused:
        lines.append(f"streams that move nothing: {', '.join(unused)}")
    driven = {drive.joint for drive in drives}
    still = [
        model.joint(i).name for i in range(model.njnt) if _is_scalar(model, i) and model.joint(i).name not in driven
    ]
    if still:
        lines.append(f"joints that no stream moves: {', '.join(still)}")
    lines += [
        f"stream {drive.source!r} shows no encoder steps; if its encoder has steps, set resolution = ..."
        for drive in drives
        if drive.joint and drive.resolution is None
    ]
    return lines
