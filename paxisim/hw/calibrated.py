"""Interface between a sensor and its calibration."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class SensorCalibration(Protocol):
    """Converts the frames of a sensor that does not measure force to newtons; `paxisim.Calibration` is one."""

    def check(self, shape: tuple[int, ...], unit: str) -> None:
        """Check that the calibration fits frames of this shape, ``(pads, 3, rows, cols)``, and unit.

        Raises:
            InvalidValueError: The calibration belongs to another sensor.
        """
        ...

    def to_force(self, channels: NDArray[np.floating]) -> NDArray[np.float32]:
        """Convert ``(pads, 3, rows, cols)`` channels to newtons, each channel on its own."""
        ...

    def total_force(self, channels: NDArray[np.floating]) -> NDArray[np.float32] | None:
        """Return the total force of each pad, ``(pads, 3)`` newtons; None if the calibration does not give it."""
        ...
