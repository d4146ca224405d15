"""A first scene guessed from the names, shapes and value ranges of a model and a recording."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
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
from paxisim.scene.motion import resolution
from paxisim.scene.opening import Hand, closing_stream, hands_of
from paxisim.scene.scene import Scene
from paxisim.scene.streams import limits_of

_OPENING = re.compile(r"opening|width|aperture|gripper", re.IGNORECASE)
_NOT_MOTION = re.compile(r"force|current|torque|effort|velocity|speed|temp|resultant|command", re.IGNORECASE)
_GENERIC = re.compile(r"\b(joint states?|state|observation|pos|position|qpos|rad|deg|mm|m)\b")
_LEAST_OPENING = 0.1  # share of the largest opening; a stream in mm that stays below it may be a share
_FREE, _SLIDE = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_SLIDE)

Streams = Mapping[str, NDArray[np.float64]]


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


def guess_scene(mjcf: Path, recording: Recording, raw: Streams | None = None, opening: str = "") -> GuessedScene:
    """Guess which streams of a recording move which parts of a model.

    Args:
        mjcf: Path of the model's MJCF file, with pads.
        recording: The recording.
        raw: Covariates as recorded, before they were resampled to one clock; these show encoder steps.
        opening: Name of the stream that is the opening of a gripper. Default: guessed.

    Raises:
        InvalidValueError: The model cannot be read or has no pads, no stream matches anything in it, or the values of a
            stream are beyond the limits of its joint in every unit.
        UnknownNameError: There is no stream `opening`.
    """
    spec = load_spec(mjcf)
    model = compile_spec(spec, str(mjcf))
    pads = find_pads(model)
    hands = hands_of(spec, model, pads)
    streams = {name: values for name, values in recording.covariates.items() if np.isfinite(values).any()}
    if opening and opening not in streams:
        raise UnknownNameError("stream", opening, streams, "expected among the recording's covariates (--opening)")
    by_name = {name: values for name, values in streams.items() if name != opening}
    drives, found, doubts = _by_name(model, by_name)
    drives = [_measured(model, drive, streams[drive.stream]) for drive in drives]
    taken = {drive.stream for drive in drives}
    candidates = [opening] if opening else [name for name in _openings(streams) if name not in taken]
    opened, more = _opening(model, hands, {name: streams[name] for name in candidates}, drives)
    if opening and not opened:
        raise InvalidValueError(more[0] if more else "--opening needs a hand with two pads that no other stream moves")
    drives, doubts = drives + opened, doubts + more
    if not drives:
        joints = ", ".join(name for i in range(model.njnt) if (name := model.joint(i).name)) or "none"
        raise InvalidValueError(
            f"no stream of the recording ({', '.join(recording.covariates) or 'it has none'}) has the name of a "
            f"joint, mocap body or object of the model (joints: {joints}), and none is an opening: add the streams of "
            "the robot's log (--streams), or write the scene by hand"
        )
    drives, more = _in_one_unit(model, drives, streams)
    drives = [_stepped(drive, (raw or {}).get(drive.stream, streams[drive.stream])) for drive in drives]
    start, placed = _objects(model, {drive.body for drive in drives})
    carried = _moving_pads(model, pads)
    closing = closing_stream(model, hands, drives, carried)
    scene = Scene(mjcf, tuple(drives), closing=closing, start=start)
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


def _words(name: str) -> tuple[str, ...]:
    """Return the words of a name in lower case, without generic ones."""
    return tuple(_GENERIC.sub(" ", re.sub(r"[\W_]+", " ", name.lower())).split())


def _endings(name: str) -> set[str]:
    """Return the endings of a name, word by word, which have a letter."""
    words = _words(name)
    endings = ("".join(words[i:]) for i in range(len(words)))
    return {ending for ending in endings if re.search("[a-z]", ending)}


def _by_name(model: mujoco.MjModel, streams: Streams) -> tuple[list[Drive], list[str], list[str]]:
    """Return the drives of the streams that are named as what they move, why, and what is in doubt."""
    joints = [model.joint(i).name for i in range(model.njnt) if _is_scalar(model, i)]
    bodies = [model.body(i).name for i in range(1, model.nbody) if _is_posed(model, i)]
    drives, found, doubts = [], [], []
    for kind, does, names in (("joint", "moves", joints), ("body", "poses", bodies)):
        its = [name for name, values in streams.items() if _suits(values, kind) and not _NOT_MOTION.search(name)]
        for exact in (True, False):
            alike = {stream: _alike(stream, names, exact) for stream in its}
            if kind == "joint" and not exact:
                alike = {s: [n for n in same if _is_near(model, n, streams[s])] for s, same in alike.items()}
            for stream, same in alike.items():
                rivals = [other for other, its_same in alike.items() if set(its_same) & set(same)]
                if len(same) == 1 == len(rivals):
                    drives.append(Drive(stream, joint=same[0]) if kind == "joint" else Drive(stream, body=same[0]))
                    said = f"stream {stream!r} {does} {kind} {same[0]!r}: their names"
                    (found if exact else doubts).append(f"{said} {'agree' if exact else 'end alike'}")
                elif same and not exact:
                    doubts.append(
                        f"{_several('stream', rivals)} could each move {_several(kind, same)}, so none does: rename "
                        "them, or write the drive by hand"
                    )
            its = [stream for stream in its if not any(drive.stream == stream for drive in drives)]
            names = [name for name in names if not any(drive.target == name for drive in drives)]
    return drives, found, list(dict.fromkeys(doubts))


def _several(kind: str, names: Sequence[str]) -> str:
    return f"{kind} {names[0]!r}" if len(names) == 1 else f"{kind}s {', '.join(map(repr, names))}"


def _suits(values: NDArray[np.float64], kind: str) -> bool:
    return values.ndim == 1 if kind == "joint" else values.ndim == 2 and values.shape[1] in (3, 7)


def _alike(stream: str, names: Sequence[str], exact: bool) -> list[str]:
    """Return the names that agree with that of a stream, or those that have the longest ending in common with it."""
    whole = "".join(_words(stream))
    if exact:
        return [name for name in names if whole and whole == "".join(_words(name))]
    common = {}
    for name in names:
        other = "".join(_words(name))
        if whole in _endings(name) or other in _endings(stream):
            common[name] = min(len(whole), len(other))
    return [name for name, length in common.items() if length == max(common.values())]


def _is_near(
    model: mujoco.MjModel, joint: str, values: NDArray[np.float64], factors: Sequence[float] = (1.0, math.pi / 180)
) -> bool:
    """Return whether values are within the limits of a joint when multiplied by one of the factors."""
    limits = limits_of(model, Drive("stream", joint=joint))
    factors = (1.0,) if int(model.joint(joint).type[0]) == _SLIDE else factors
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return any(units.is_within(factor * low, factor * high, limits) for factor in factors)


def _is_scalar(model: mujoco.MjModel, joint: int) -> bool:
    return bool(model.joint(joint).name) and int(model.jnt_type[joint]) in (_SLIDE, int(mujoco.mjtJoint.mjJNT_HINGE))


def _is_posed(model: mujoco.MjModel, body: int) -> bool:
    return model.body_mocapid[body] >= 0 or _is_object(model, body)


def _is_object(model: mujoco.MjModel, body: int) -> bool:
    first = int(model.body_jntadr[body])
    return bool(model.body(body).name) and first >= 0 and int(model.jnt_type[first]) == _FREE


def _moving_pads(model: mujoco.MjModel, pads: Pads) -> set[str]:
    """Return the names of the joints that move the pads."""
    above = {body for pad in pads.bodies for body in (int(pad), *bodies_above(model, int(pad)))}
    return {model.joint(j).name for j in range(model.njnt) if int(model.jnt_bodyid[j]) in above}


def _openings(streams: Streams) -> list[str]:
    """Return the names of streams that may be the opening of a gripper."""
    return [n for n, v in streams.items() if v.ndim == 1 and _OPENING.search(n) and not _NOT_MOTION.search(n)]


def _opening(
    model: mujoco.MjModel, hands: Sequence[Hand], streams: Streams, drives: Sequence[Drive]
) -> tuple[list[Drive], list[str]]:
    """Return the drives of a stream that is a gripper's opening, and what is in doubt."""
    driven = {drive.joint for drive in drives}
    still = [hand for hand in hands if len(hand.pads) == 2 and not driven & set(hand.joints)]
    if not streams or not still:
        return [], []
    if len(streams) > 1 or len(still) > 1:
        what = f"{_several('stream', list(streams))} could each be the opening of a hand, so none is"
        advice = "write the drives by hand" if len(still) > 1 else "choose one with --opening"
        return [], [f"{what}: {advice}"]
    (name, values), hand = next(iter(streams.items())), still[0]
    moved = hand.drives(name)
    if not moved:
        doubt = f"stream {name!r} moves nothing: the distance between the pads does not grow steadily with the joints "
        return [], [doubt + f"that move them ({', '.join(hand.joints)}); write its drive by hand"]
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    ends = sorted(((np.array(limits_of(model, moved[0])) - moved[0].offset) / moved[0].scale).tolist())
    possible = [
        unit
        for unit, factor in units.LENGTH.items()
        if units.is_within(factor * low, factor * high, (ends[0], ends[1]))
        and (unit == "m" or factor * high > _LEAST_OPENING * ends[1])
    ]
    if not possible:
        doubt = (
            f"stream {name!r} moves nothing: it goes from {low:.4g} to {high:.4g}, and the distance between the pads "
        )
        advice = "it may be a share, a count or an angle; write its drive by hand"
        return [], [doubt + f"from {1e3 * ends[0]:.4g} to {1e3 * ends[1]:.4g} mm; {advice}"]
    moved = [replace(drive, unit=possible[0]) for drive in moved]
    joints = " and ".join(repr(drive.joint) for drive in moved)
    how = "each move half of it" if not moved[0].curve else "follow a curve from the model's own linkage"
    said = f"stream {name!r} is taken to be the distance between the pads; {joints} {how}"
    return moved, [said]


