"""Reading and checking of the driving streams of a recording, and the start poses of its episodes."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.logs.encoder_steps import noted_step, resolution
from paxisim.recording import Recording
from paxisim.scene import units
from paxisim.scene.drive import Drive, ObjectStart
from paxisim.scene.poses import as_poses, is_pose
from paxisim.scene.rig import Rig

_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
_FARTHEST = 10.0  # m; a position beyond this indicates a wrong unit
_MOST_TURN = 20 * np.pi  # rad; for a hinge without limits
_LISTED = 4  # at most this many episodes are named in a message


def driving_values(recording: Recording, drive: Drive) -> NDArray[np.float64]:
    """Return the motion of the drive's target in SI units, for a stream that is known throughout: see `Drive.to_scene`.

    Raises:
        UnknownNameError: The recording does not have the stream.
        InvalidValueError: The stream has the wrong shape, or none of its values is known.
    """
    return drive.to_scene(raw_values(recording, drive))


def raw_values(recording: Recording, drive: Drive) -> NDArray[np.float64]:
    """Return the stream's own values, in its unit; see `driving_values`."""
    values = _covariate(recording, drive.stream)
    if drive.column is not None:
        if values.ndim != 2 or drive.column >= values.shape[1]:
            raise InvalidValueError(f"stream {drive.stream!r} of shape {values.shape} has no column {drive.column}")
        values = values[:, drive.column]
    expected = "(T, 3), (T, 7), (T, 16) or (T, 4, 4)" if drive.body else "(T,)"
    fits = is_pose(values) if drive.body else values.ndim == 1
    if not fits:
        hint = "; choose one with column = ..." if values.ndim == 2 and not drive.body else ""
        raise InvalidValueError(
            f"stream {drive.stream!r} must be {expected} to drive {drive.kind} {drive.target!r}, "
            f"got shape {values.shape}{hint}"
        )
    if not np.isfinite(values).any():
        raise InvalidValueError(f"stream {drive.source!r} holds no number, so it drives nothing")
    return values


def encoder_step(recording: Recording, drive: Drive) -> float:
    """Return the resolution of the drive's stream in the stream's unit; 0 for a pose.

    Unless the drive states it, it is what the recording noted before it interpolated the stream, or is estimated from
    all episodes of the recording.
    """
    if drive.body:
        return 0.0
    values = raw_values(recording, drive)
    if drive.resolution is not None:
        return drive.resolution
    return noted_step(recording.metadata, drive.stream, drive.column) or resolution(values)


