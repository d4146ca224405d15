"""Frames of ROS tf: transforms between two frames each become poses in the root of their tree.

A frame on another one that moves would need transforms at the same times; it is left out, and so is one that changes
its parent. A frame that is stated once is part of the tree, but no stream.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.logs.stream import Stream

_SIGN = "tf "  # begins the name of a sample that is a transform; no topic or joint has a blank
_ON = " on "


def transform_samples(message: Any) -> Iterator[tuple[str, int | None, NDArray[np.float64]]]:
    """Yield the transforms of a ``tf2_msgs/TFMessage``, each as a 4x4 matrix, under a name that `is_frame` knows."""
    from scipy.spatial.transform import Rotation  # takes memory and time that other files need not pay for

    for one in message.transforms:
        child, parent = one.child_frame_id.strip("/"), one.header.frame_id.strip("/")
        place, turn, stamp = one.transform.translation, one.transform.rotation, one.header.stamp
        matrix = np.eye(4)
        matrix[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
        matrix[:3, 3] = place.x, place.y, place.z
        yield f"{_SIGN}{child}{_ON}{parent}", (stamp.sec * 10**9 + stamp.nanosec) or None, matrix


def is_frame(name: str) -> bool:
    """Return whether a sample of this name is a transform."""
    return name.startswith(_SIGN) and _ON in name


def poses_in_root(transforms: Mapping[str, Stream]) -> tuple[dict[str, Stream], list[str]]:
    """Return the poses ``(n, 16)`` of the moving frames, 4x4 matrices row by row, and the frames that are left out.

    Args:
        transforms: Streams of ``(n, 4, 4)`` matrices by the names of `transform_samples`.
    """
    frames: dict[str, Stream] = {}
    parents: dict[str, str] = {}
    left = []
    for name, stream in transforms.items():
        child, parent = name.removeprefix(_SIGN).split(_ON, 1)
        if child in parents:
            left.append(f"{child} on {parents[child]} and on {parent}")
            frames.pop(child, None)
        else:
            frames[child], parents[child] = stream, parent
    found = {}
    for child, stream in frames.items():
        if len(stream.values) == 1:
            continue  # it is stated once and does not move
        fixed = _in_root(parents[child], frames, parents, {child})
        if fixed is None:
            left.append(f"{child} on {parents[child]}")
        else:
            found[child] = Stream(stream.nanoseconds, (fixed @ stream.values).reshape(-1, 16))
    return found, left


def _in_root(
    frame: str, frames: Mapping[str, Stream], parents: Mapping[str, str], passed: set[str]
) -> NDArray[np.float64] | None:
    """Return the pose of a frame that does not move in the root of its tree; None if it moves."""
    pose = np.eye(4)
    while frame in parents:
        if frame in passed or frame not in frames or _moves(frames[frame]):
            return None
        passed.add(frame)
        pose = frames[frame].values[0] @ pose
        frame = parents[frame]
    return pose


def _moves(stream: Stream) -> bool:
    return bool(np.any(stream.values != stream.values[0]))