def _measured(model: mujoco.MjModel, drive: Drive, values: NDArray[np.float64]) -> Drive:
    """Return the drive with the unit in which the values are within its limits.

    Raises:
        InvalidValueError: There is no such unit.
    """
    if drive.body:
        return replace(drive, unit="mm" if np.nanmax(np.abs(values[:, :3])) > 10 else "m")
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
        if drive.unit == "rad" and _is_near(model, drive.joint, deg * streams[drive.stream], (1.0,))
    ]
    changed = [replace(drive, unit="deg") if drive in too else drive for drive in drives]
    names = [drive.stream for drive in too]
    return changed, [f"{_several('stream', names)} could be in rad too, but {degrees!r} is in deg"] if too else []


def _stepped(drive: Drive, values: NDArray[np.float64]) -> Drive:
    """Return the drive with the step size of its encoder, estimated from the values as recorded."""
    step = 0.0 if drive.body else resolution(values)
    return replace(drive, resolution=float(f"{step:.6g}")) if step else drive


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


def _apart(hands: Sequence[Hand], drives: Sequence[Drive], carried: Collection[str]) -> list[str]:
    """Return a line if joints are driven that carry no pad, though there is a hand."""
    outside = [drive.joint for drive in drives if drive.joint and not any(drive.joint in h.joints for h in hands)]
    if not hands or not outside or any(joint in carried for joint in outside):
        return []
    return [
        f"{_several('joint', outside)} carry no pad: if they are of the arm that carries the hand, put the hand "
        "on it with paxisim scene compose --arm ARM --at BODY --hand HAND"
    ]


def _left(model: mujoco.MjModel, hands: Sequence[Hand], drives: Sequence[Drive], streams: Streams) -> list[str]:
    lines = []
    unused = [name for name in streams if name not in {drive.stream for drive in drives}]
    if unused:
        lines.append(f"streams that move nothing: {', '.join(unused)}")
    driven = {drive.joint for drive in drives}
    driven |= {joint for hand in hands if driven & set(hand.joints) for joint in hand.joints}
    still = [
        model.joint(i).name for i in range(model.njnt) if _is_scalar(model, i) and model.joint(i).name not in driven
    ]
    if still:
        lines.append(f"joints that no stream moves: {', '.join(still)}")
    smooth = list(dict.fromkeys(drive.source for drive in drives if drive.joint and drive.resolution is None))
    if smooth:
        lines.append(
            f"without visible encoder steps: {', '.join(smooth)}; if an encoder has steps, set resolution = ..."
        )
    return lines
