"""The four reward terms of the paper (appendix, "Simulation Reward"), of a state and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .geometry import keypoints
from .tasks import Parameters, Task

WEIGHTS = {"reach": 1.0, "engage": 50.0, "success": 200.0, "action": 0.1}
"""The paper's weights."""


@dataclass(frozen=True)
class Insertion:
    """How far a peg is in its hole.

    Attributes:
        distance: d, the mean distance (m) of the peg's keypoints to where they are when it is inserted.
        height: h, the distance (m) of the middle of the peg's bottom from the bottom of the hole.
        engaged: Whether the middle of the peg's bottom is within the hole and below the base's upper face, and the peg
            upright enough to go further.
        success: Whether it is engaged and deep enough.
    """

    distance: float
    height: float
    engaged: bool
    success: bool


def insertion(
    task: Task, parameters: Parameters, position: NDArray[np.floating], rotation: NDArray[np.floating]
) -> Insertion:
    """The state of an insertion.

    A groove has no place along it: the peg is inserted wherever it is, so distance counts across it only.

    Args:
        task: The task.
        parameters: Its geometry.
        position: ``(3,)`` of the peg (m) in the base's frame.
        rotation: ``(3, 3)`` of the peg in the base's frame.
    """
    points = keypoints(parameters)
    apart = points @ rotation.T + position - points
    across = np.array([task.hole != "groove along x", task.hole != "groove along y"])
    apart[:, :2] *= across
    height = float(position[2])
    # a peg that is in the hole can be off by the clearance, and lean; beside the hole it is off by its own width
    inside = bool(np.all(np.abs(position[:2]) * across < task.clearance / 2 + 0.1 * parameters.peg_size))
    # a peg that turned between the fingers can be jammed in the hole's edge
    upright = bool(rotation[2, 2] > np.cos(parameters.engage_lean))
    engaged = inside and upright and height < parameters.hole_depth - parameters.engage_depth
    distance = float(np.linalg.norm(apart, axis=1).mean())
    return Insertion(distance, height, engaged, engaged and height < parameters.success_depth)


def reward_terms(state: Insertion, action: NDArray[np.floating], epsilon: float) -> dict[str, float]:
    """The terms before weighting: ``reach``, ``engage``, ``success`` and ``action``.

    Args:
        state: The insertion after the step.
        action: The step's action, in [-1, 1].
        epsilon: Of the denominators.
    """
    height = max(state.height, 0.0)  # contacts give way by some hundredths of a millimetre
    return {
        "reach": 1.0 / (10 * state.distance + epsilon),
        "engage": 1.0 / (10 * height + epsilon) if state.engaged else 0.0,
        "success": float(state.success),
        "action": -float(np.square(action).sum()),
    }


def weighted(terms: dict[str, float]) -> float:
    """The reward: the weighted sum of the terms."""
    return sum(WEIGHTS[name] * value for name, value in terms.items())
