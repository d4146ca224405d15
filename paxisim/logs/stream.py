"""Stream: the samples of one quantity, each with its own time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Stream:
    """Samples recorded from one source at its own rate.

    Attributes:
        nanoseconds: ``(T,)`` int64 nanoseconds since 1970-01-01 UTC, not decreasing.
        values: ``(T, ...)`` samples.
        sequence: ``(T,)`` int64 reading counter of the device, if recorded; it skips the numbers of missing readings.
        errors: Number of samples with a pad in an error status, if recorded; that pad's values are NaN there.
    """

    nanoseconds: NDArray[np.int64]
    values: NDArray[Any]
    sequence: NDArray[np.int64] | None = None
    errors: int | None = None

    @property
    def time(self) -> NDArray[np.float64]:
        """Times ``(T,)`` in seconds since 1970-01-01 UTC, as float64 with a resolution of 0.2 us."""
        return self.nanoseconds * 1e-9


@dataclass(frozen=True, eq=False)
class Log:
    """Complete contents of a file, without resampling.

    Attributes:
        streams: Streams by name: ``measured``, ``simulated`` ((T, pads, 3, rows, cols) newtons), ``episode`` ((T,) int,
            the episode that begins at that time), ``covariate/NAME`` (any numbers). Streams without samples are
            omitted.
        metadata: The layout (`TaxelLayout.to_dict`), the pads' names, sensor, profile, versions, scene, and any other
            given entries.
        complete: False if the file ends abruptly, as after a crash, or a part of it is damaged; the intact part was
            read.
    """

    streams: Mapping[str, Stream]
    metadata: Mapping[str, Any] = field(default_factory=dict)
    complete: bool = True
