"""Observations: what the networks see of a task, and the spaces of observations and actions."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

import paxisim

from .arrays import library_of, like, rotation_vector
from .engines.scene import Scene
from .tasks import Task

PRIVILEGED = "privileged"
"""Key of the observation that only the critic may see, never the actor."""

LARGEST_FORCE, LARGEST_POSE = 1e3, 10.0
"""Finite bounds of the observation space (N; m and rad), larger than any value; checkers dislike infinite ones."""

RAW = "raw"
"""Key of the newest reading before the chain, for a replay buffer that draws its own chains; no network sees it."""


def make_spaces(
    task: Task, history: paxisim.History, frame: tuple[int, int, int, int], *, raw: bool
) -> tuple[Any, Any]:
    """Return the spaces of one environment's observations, a Dict, and actions, a Box; see `InsertionEnv`.

    Args:
        task: The task.
        history: The encoded history that the policy sees.
        frame: Shape ``(pads, 3, rows, cols)`` of a reading.
        raw: Whether the observation has the newest reading before the chain.
    """
    shape = history.encoding.shape(frame[0], history.k)
    entries: Any = {"p": _pose_space(1), PRIVILEGED: _pose_space(2)}
    if shape[0]:
        entries["tactile"] = spaces.Box(-LARGEST_FORCE, LARGEST_FORCE, shape, np.float32)
    if raw:
        entries[RAW] = spaces.Box(-LARGEST_FORCE, LARGEST_FORCE, frame, np.float32)
    return spaces.Dict(entries), spaces.Box(-1.0, 1.0, (len(task.axes),), np.float32)


def _pose_space(poses: int) -> spaces.Box:
    return spaces.Box(-LARGEST_POSE, LARGEST_POSE, (6 * poses,), np.float32)


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
