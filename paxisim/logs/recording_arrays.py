"""RecordingArrays: the arrays of a recording over one time axis, as read from and written to files."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout

Method = Literal["linear", "nearest", "previous"]


@dataclass(frozen=True, eq=False)
class RecordingArrays:
    """Fields of `paxisim.Recording` before they are checked."""

    time: NDArray[np.float64]
    measured: NDArray[np.float32] | None = None
    simulated: NDArray[np.float32] | None = None
    covariates: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    episode: NDArray[np.int64] | None = None
    layout: TaxelLayout | None = None
    pads: tuple[str, ...] = ()
    metadata: Mapping[str, Any] = field(default_factory=dict)


def unit_of(metadata: Mapping[str, Any]) -> str:
    """Return the unit of the measured tensor: ``"N"`` unless the metadata name another."""
    return metadata.get("unit") or "N"


class CountsToForce(Protocol):
    """Interface for converting a board's raw counts; `paxisim.Profile` implements it."""

    @property
    def layout(self) -> TaxelLayout:
        """Taxel layout of the tensor that `to_force` returns."""
        ...

    @property
    def unit(self) -> str:
        """Unit of that tensor."""
        ...

    def to_force(self, counts: NDArray[np.int16]) -> NDArray[np.float32]:
        """Convert ``(..., N, 3)`` counts to ``(..., 3, rows, cols)`` values in `unit`."""
        ...


def episode_starts(episode: NDArray[np.integer]) -> NDArray[np.intp]:
    """Return the index of the first sample of each episode, given the episode number of each sample ``(T,)``."""
    return np.flatnonzero(np.diff(episode, prepend=episode[0] - 1))


def rate_of(time: NDArray[np.float64], episode: NDArray[np.integer]) -> float:
    """Return the sampling rate (Hz): one over the median interval within episodes; NaN if there is no interval."""
    intervals = np.diff(time)[np.diff(episode) == 0]
    intervals = intervals[intervals > 0]
    return float(1 / np.median(intervals)) if len(intervals) else float("nan")


def episode_spans(episode: NDArray[np.integer]) -> tuple[slice, ...]:
    """Return the slice of samples of each episode, given the episode number of each sample ``(T,)``."""
    edges = [*episode_starts(episode).tolist(), len(episode)]
    return tuple(slice(a, b) for a, b in itertools.pairwise(edges))
