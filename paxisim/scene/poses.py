"""Poses: the forms in which a stream may hold the pose of a body, brought into one.

| shape | holds |
|---|---|
| ``(T, 3)`` | a position |
| ``(T, 7)`` | a position and a quaternion, whose order no value tells |
| ``(T, 16)``, ``(T, 4, 4)`` | a homogeneous matrix, row by row or column by column, as its zeros tell |
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from paxisim.errors import InvalidValueError

ORDERS = ("wxyz", "xyzw")
"""Orders of a quaternion's numbers."""
_SHAPES = ((3,), (7,), (16,), (4, 4))
_OFF = 0.01  # largest error of a quaternion's length or a matrix's entry; resampling bends matrices a little


def is_pose(values: NDArray[np.float64]) -> bool:
    """Return whether a stream has the shape of a pose."""
    return values.shape[1:] in _SHAPES


def as_poses(values: NDArray[np.float64], quaternion: str, stream: str) -> NDArray[np.float64]:
    """Return positions ``(T, 3)``, or positions and quaternions w x y z ``(T, 7)``.

    Args:
        values: Known values of the stream, in one of the shapes above.
        quaternion: Order of its quaternions, one of `ORDERS`.
        stream: Name of the stream, for messages.

    Raises:
        InvalidValueError: The quaternions do not have length 1, or the matrices are no poses.
    """
    if values.shape[1:] == (3,):
        return values
    if values.shape[1:] == (7,):
        poses = values if quaternion == "wxyz" else values[:, [0, 1, 2, 6, 3, 4, 5]]
        off = float(np.abs(np.linalg.norm(poses[:, 3:], axis=1) - 1).max(initial=0.0))
        if off > _OFF:
            raise InvalidValueError(
                f"stream {stream!r} must have quaternions {' '.join(quaternion)} of length 1 in its columns 3 to 6, "
                f"but one is off by {off:.2g}"
            )
        return poses
    matrices = values.reshape(-1, 4, 4)
    if _off(matrices) > _off(matrices.transpose(0, 2, 1)):
        matrices = matrices.transpose(0, 2, 1)
    if _off(matrices) > _OFF:
        raise InvalidValueError(
            f"stream {stream!r} must have homogeneous matrices: a rotation, a position and the row 0 0 0 1, "
            f"but one is off by {_off(matrices):.2g}"
        )
    turns = Rotation.from_matrix(matrices[:, :3, :3]).as_quat()[:, [3, 0, 1, 2]]
    return np.hstack([matrices[:, :3, 3], turns])


def _off(matrices: NDArray[np.float64]) -> float:
    """Return the largest error of an entry of homogeneous matrices."""
    turns = matrices[:, :3, :3]
    errors = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(initial=0.0)
    mirrored = 2.0 * bool(np.any(np.linalg.det(turns) < 0))
    return max(float(errors), mirrored, float(np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(initial=0.0)))
