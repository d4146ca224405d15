"""Gap: differences between a real robot and the simulated one in measured poses and in the controller."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

import paxisim


@dataclass(frozen=True)
class Gap:
    """Ranges of robot errors, drawn for each episode of an evaluation and never seen in training.

    The paper blames the failures of a policy without touch on "pose tracking noise and OSC dynamics gap due to friction
    in physical motors" and gives no figures. The defaults are ours: a camera that locates the base's markers to about
    1.5 mm and a quarter of a degree, and an arm with up to four times the joint friction of robosuite's (0.1 N m each).

    Attributes:
        pose_offset: Largest error of p_t that is constant over the episode, along each axis (m) and about each (rad).
        pose_noise: Standard deviation of the errors of p_t from step to step (m, rad).
        stiffness: Smallest and largest factor of the controller's stiffness; its damping ratio is unchanged.
        friction: Smallest and largest factor of the joints' dry friction.

    Raises:
        InvalidValueError: A number is negative, or a range is not in order.
    """

    pose_offset: tuple[float, float] = (1.5e-3, 4e-3)
    pose_noise: tuple[float, float] = (0.3e-3, 1e-3)
    stiffness: tuple[float, float] = (0.7, 1.3)
    friction: tuple[float, float] = (1.0, 4.0)

    def __post_init__(self) -> None:
        """Check the values."""
        for item in fields(self):
            value = getattr(self, item.name)
            if len(value) != 2 or not all(0 <= number < float("inf") for number in value):
                raise paxisim.InvalidValueError(f"{item.name} must be two non-negative numbers, got {value}")
        for name in ("stiffness", "friction"):
            low, high = getattr(self, name)
            if low > high or low == 0:
                raise paxisim.InvalidValueError(f"{name} must be a positive minimum and maximum, got {low, high}")

    def draw(self, rng: np.random.Generator) -> DrawnGap:
        """Draw the gap of one episode."""
        spread = np.repeat(self.pose_offset, 3)
        return DrawnGap(
            rng.uniform(-spread, spread),
            np.repeat(self.pose_noise, 3),
            float(rng.uniform(*self.stiffness)),
            float(rng.uniform(*self.friction)),
        )


@dataclass(frozen=True, eq=False)
class DrawnGap:
    """The gap of one episode.

    Attributes:
        offset: ``(6,)`` constant error of p_t (m, rad).
        noise: ``(6,)`` standard deviation of the additional error of p_t at each step (m, rad).
        stiffness: Factor of the controller's stiffness.
        friction: Factor of the joints' dry friction.
    """

    offset: NDArray[np.floating]
    noise: NDArray[np.floating]
    stiffness: float
    friction: float

    def believed(self, pose: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
        """Return the pose ``(6,)`` (m, rad) that the robot measures for a true pose."""
        return (pose + self.offset + self.noise * rng.standard_normal(6)).astype(np.float32)
