"""The four reward terms of the paper (appendix, "Simulation Reward"), as functions of a state."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import library_of, like
from .geometry import keypoints
from .tasks import Parameters, Task

WEIGHTS = {"reach": 1.0, "engage": 50.0, "success": 200.0, "action": 0.1}
"""The paper's weights."""


@dataclass(frozen=True)
class Insertion:
    """Progress of an insertion; for a batch of pegs each value is an array of the batch's shape.

    Attributes:
        distance: d, the mean distance (m) of the peg's keypoints from their positions in an inserted peg.
        height: h, the height (m) of the middle of the peg's bottom above the bottom of the hole.
        engaged: Whether the middle of the peg's bottom is within the hole and below the base's upper face, and the peg
            is upright enough to go further.
        success: Whether the peg is engaged and deep enough.
    """

    distance: Any
    height: Any
    engaged: Any
    success: Any


def insertion(task: Task, parameters: Parameters, position: Any, rotation: Any) -> Insertion:
    """Compute the state of one or more insertions, from arrays of numpy or torch.

    The position along a groove does not matter, so only the distance across it counts.

    Args:
        task: The task.
        parameters: Geometry of the task.
        position: ``(..., 3)`` position of the peg (m) in the base's frame.
        rotation: ``(..., 3, 3)`` rotation of the peg in the base's frame.
    """
    xp = library_of(position)
    points = like(keypoints(parameters), position)
    across = like([task.hole != "groove along x", task.hole != "groove along y", True], position)
    apart = (points @ xp.matrix_transpose(rotation) + position[..., None, :] - points) * across
    height = position[..., 2]
    # inside the hole a peg is off by at most half the clearance and its lean; beside the hole, by its width
    largest = task.clearance / 2 + 0.1 * parameters.peg_size
    inside = xp.all(xp.abs(position[..., :2]) * across[:2] < largest, axis=-1)
    # a peg that rotates between the fingers can jam in the hole's edge
    upright = rotation[..., 2, 2] > np.cos(parameters.engage_lean)
    engaged = inside & upright & (height < parameters.hole_depth - parameters.engage_depth)
    distance = xp.mean(xp.sqrt(xp.sum(apart * apart, axis=-1)), axis=-1)
    return Insertion(distance, height, engaged, engaged & (height < parameters.success_depth))


def reward_terms(state: Insertion, action: Any, epsilon: float) -> dict[str, Any]:
    """Compute the unweighted terms ``reach``, ``engage``, ``success`` and ``action``, each a number or an array.

    Args:
        state: The insertion after the step.
        action: ``(..., axes)`` action of the step, in [-1, 1].
        epsilon: Constant added to the denominators.
    """
    height = state.height.clip(min=0.0)  # contacts are soft: the peg sinks in by a few hundredths of a millimetre
    return {
        "reach": 1.0 / (10 * state.distance + epsilon),
        "engage": state.engaged / (10 * height + epsilon),
        "success": state.success * 1.0,
        "action": -(action * action).sum(axis=-1),
    }


def weighted(terms: dict[str, Any]) -> Any:
    """Return the reward, the weighted sum of the terms."""
    return sum(WEIGHTS[name] * value for name, value in terms.items())
