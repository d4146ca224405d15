"""Poses of fingertip and peg as observed by the networks."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from .scene import Scene

PRIVILEGED = "privileged"
"""Key of the observation that only the critic may see, never the actor."""


def observed_poses(
    scene: Scene,
    tip: NDArray[np.floating],
    tip_rotation: NDArray[np.floating],
    peg: NDArray[np.floating],
    peg_rotation: NDArray[np.floating],
) -> dict[str, NDArray[np.float32]]:
    """Return the entries ``"p"`` ``(..., 6)`` and ``"privileged"`` ``(..., 12)`` of one or more observations.

    Args:
        scene: Any scene of the task.
        tip: ``(..., 3)`` position of the fingertip in the world (m).
        tip_rotation: ``(..., 3, 3)`` rotation of the fingertip.
        peg: ``(..., 3)`` position of the peg in the world (m).
        peg_rotation: ``(..., 3, 3)`` rotation of the peg.
    """
    seen = np.concatenate([tip - scene.base, rotation_vector(tip_rotation @ scene.nominal.T)], axis=-1)
    hidden = np.concatenate([peg - scene.base, rotation_vector(peg_rotation)], axis=-1)
    both = np.concatenate([hidden, seen], axis=-1).astype(np.float32)
    own = both[..., 6:]
    return {"p": np.zeros_like(own) if scene.task.hole_is_hidden else own.copy(), PRIVILEGED: both}


def rotation_vector(rotation: NDArray[np.floating]) -> NDArray[np.floating]:
    """Convert rotation matrices ``(..., 3, 3)`` to rotation vectors ``(..., 3)`` (rad)."""
    matrices = np.ascontiguousarray(rotation).reshape(-1, 9)
    quat, vectors = np.zeros(4), np.empty((len(matrices), 3))
    for matrix, vector in zip(matrices, vectors, strict=True):
        mujoco.mju_mat2Quat(quat, matrix)
        mujoco.mju_quat2Vel(vector, quat, 1.0)
    return vectors.reshape(rotation.shape[:-1])
