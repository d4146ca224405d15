"""Frame: one reading of a sensor's pads, in newtons or in another unit that it names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Frame:
    """One reading of all pads.

    Attributes:
        force: ``(pads, 3, rows, cols)`` float32, pad frames, in newtons as `TactileReadout.read` gives it in
            simulation, or in what `unit` says.
        time: When it was measured, as far as can be told (s, the host's monotonic clock): the arrival, freed of the
            jitter of port and scheduler by the board's steady rate, and dated back where it waited in the port,
            as while the system stopped this program. Never after `arrival`.
        arrival: When its last byte was read (s, the host's monotonic clock).
        sequence: Counts readings from 0; a gap says that so many were dropped.
        status: One error byte a pad, as the board reports it; 0 is good, `paxisim.logs.schemas.NO_TAXELS` no error.
        resultant: ``(pads, 3)`` float32 newtons, the total force that the board reports, which on real sensors is not
            the sum of the taxels; None where it reports none.
        unit: Unit of `force`: ``"N"``; ``"uT"`` (microtesla) or ``"counts"`` of a sensor that does not measure forces.
    """

    force: NDArray[np.float32]
    time: float
    arrival: float
    sequence: int
    status: tuple[int, ...]
    resultant: NDArray[np.float32] | None = None
    unit: str = "N"
