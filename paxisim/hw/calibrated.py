"""Interface between a sensor and its calibration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray


class SensorCalibration(Protocol):
    """Converts the frames of a sensor that does not measure force.

    `paxisim.Calibration` gives newtons, and `paxisim.Background` the sensor's unit without the field of the robot.
    """

    @property
    def covariates(self) -> tuple[str, ...]:
        """Names of the covariates whose present values `read` needs."""
        ...

    @property
    def unit(self) -> str:
        """Unit of the converted frames."""
        ...

    def check(self, shape: tuple[int, ...], unit: str) -> None:
        """Check that the calibration fits frames of this shape, ``(pads, 3, rows, cols)``, and unit.

        Raises:
            InvalidValueError: The calibration belongs to another sensor.
        """
        ...

    def read(
        self, channels: NDArray[np.floating], covariates: Mapping[str, ArrayLike]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """Convert ``(pads, 3, rows, cols)`` channels.

        Returns:
            The converted channels, and the total force of each pad, ``(pads, 3)`` newtons, or None if it is unknown.
        """
        ...
