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
        time: ``(T,)`` float64 seconds since 1970-01-01 UTC, not decreasing.
        values: ``(T, ...)`` samples.
    """

    time: NDArray[np.float64]
    values: NDArray[Any]


@dataclass(frozen=True, eq=False)
class Log:
    """All that a file holds, nothing resampled.

    Attributes:
        streams: By name: ``measured``, ``simulated`` ((T, pads, 3, rows, cols) newtons), ``episode`` ((T,) int, the
            episode that begins at that time), ``covariate/NAME`` (any numbers).
        metadata: The layout (`TaxelLayout.to_dict`), the pads' names, sensor, profile, versions; what else was given.
        complete: False where the file ends abruptly, as after a crash, and all that was whole was read.
    """

    streams: Mapping[str, Stream]
    metadata: Mapping[str, Any] = field(default_factory=dict)
    complete: bool = True
