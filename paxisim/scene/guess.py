"""A first scene guessed from the names, shapes and value ranges of a model and a recording."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.models.links import bodies_above
from paxisim.models.load import compile_spec, load_spec
from paxisim.models.pads import Pads, find_pads
from paxisim.recording import Recording
from paxisim.scene import units
from paxisim.scene.drive import Drive, ObjectStart
from paxisim.scene.named import Streams, by_name, is_near, is_object, is_scalar, several
from paxisim.scene.opening import opening_drives, openings
from paxisim.scene.scene import Scene
from paxisim.scene.streams import encoder_step, known_samples, limits_of
from paxisim.scene.tactile_hand import TactileHand, closing_stream, hands_of

_FARTHEST = 10.0  # m; a body further away is in mm
_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)


@dataclass(frozen=True, eq=False)
class GuessedScene:
    """Result of `guess_scene`.

    Attributes:
        scene: The guessed scene.
        found: One line for each stream that has the name of what it moves.
        open: One line for each guess and open question that the user should check.
    """

    scene: Scene
    found: tuple[str, ...]
    open: tuple[str, ...]


def guess_scene(mjcf: Path, recording: Recording, opening: str = "", quaternion: str = "") -> GuessedScene:
    """Guess which streams of a recording move which parts of a model.

    Args:
        mjcf: Path of the model's MJCF file, with pads.
        recording: The recording.
        opening: Name of the stream that is the opening of a gripper. Default: guessed.
        quaternion: Order of the quaternions of poses ``(T, 7)``, one of `paxisim.scene.poses.ORDERS`.

    Raises:
        InvalidValueError: The model cannot be read or has no pads, no stream matches anything in it, the values of a
            stream are beyond the limits of its joint in every unit, the order of a quaternion is not given, or
            `opening` cannot be one.
        UnknownNameError: There is no stream `opening`.
    """
    spec = load_spec(mjcf)
    model = compile_spec(spec, str(mjcf))
    pads = find_pads(model)
    hands = hands_of(spec, model, pads)
    streams = {name: values for name, values in recording.covariates.items() if np.isfinite(values).any()}
    if opening and opening not in streams:
        raise UnknownNameError("stream", opening, streams, "expected among the recording's covariates (--opening)")
    if opening and streams[opening].ndim != 1:
        raise InvalidValueError(
            f"--opening must name a stream of one number per sample, got {opening!r} of shape {streams[opening].shape}"
        )
    drives, found, doubts = by_name(model, {name: values for name, values in streams.items() if name != opening})
    drives = [
        _posed(drive, streams[drive.stream], quaternion)
        if drive.body
        else _measured(model, drive, streams[drive.stream])
        for drive in drives
    ]
    taken = {drive.stream for drive in drives}
    candidates = [opening] if opening else [name for name in openings(streams) if name not in taken]
    opened, more = opening_drives(model, hands, {name: streams[name] for name in candidates}, drives)
    if opening and not opened:
        raise InvalidValueError(more[0] if more else "--opening needs a hand with two pads that no other stream moves")
    drives, doubts = drives + opened, doubts + more
    if not drives and doubts:
        raise InvalidValueError(doubts[0])
    if not drives:
        joints = ", ".join(name for i in range(model.njnt) if (name := model.joint(i).name)) or "none"
        raise InvalidValueError(
            f"no stream of the recording ({', '.join(recording.covariates) or 'it has none'}) has the name of a "
            f"joint, mocap body or object of the model (joints: {joints}), and none is an opening: add the streams of "
            "the robot's log (--streams), or write the scene by hand"
        )
    drives, more = _in_one_unit(model, drives, streams)
    drives = [_stepped(drive, recording) for drive in drives]
    start, placed = _objects(model, pads, {drive.body for drive in drives})
    carried = _moving_pads(model, pads)
    closing = closing_stream(model, hands, drives, carried)
    scene = Scene(mjcf, tuple(drives), mode="auto" if closing else "kinematic", closing=closing, start=start)
    more += [f"stream {closing!r} brings the pads into contact (closing)"] if closing else []
    gel = f"the modulus of the gel, {1e-3 * scene.gel.modulus:.4g} kPa, is a default: set that of your pads in [gel]"
    doubts += [
        gel,
        "the units are those in which the values fit the limits of the joints",
        *more,
        *placed,
        *_apart(hands, drives, carried),
        *_left(model, hands, drives, streams),
    ]
    return GuessedScene(scene, tuple(found), tuple(doubts))


def _moving_pads(model: mujoco.MjModel, pads: Pads) -> set[str]:
    """Return the names of the joints that move the pads."""
    above = {body for pad in pads.bodies for body in (int(pad), *bodies_above(model, int(pad)))}
    return {model.joint(j).name for j in range(model.njnt) if int(model.jnt_bodyid[j]) in above}


def _posed(drive: Drive, values: NDArray[np.float64], quaternion: str) -> Drive:
    """Return the drive of a body with the order of its quaternions and the unit of its position.

    Raises:
        InvalidValueError: The order is needed and not given, or the values are no poses.
    """
    if values.shape[1:] == (7,) and not quaternion:
        raise InvalidValueError(
            f"stream {drive.stream!r} poses body {drive.body!r}, but no value tells whether its quaternions are "
            "w x y z or x y z w: say so with --quaternion wxyz or --quaternion xyzw"
        )
    drive = replace(drive, quaternion=quaternion or "wxyz")
    places = drive.to_scene(values[known_samples(values)])[:, :3]
    return replace(drive, unit="mm" if np.abs(places).max() > _FARTHEST else "m")


def _measured(model: mujoco.MjModel, drive: Drive, values: NDArray[np.float64]) -> Drive:
    """Return the drive with the unit in which the values are within its limits.

    Raises:
        InvalidValueError: There is no such unit.
    """
    family = units.LENGTH if int(model.joint(drive.joint).type[0]) == _SLIDE else units.ANGLE
    unit = next(iter(family))
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    limits = limits_of(model, drive)
    unit = units.better_unit(unit, low, high, limits, drive.scale, float(np.asarray(drive.offset))) or unit
    drive = replace(drive, unit=unit)
    ends = sorted(drive.scaled(np.array([low, high])).tolist())
    if not units.is_within(ends[0], ends[1], limits):
        raise InvalidValueError(
            f"stream {drive.stream!r} goes from {low:.4g} to {high:.4g}, which no unit of {', '.join(family)} brings "
            f"into the limits of joint {drive.joint!r}, {limits[0]:.4g} to {limits[1]:.4g} {next(iter(family))}: "
            "rename the stream if it is something else, or correct the limits in the MJCF"
        )
    return drive


def _in_one_unit(model: mujoco.MjModel, drives: Sequence[Drive], streams: Streams) -> tuple[list[Drive], list[str]]:
    """Return the drives with all angles in degrees if one of them must be, since a robot's log has one unit."""
    degrees = next((drive.stream for drive in drives if drive.unit == "deg"), None)
    if degrees is None:
        return list(drives), []
    deg = units.factor("deg")
    too = [
        drive
        for drive in drives
        if drive.unit == "rad" and is_near(model, drive.joint, deg * streams[drive.stream], (1.0,))
    ]
    changed = [replace(drive, unit="deg") if drive in too else drive for drive in drives]
    names = [drive.stream for drive in too]
    return changed, [f"{several('stream', names)} could be in rad too, but {degrees!r} is in deg"] if too else []


