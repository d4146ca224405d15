"""Poses of fingertip and peg as observed by the networks."""

from __future__ import annotations

import math
from typing import Any

from .arrays import library_of, like
from .scene import Scene

PRIVILEGED = "privileged"
"""Key of the observation that only the critic may see, never the actor."""


def observed_poses(scene: Scene, tip: Any, tip_rotation: Any, peg: Any, peg_rotation: Any) -> dict[str, Any]:
    """Return the entries ``"p"`` ``(..., 6)`` and ``"privileged"`` ``(..., 12)`` of one or more observations.

    The poses are arrays of numpy or torch, and so are the entries.

    Args:
        scene: Any scene of the task.
        tip: ``(..., 3)`` position of the fingertip in the world (m).
        tip_rotation: ``(..., 3, 3)`` rotation of the fingertip.
        peg: ``(..., 3)`` position of the peg in the world (m).
        peg_rotation: ``(..., 3, 3)`` rotation of the peg.
    """
    xp = library_of(tip)
    base = like(scene.base, tip)
    seen = xp.concat([tip - base, rotation_vector(tip_rotation @ like(scene.nominal.T, tip))], axis=-1)
    hidden = xp.concat([peg - base, rotation_vector(peg_rotation)], axis=-1)
    both = xp.astype(xp.concat([hidden, seen], axis=-1), xp.float32)
    own = xp.zeros_like(both[..., 6:]) if scene.task.hole_is_hidden else xp.astype(seen, xp.float32)
    return {"p": own, PRIVILEGED: both}


def rotation_vector(rotation: Any) -> Any:
    """Convert rotation matrices ``(..., 3, 3)`` to rotation vectors ``(..., 3)`` (rad), in numpy or torch."""
    xp = library_of(rotation)
    m = [[rotation[..., row, column] for column in range(3)] for row in range(3)]
    x, y, z = m[0][0], m[1][1], m[2][2]
    # four multiples of the quaternion, each by four times one of its components, which is the entry on the diagonal
    multiples = [
        [1 + x + y + z, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]],
        [m[2][1] - m[1][2], 1 + x - y - z, m[1][0] + m[0][1], m[0][2] + m[2][0]],
        [m[0][2] - m[2][0], m[1][0] + m[0][1], 1 - x + y - z, m[2][1] + m[1][2]],
        [m[1][0] - m[0][1], m[0][2] + m[2][0], m[2][1] + m[1][2], 1 - x - y + z],
    ]
    largest, quat = multiples[0][0], xp.stack(multiples[0], axis=-1)
    for index in (1, 2, 3):
        larger = multiples[index][index] > largest
        largest = xp.where(larger, multiples[index][index], largest)
        quat = xp.where(larger[..., None], xp.stack(multiples[index], axis=-1), quat)
    axis = quat[..., 1:]
    sine = xp.sqrt(xp.sum(axis * axis, axis=-1))
    angle = 2 * xp.atan2(sine, quat[..., 0])
    angle = xp.where(angle > math.pi, angle - 2 * math.pi, angle)
    return axis * (angle / xp.where(sine > 0, sine, xp.ones_like(sine)))[..., None]
