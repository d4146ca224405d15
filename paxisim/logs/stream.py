"""Stream: the samples of one quantity, each with its own time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Stream:
    """What one source recorded, at its own rate.

    Attributes:
        nanoseconds: ``(T,)`` int64 nanoseconds since 1970-01-01 UTC, not decreasing.
        values: ``(T, ...)`` samples.
        sequence: ``(T,)`` int64, the device's count of its readings, where it was recorded; a gap says that so many
            are missing.
        errors: How many samples have a pad whose status was not good, where that was recorded; the values of that pad
            are NaN there.
    """

    nanoseconds: NDArray[np.int64]
    values: NDArray[Any]
    sequence: NDArray[np.int64] | None = None
    errors: int | None = None

    @property
    def time(self) -> NDArray[np.float64]:
        """``(T,)`` seconds since 1970-01-01 UTC; a float64 resolves 0.2 us there."""
        return self.nanoseconds * 1e-9


@dataclass(frozen=True, eq=False)
class Log:
    """All that a file holds, nothing resampled.

    Attributes:
        streams: By name: ``measured``, ``simulated`` ((T, pads, 3, rows, cols) newtons), ``episode`` ((T,) int, the
            episode that begins at that time), ``covariate/NAME`` (any numbers). Streams without samples are left out.
        metadata: The layout (`TaxelLayout.to_dict`), the pads' names, sensor, profile, versions, scene; what else was
            given.
        complete: False where the file ends abruptly, as after a crash, or a part of it is damaged; all that is whole
            was read.
    """

    streams: Mapping[str, Stream]
    metadata: Mapping[str, Any] = field(default_factory=dict)
    complete: bool = True