def known_samples(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return a mask ``(T,)`` of the samples at which no value of a ``(T, ...)`` stream is NaN."""
    return np.asarray(np.isfinite(values.reshape(len(values), -1)).all(axis=1))


def _covariate(recording: Recording, stream: str) -> NDArray[np.float64]:
    if stream not in recording.covariates:
        raise UnknownNameError("stream", stream, recording.covariates, "expected among the recording's covariates")
    return recording.covariates[stream]


def check_streams(recording: Recording, rig: Rig) -> None:
    """Check all streams that the scene must follow, before anything is simulated.

    Raises:
        UnknownNameError: A stream does not exist.
        InvalidValueError: A motion exceeds its limits (the message suggests a unit that fits, if there is one) or is
            implausibly small for them, a stream has a gap or is unknown in a whole episode, quaternions do not have
            length 1, or nothing would move.
    """
    moving = False
    for drive in (*rig.prescribed, *rig.followed, *rig.commands):
        values = raw_values(recording, drive)
        _check_known(recording, drive, values)
        if drive.body:
            _check_pose(drive, values[known_samples(values)])
        else:
            _check_limits(drive, values, limits_of(rig.model, drive))
        known = values[known_samples(values)]
        moving |= bool(np.ptp(known, axis=0).max() > 0)
    if not moving:
        streams = ", ".join(drive.source for drive in (*rig.prescribed, *rig.followed, *rig.commands))
        raise InvalidValueError(f"nothing would move: the driving streams ({streams}) are constant or drive nothing")


def limits_of(model: mujoco.MjModel, drive: Drive) -> tuple[float, float]:
    """Return the limits of a joint or control in SI units, or the ends of the drive's curve.

    If the model sets none for a joint, they are wide, plausible ones.
    """
    if drive.curve:
        return drive.curve[0][0], drive.curve[-1][0]
    if drive.actuator:
        actuator = model.actuator(drive.actuator).id
        low, high = model.actuator_ctrlrange[actuator]
        return (float(low), float(high)) if model.actuator_ctrllimited[actuator] else (-np.inf, np.inf)
    joint = model.joint(drive.joint).id
    if model.jnt_limited[joint]:
        low, high = model.jnt_range[joint]
        return float(low), float(high)
    farthest = _FARTHEST if int(model.jnt_type[joint]) == _SLIDE else _MOST_TURN
    return -farthest, farthest


def _check_limits(drive: Drive, values: NDArray[np.float64], limits: tuple[float, float]) -> None:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    moved = sorted(drive.scaled(np.array([low, high])).tolist())
    slack = abs(drive.gain) * (drive.resolution or 0.0)
    outside = not units.is_within(moved[0], moved[1], limits, slack)
    better = ""
    if np.isfinite(limits).all():
        better = units.better_unit(drive.unit, low, high, limits, drive.scale, float(np.asarray(drive.offset)))
    moves = "gives the curve of" if drive.curve else "moves"
    what = f"stream {drive.source!r} {moves} {drive.kind} {drive.target!r} from {moved[0]:.4g} to {moved[1]:.4g}"
    if outside:
        advice = (
            f'its values are {better}, not {drive.unit}: set unit = "{better}"'
            if better
            else ("check unit, scale and offset of the drive")
        )
        raise InvalidValueError(f"{what}, beyond its limits {limits[0]:.4g} to {limits[1]:.4g}; {advice}")
    if better:
        raise InvalidValueError(
            f"{what}, a small part of its limits {limits[0]:.4g} to {limits[1]:.4g}; its values look like {better}, "
            f'not {drive.unit}: set unit = "{better}"'
        )


def _check_pose(drive: Drive, values: NDArray[np.float64]) -> None:
    reach = float(np.abs(drive.to_scene(values)[:, :3]).max())
    if reach > _FARTHEST:
        advice = 'its values look like mm: set unit = "mm"' if reach * 1e-3 <= _FARTHEST else "check its unit"
        raise InvalidValueError(
            f"stream {drive.source!r} moves body {drive.body!r} {reach:.4g} m away from the origin; {advice}"
        )


def _check_known(recording: Recording, drive: Drive, values: NDArray[np.float64]) -> None:
    known = known_samples(values)
    without = []
    for part in recording.episodes():
        number = int(part.episode[0])
        inside = known[recording.episode == number]
        if not inside.any():
            without.append(number)
            continue
        first, last = np.flatnonzero(inside)[[0, -1]]
        gap = np.flatnonzero(~inside[first:last])
        if len(gap):
            begin = first + gap[0]
            end = begin + int(np.argmax(inside[begin:]))
            time = part.time
            raise InvalidValueError(
                f"stream {drive.source!r} has a gap in episode {number}, from {time[begin - 1]:.3f} s to "
                f"{time[end]:.3f} s: exclude the episode with Recording.select, or allow longer gaps with "
                "Recording.load(max_gap=...)"
            )
    if without:
        raise InvalidValueError(
            f"{_listed(without)} without a start pose: stream {drive.source!r}, which drives {drive.kind} "
            f"{drive.target!r}, is not known in {'it' if len(without) == 1 else 'them'}"
        )


def object_poses(recording: Recording, start: ObjectStart) -> Mapping[int, NDArray[np.float64]]:
    """Return the start pose ``(7,)`` of an object, position (m) and quaternion, by episode number.

    Raises:
        UnknownNameError: The stream does not exist.
        InvalidValueError: The stream is not a pose, or is unknown in an episode.
    """
    numbers = [int(part.episode[0]) for part in recording.episodes()]
    if not start.stream:
        pose = np.array([*(start.pos or ()), *start.quat], dtype=np.float64)
        return dict.fromkeys(numbers, pose)
    values = _covariate(recording, start.stream)
    if not is_pose(values) or values.shape[1:] == (3,):
        raise InvalidValueError(
            f"stream {start.stream!r} must be (T, 7), position and quaternion, (T, 16) or (T, 4, 4) to start "
            f"{start.body!r}, got shape {values.shape}"
        )
    known = known_samples(values)
    without = [number for number in numbers if not known[recording.episode == number].any()]
    if without:
        raise InvalidValueError(
            f"{_listed(without)} without a start pose of {start.body!r}: stream {start.stream!r} is not known there"
        )
    first = {number: values[(recording.episode == number) & known][:1] for number in numbers}
    return {number: as_poses(one, start.quaternion, start.stream)[0] for number, one in first.items()}


def _listed(numbers: list[int]) -> str:
    names = ", ".join(str(number) for number in numbers[:_LISTED])
    if len(numbers) == 1:
        return f"episode {names} is"
    return f"episodes {names}{', ...' if len(numbers) > _LISTED else ''} ({len(numbers)}) are"
