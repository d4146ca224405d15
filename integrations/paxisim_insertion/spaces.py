"""Spaces of the tasks' observations and actions."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

import paxisim

from .poses import PRIVILEGED
from .tasks import Task

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
