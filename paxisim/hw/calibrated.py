"""What a sensor needs of a calibration, whoever made it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class SensorCalibration(Protocol):
    """Makes newtons of the frames of a sensor that measures something else; `paxisim.Calibration` is one."""

    def check(self, shape: tuple[int, ...], unit: str) -> None:
        """Make sure that it fits frames of that shape, ``(pads, 3, rows, cols)``, and unit.

        Raises:
            InvalidValueError: It is of another sensor.
        """
        ...

    def to_force(self, channels: NDArray[np.floating]) -> NDArray[np.float32]:
        """Convert ``(pads, 3, rows, cols)`` channels to newtons, each by itself."""
        ...

    def total_force(self, channels: NDArray[np.floating]) -> NDArray[np.float32] | None:
        """``(pads, 3)`` newtons, each pad's total force; None where it does not say."""
        ...
