"""Recording: what a sensor measured beside what the simulation of the same motion says, on one clock."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout


@dataclass(frozen=True, eq=False)
class Recording:
    """Aligned arrays over one time axis.

    Attributes:
        time: ``(T,)`` float64 seconds; increasing within an episode.
        measured: ``(T, pads, 3, rows, cols)`` float32 newtons, or None.
        simulated: The same for the simulation, or None; one of the two must be there.
        covariates: ``(T, ...)`` float64 arrays by name: gripper opening (m), temperature (degC), motor current (A) ...
        episode: ``(T,)`` int, the number of the episode each sample belongs to; equal numbers are adjacent.
        layout: The pads' taxels. Default: a grid of the tensors' rows and columns with a pitch of 1 mm.
        pads: The pads' names; default ``("pad0", "pad1", ...)``.
        metadata: What else is known: sensor, profile, scene, versions.

    Raises:
        InvalidValueError: Shapes that do not fit, no tensor at all, a time that is not finite or runs back.
    """

    time: NDArray[np.float64]
    measured: NDArray[np.float32] | None = None
    simulated: NDArray[np.float32] | None = None
    covariates: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    episode: NDArray[np.int64] = field(default=None)  # type: ignore[assignment]
    layout: TaxelLayout = field(default=None)  # type: ignore[assignment]
    pads: tuple[str, ...] = ()
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of samples."""
        raise NotImplementedError

    def __getitem__(self, samples: slice | NDArray[np.bool_] | NDArray[np.integer]) -> Recording:
        """The recording of those samples."""
        raise NotImplementedError

    def episodes(self) -> Iterator[Recording]:
        """One recording for each episode, in order."""
        raise NotImplementedError

    def select(self, episodes: Sequence[int]) -> Recording:
        """The samples of those episodes, in the order of the recording."""
        raise NotImplementedError

    @classmethod
    def load(cls, path: str | Path, **options: Any) -> Recording:
        """Read an MCAP, npz or CSV file and bring its streams onto one time axis."""
        raise NotImplementedError

    def save(self, path: str | Path) -> None:
        """Write an MCAP or npz file, by the suffix."""
        raise NotImplementedError
