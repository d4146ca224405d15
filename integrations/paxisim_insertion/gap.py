"""Gap: how a robot differs from the simulated one beside its sensor: in the poses it believes and in its controller."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

import paxisim


@dataclass(frozen=True)
class Gap:
    """What an evaluation draws anew for each episode, and no training sees.

    The paper blames the failures of a policy without touch on "pose tracking noise and OSC dynamics gap due to friction
    in physical motors", and gives no figures. These are ours: a camera that finds the base's markers to about 1.5 mm
    and a quarter of a degree, and an arm whose joints rub up to four times as much as robosuite's (0.1 N m each).

    Attributes:
        pose_offset: Largest error of p_t that stays for the episode, along each axis (m) and about each (rad).
        pose_noise: Standard deviation of p_t's errors from step to step (m, rad).
        stiffness: Least and most that the controller's stiffness is multiplied by; its damping ratio stays.
        friction: Least and most that the dry friction of the joints is multiplied by.

    Raises:
        InvalidValueError: A negative number, or a range that is not in order.
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
                raise paxisim.InvalidValueError(f"{item.name} must be two numbers that are not negative, got {value}")
        for name in ("stiffness", "friction"):
            low, high = getattr(self, name)
            if low > high or low == 0:
                raise paxisim.InvalidValueError(
                    f"{name} must be the least and the most, both positive, got {low, high}"
                )

    def draw(self, rng: np.random.Generator) -> DrawnGap:
        """The gap of one episode."""
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
        offset: ``(6,)`` what is added to p_t (m, rad).
        noise: ``(6,)`` standard deviation of what is added at each step besides.
        stiffness: Factor of the controller's stiffness.
        friction: Factor of the joints' dry friction.
    """

    offset: NDArray[np.floating]
    noise: NDArray[np.floating]
    stiffness: float
    friction: float

    def believed(self, pose: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
        """What is taken for a pose ``(6,)``."""
        return (pose + self.offset + self.noise * rng.standard_normal(6)).astype(np.float32)