def _stepped(drive: Drive, recording: Recording) -> Drive:
    """Return the drive with the step size of its encoder, estimated from the values as recorded."""
    step = encoder_step(recording, drive)
    return replace(drive, resolution=float(f"{step:.6g}")) if step else drive


def _objects(model: mujoco.MjModel, pads: Pads, driven: Collection[str]) -> tuple[tuple[ObjectStart, ...], list[str]]:
    """Return the start of each body with a free joint that no stream poses, and what is in doubt about all of them."""
    carrying = {body for pad in pads.bodies for body in bodies_above(model, int(pad))}
    starts, said = [], []
    for body in range(1, model.nbody):
        name = model.body(body).name
        if not is_object(model, body):
            continue
        if name in driven:
            if body not in carrying:
                said.append(
                    f"object {name!r} follows its stream throughout, whatever touches it; to place it only at the "
                    "start of each episode, put the stream into a [[start]] instead of the [[drive]]"
                )
            continue
        if body in carrying:
            said.append(f"body {name!r} carries pads and moves freely, but no stream poses it, so it falls")
        else:
            said.append(f"object {name!r} starts at its pose in the MJCF: check that it was there in the experiment")
        pose = model.qpos0[(at := int(model.jnt_qposadr[model.body_jntadr[body]])) : at + 7]
        starts.append(ObjectStart(name, tuple(pose[:3].tolist()), tuple(pose[3:].tolist())))
    return tuple(starts), said


def _apart(hands: Sequence[TactileHand], drives: Sequence[Drive], carried: Collection[str]) -> list[str]:
    """Return a line if joints are driven that carry no pad, though there is a hand."""
    outside = [drive.joint for drive in drives if drive.joint and not any(drive.joint in h.joints for h in hands)]
    if not hands or not outside or any(joint in carried for joint in outside):
        return []
    return [
        f"no pad is moved by {several('joint', outside)}: if the hand is on this arm, put it there in the model too, "
        "with paxisim scene compose --arm ARM --at BODY --hand HAND"
    ]


def _left(model: mujoco.MjModel, hands: Sequence[TactileHand], drives: Sequence[Drive], streams: Streams) -> list[str]:
    """Return what no stream moves, what moves nothing, and which encoders show no steps."""
    lines = []
    unused = [name for name in streams if name not in {drive.stream for drive in drives}]
    if unused:
        lines.append(f"streams that move nothing: {', '.join(unused)}")
    driven = {drive.joint for drive in drives}
    driven |= {joint for hand in hands if driven & set(hand.joints) for joint in hand.joints}
    still = [
        model.joint(i).name for i in range(model.njnt) if is_scalar(model, i) and model.joint(i).name not in driven
    ]
    if still:
        lines.append(f"joints that no stream moves: {', '.join(still)}")
    smooth = list(dict.fromkeys(drive.source for drive in drives if drive.joint and drive.resolution is None))
    if smooth:
        lines.append(
            f"without visible encoder steps: {', '.join(smooth)}; if an encoder has steps, set resolution = ..."
        )
    return lines
