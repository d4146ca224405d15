"""A scripted expert that sees the poses; it shows that a task can be solved with gentle motions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .env import InsertionEnv

_GAIN = 0.7  # distance, in action scales, that gives an action of 1; the controller then closes it within 0.25 s
_DOWN = 0.35  # fraction of the largest action: it pushes with a few newtons, which the grip withstands


def expert_action(env: InsertionEnv) -> NDArray[np.float32]:
    """Return the action that centres the peg above the hole or, once it is centred, moves it straight down."""
    task, parameters = env.task, env.parameters
    position, rotation = env.scene.peg
    # a leaning peg is centred by the middle of the section that goes into the hole
    apart = position + rotation @ [0, 0, parameters.hole_depth / 2] - env.scene.hole_top
    move = np.array([-apart[0], -apart[1], 0.0]) / (_GAIN * task.action_scale)
    if task.hole == "groove along x":
        move[0] = 0.0
    if task.hole == "groove along y":
        move[1] = 0.0
    across = float(np.linalg.norm(move[:2])) * _GAIN * task.action_scale
    height = position[2] - env.scene.hole_top[2]
    if across < task.clearance / 4 or height < 0:
        move[2] = -_DOWN * 10e-3 / task.action_scale
    elif height < 3e-3:
        move[2] = 0.3
    return np.clip(move, -1, 1)[list(task.axes)].astype(np.float32)
