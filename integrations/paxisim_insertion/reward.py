"""The four reward terms of the paper (appendix, "Simulation Reward"), of a state and nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import keypoints
from .tasks import Parameters, Task

WEIGHTS = {"reach": 1.0, "engage": 50.0, "success": 200.0, "action": 0.1}
"""The paper's weights."""


@dataclass(frozen=True)
class Insertion:
    """How far a peg is in its hole; of a batch of pegs each value is an array of the batch's shape.

    Attributes:
        distance: d, the mean distance (m) of the peg's keypoints to where they are when it is inserted.
        height: h, the distance (m) of the middle of the peg's bottom from the bottom of the hole.
        engaged: Whether the middle of the peg's bottom is within the hole and below the base's upper face, and the peg
            upright enough to go further.
        success: Whether it is engaged and deep enough.
    """

    distance: Any
    height: Any
    engaged: Any
    success: Any


def insertion(
    task: Task, parameters: Parameters, position: NDArray[np.floating], rotation: NDArray[np.floating]
) -> Insertion:
    """The state of an insertion, or of a batch of them.

    A groove has no place along it: the peg is inserted wherever it is, so distance counts across it only.

    Args:
        task: The task.
        parameters: Its geometry.
        position: ``(..., 3)`` of the peg (m) in the base's frame.
        rotation: ``(..., 3, 3)`` of the peg in the base's frame.
    """
    points = keypoints(parameters)
    apart = points @ np.swapaxes(rotation, -1, -2) + position[..., None, :] - points
    across = np.array([task.hole != "groove along x", task.hole != "groove along y"])
    apart[..., :2] *= across
    height = position[..., 2]
    # a peg that is in the hole can be off by the clearance, and lean; beside the hole it is off by its own width
    largest = task.clearance / 2 + 0.1 * parameters.peg_size
    inside = np.all(np.abs(position[..., :2]) * across < largest, axis=-1)
    # a peg that turned between the fingers can be jammed in the hole's edge
    upright = rotation[..., 2, 2] > np.cos(parameters.engage_lean)
    engaged = inside & upright & (height < parameters.hole_depth - parameters.engage_depth)
    distance = np.sqrt(np.square(apart).sum(axis=-1)).mean(axis=-1)
    return Insertion(distance, height, engaged, engaged & (height < parameters.success_depth))


def reward_terms(state: Insertion, action: NDArray[np.floating], epsilon: float) -> dict[str, Any]:
    """The terms before weighting: ``reach``, ``engage``, ``success`` and ``action``, each a number or a batch's array.

    Args:
        state: The insertion after the step.
        action: ``(..., axes)`` the step's action, in [-1, 1].
        epsilon: Of the denominators.
    """
    height = np.maximum(state.height, 0.0)  # contacts give way by some hundredths of a millimetre
    return {
        "reach": 1.0 / (10 * state.distance + epsilon),
        "engage": state.engaged / (10 * height + epsilon),
        "success": state.success * 1.0,
        "action": -np.square(action).sum(axis=-1),
    }


def weighted(terms: dict[str, Any]) -> Any:
    """The reward: the weighted sum of the terms."""
    return sum(WEIGHTS[name] * value for name, value in terms.items())
