"""Frame: one reading of a sensor's pads, in newtons or another stated unit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.logs.schemas import in_error


@dataclass(frozen=True, eq=False)
class Frame:
    """One reading of all pads.

    Attributes:
        force: ``(pads, 3, rows, cols)`` float32 in pad frames, in newtons like the output of `TactileReadout.read` in
            simulation, or in the unit given by `unit`.
        time: Estimated time of measurement (s, the host's monotonic clock): the arrival, with the jitter of port and
            scheduler removed by means of the board's steady rate, and moved back if the frame waited in the port, for
            example while the system suspended this program. Never after `arrival`.
        arrival: Time at which the last byte was read (s, the host's monotonic clock).
        sequence: Number of the reading, from 0; a gap is the number of dropped readings.
        status: One error byte per pad, as the board reports it; 0 means no error, and neither does
            `paxisim.logs.schemas.NO_TAXELS`. See `pads_in_error`.
        resultant: ``(pads, 3)`` float32 newtons, the total force that the board reports, which on real sensors is not
            the sum of the taxels; None if the board reports none.
        unit: Unit of `force`: ``"N"``, or ``"uT"`` (microtesla) or ``"counts"`` if the sensor does not measure force.
        time_error: Largest error (s) of `time`: how long this program was suspended, if the frame waited meanwhile; 0
            otherwise. On a machine that is not busy the error is far smaller, but that is not known.
    """

    force: NDArray[np.float32]
    time: float
    arrival: float
    sequence: int
    status: tuple[int, ...]
    resultant: NDArray[np.float32] | None = None
    unit: str = "N"
    time_error: float = 0.0

    @property
    def pads_in_error(self) -> list[int]:
        """Indices of the pads whose status marks their readings as invalid."""
        return in_error(self.status)
