"""Recording: what a sensor measured beside what the simulation of the same motion says, on one clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim._renamed import warn_renamed
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.checks import check_fields
from paxisim.logs.concatenate import concatenate
from paxisim.logs.recording_arrays import CountsToForce, Method, RecordingArrays, episode_starts, rate_of, unit_of
from paxisim.logs.retime import at_rate, at_times_of
from paxisim.logs.select import select, take


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Aligned arrays over one time axis.

    NaN in a tensor or a covariate marks what is not known at that time. So it is with the forces and the resultant of a
    pad that reported an error, or whose port had gone silent, when they were recorded.

    Attributes:
        time: ``(T,)`` float64 seconds; not decreasing within an episode. A recording that was loaded counts from its
            first sample, whose Unix time is ``metadata["start"]`` where it is known.
        measured: ``(T, pads, 3, rows, cols)`` float32 newtons, or what `unit` says, or None.
        simulated: The same for the simulation, or None; one of the two must be there.
        covariates: ``(T, ...)`` float64 arrays by name: gripper opening (m), temperature (degC), motor current (A) ...
        episode: ``(T,)`` int, the number of the episode each sample belongs to; equal numbers are adjacent. Default:
            one episode, 0.
        layout: The pads' taxels. Default: a grid of the tensors' rows and columns with a pitch of 1 mm.
        pads: The pads' names; default ``("pad0", "pad1", ...)``.
        metadata: What else is known, as JSON can hold it: sensor, profile, versions; ``scene`` is the text of the
            scene's MJCF.

    Raises:
        InvalidValueError: Shapes that do not fit, no tensor or sample at all, a time that is not finite or runs back.
    """

    time: NDArray[np.float64]
    measured: NDArray[np.float32] | None = None
    simulated: NDArray[np.float32] | None = None
    covariates: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    episode: NDArray[np.int64] = field(default=None)  # type: ignore[assignment]
    layout: TaxelLayout = field(default=None)  # type: ignore[assignment]
    pads: tuple[str, ...] = ()
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Convert the arrays, check that they fit each other and fill in the defaults."""
        for name, value in vars(check_fields(self.to_arrays())).items():
            object.__setattr__(self, name, value)

    def _starts(self) -> NDArray[np.intp]:
        """Index of the first sample of each episode."""
        return episode_starts(self.episode)

    @property
    def tensor(self) -> NDArray[np.float32]:
        """``(T, pads, 3, rows, cols)``: `measured`, or `simulated` where nothing was measured."""
        return self.measured if self.measured is not None else self.simulated  # type: ignore[return-value]

    @property
    def unit(self) -> str:
        """Unit of `measured`, ``metadata["unit"]``: ``"N"`` unless it says otherwise, as ``"uT"`` or ``"counts"``."""
        return unit_of(self.metadata)

    @property
    def rate(self) -> float:
        """Samples a second: one over the median interval within the episodes; NaN where there is no interval."""
        return rate_of(self.time, self.episode)

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample, summed over the episodes."""
        starts = self._starts()
        ends = np.append(starts[1:], len(self)) - 1
        return float(np.sum(self.time[ends] - self.time[starts]))

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.time)

    def __repr__(self) -> str:
        """What it holds, in a line."""
        pads, episodes = len(self.pads), len(self._starts())
        streams = [name for name in ("measured", "simulated") if getattr(self, name) is not None]
        parts = [
            f"{pads} pad{'s' * (pads != 1)} of {self.layout.rows}x{self.layout.cols} taxels",
            f"{len(self)} sample{'s' * (len(self) != 1)}",
            f"{self.duration:.1f} s" + (f" at {self.rate:.1f} Hz" if np.isfinite(self.rate) else ""),
            f"{episodes} episode{'s' * (episodes != 1)}",
            *streams,
            *([] if self.unit == "N" else [f"in {self.unit}"]),
        ]
        if self.covariates:
            parts.append("covariates " + " ".join(self.covariates))
        return f"Recording({', '.join(parts)})"

    def __getitem__(self, samples: slice | NDArray[np.bool_] | NDArray[np.integer]) -> Recording:
        """The recording of those samples; a slice copies nothing.

        Raises:
            InvalidValueError: No sample is left, there are no such samples, or an index is not a slice or array.
        """
        if not isinstance(samples, slice):
            array: NDArray[Any] = np.asarray(samples)
            if array.ndim != 1 or array.dtype.kind not in "biu":
                raise InvalidValueError(
                    "a recording is indexed by a slice, a (T,) mask or an array of whole numbers; "
                    "for one sample write recording[i : i + 1]"
                )
            samples = array
        try:
            taken = take(self.to_arrays(), samples)
        except IndexError as error:
            raise InvalidValueError(f"no such samples in a recording of {len(self)}: {error}") from error
        if not len(taken.time):
            raise InvalidValueError("no sample is left, a recording needs at least one")
        return Recording(**vars(taken))

    def episodes(self) -> Iterator[Recording]:
        """One recording for each episode, in order; nothing is copied."""
        starts = self._starts()
        for start, end in zip(starts, [*starts[1:], len(self)], strict=True):
            yield self[start:end]

    def select(
        self,
        episodes: Iterable[int] | None = None,
        *,
        pads: str | Iterable[str] | None = None,
        covariates: str | Iterable[str] | None = None,
        known: bool = False,
    ) -> Recording:
        """A part of the recording: some of its episodes, pads or covariates.

        Args:
            episodes: Numbers of the episodes to keep; their order stays that of the recording. Default: all.
            pads: Names of the pads to keep, in this order. The covariate ``resultant`` follows them, where it has a
                row a pad. Default: all.
            covariates: Names of the covariates to keep; none, if it is empty. Default: all.
            known: Keep only the samples at which no tensor and no covariate that is kept has a NaN.

        Raises:
            InvalidValueError: There is no such episode, no pad is named, a pad is named twice, or no sample is left.
            UnknownNameError: There is no such pad or covariate.
        """
        return Recording(**vars(select(self.to_arrays(), episodes, pads, covariates, known)))

    def with_simulated(self, simulated: NDArray[np.floating], **metadata: Any) -> Recording:
        """The recording with another simulated tensor; nothing else is copied.

        Args:
            simulated: ``(T, pads, 3, rows, cols)`` newtons at the recording's times; NaN where it is not known.
            metadata: Entries added to the recording's metadata, as ``scene`` (the text of the MJCF that was simulated).

        Raises:
            InvalidValueError: It has another shape than `tensor`.
        """
        return replace(self, simulated=simulated, metadata={**self.metadata, **metadata})

    def with_covariate(
        self,
        name: str,
        values: ArrayLike,
        time: ArrayLike | None = None,
        *,
        align: Method = "linear",
        max_gap: float | None = None,
    ) -> Recording:
        """The recording with one more covariate, or with another in the place of the one of that name.

        Args:
            name: Its name.
            values: ``(T, ...)`` at the recording's times, or ``(S, ...)`` at `time`.
            time: ``(S,)`` seconds on the recording's clock, not decreasing. Unix times minus ``metadata["start"]`` are
                on that of a recording that was loaded from a live one.
            align: How values at other times are interpolated, as in `load`.
            max_gap: As in `load`. The covariate is NaN in longer gaps, before its first sample and after its last.

        Raises:
            InvalidValueError: Shapes that do not fit; a time that runs back or does not overlap with the recording's;
                `time` for a recording of several episodes whose clocks each start anew.
        """
        if time is not None:
            values = at_times_of(self.to_arrays(), name, values, time, align, max_gap)
        return replace(self, covariates={**self.covariates, name: values})

    def pool(self, rows: int, cols: int) -> Recording:
        """The recording of a coarser sensor, of which each taxel is a block of `rows` x `cols` taxels; forces add up.

        Raises:
            InvalidValueError: The block does not divide the grid.
        """
        pooled = {
            name: self.layout.pool_force(value, rows, cols)
            for name, value in (("measured", self.measured), ("simulated", self.simulated))
            if value is not None
        }
        return replace(self, **pooled, layout=self.layout.pool(rows, cols))

    def resample(
        self, rate: float, *, align: Method | Mapping[str, Method] = "linear", max_gap: float | None = None
    ) -> Recording:
        """The recording at a steady rate; each episode begins at the time of its first sample.

        Values are taken between the neighbouring samples, not averaged: low-pass what holds faster changes first.

        Args:
            rate: Samples a second.
            align: How streams are interpolated: one method for all, or by name, as in `load`; here also
                ``"measured"``.
            max_gap: As in `load`.

        Raises:
            InvalidValueError: A rate that is not above 0, or no such method.
            UnknownNameError: `align` names a stream that is not there.
        """
        return Recording(**vars(at_rate(self.to_arrays(), rate, align, max_gap)))

    @classmethod
    def concatenate(cls, recordings: Iterable[Recording]) -> Recording:
        """One recording of all episodes, in order; each keeps its own clock.

        Episodes keep their numbers where those differ, and are counted from 0 otherwise. The metadata is what all
        recordings share, with the ``start`` of the first.

        Args:
            recordings: At least one; with the same layout, pads, tensors and covariates.

        Raises:
            InvalidValueError: There is none, or they differ; the message says in what.
        """
        parts = [part.to_arrays() for part in recordings]
        if not parts:
            raise InvalidValueError("there is nothing to concatenate: expected at least one recording")
        return cls(**vars(concatenate(parts)))

    @classmethod
    def load(
        cls,
        path: str | Path,
        *,
        align: Method | Mapping[str, Method] = "linear",
        max_gap: float | None = None,
        missing: Literal["nan", "drop"] = "nan",
        layout: TaxelLayout | None = None,
        pads: Iterable[str] | None = None,
        profile: CountsToForce | None = None,
        streams: str | Path | Iterable[str | Path] = (),
    ) -> Recording:
        """Read a file and bring its streams onto one time axis, that of the measured tensors.

        An MCAP file is read as far as it is whole, so one that ends in a crash loads as well. Where it has no measured
        tensors, the simulated ones give the time axis. A stream that has these very times is taken as it is; any
        other is interpolated between its own neighbouring samples, never beyond its first and last.

        Args:
            path: The file: ``.mcap``, ``.npz``, ``.csv`` (`paxisim.logs.csv`), ``.parquet`` (`paxisim.logs.parquet`) or
                ``.hdf5`` of robosuite or robomimic (`paxisim.logs.hdf5`); or the folder of a LeRobotDataset
                (`paxisim.logs.lerobot_reader`).
            align: How streams at other times are interpolated: ``"linear"``, ``"nearest"`` or ``"previous"`` (the last
                value holds, as a command does); for all of them, or by name (``"simulated"`` or a covariate's name).
            max_gap: Where the neighbouring samples of a stream are further apart than this (s), it is not known.
                Default: five times the stream's own median interval; where its samples come many at once, as from a
                program that buffers its output, five times that between the bursts, with a warning.
            missing: What happens to samples at which a stream is not known: ``"nan"`` marks them, ``"drop"`` leaves
                out the samples at which any tensor or covariate has a NaN.
            layout: The pads' taxels, instead of what the file says. A CSV from a board does not say it: by default its
                taxels are then one row in the order of the file.
            pads: Only these pads, in this order, by their names in the file.
            profile: How counts in a board's CSV become newtons, as `paxisim.hw.profile.load_profile` gives it; the
                default is 0.1 N a count with no axis turned. Says the layout as well.
            streams: Files whose streams of numbers, such as joint positions, are added as covariates: MCAP of ROS 2 or
                with JSON (`paxisim.logs.mcap_joints`), CSV, Parquet, HDF5, LeRobotDataset. `paxisim.logs.add_streams`
                says how their time and the recording's belong together.

        Raises:
            InvalidValueError: Not such a file; no tensors in it; measured and simulated, or the recording and a file of
                `streams`, do not overlap in time.
            MissingExtraError: What reads such a file is not installed.
            FileNotFoundError: There is no such file.
        """
        from paxisim.logs.load import load_arrays

        if missing not in ("nan", "drop"):
            raise InvalidValueError(f"missing must be 'nan' or 'drop', got {missing!r}")
        wanted = None if pads is None else (pads,) if isinstance(pads, str) else tuple(pads)
        others = [streams] if isinstance(streams, (str, Path)) else streams
        found = load_arrays(
            Path(path),
            align=align,
            max_gap=max_gap,
            layout=layout,
            pads=wanted,
            profile=profile,
            streams=[Path(other) for other in others],
        )
        try:
            whole = cls(**vars(found))
        except InvalidValueError as error:
            raise InvalidValueError(f"{path}: {error}") from error
        return whole.select(pads=wanted, known=missing == "drop")

    def save(self, path: str | Path) -> None:
        """Write an MCAP or npz file, by the suffix; an existing file is replaced, whole or not at all.

        `load` gives equal arrays back, the tensors to the bit and the time to 1 ns.

        Raises:
            InvalidValueError: Another suffix, no such folder, metadata that JSON cannot hold, an infinite value.
            OSError: The file cannot be written.
        """
        from paxisim.logs.load import save_arrays

        save_arrays(Path(path), self.to_arrays())

    def to_arrays(self) -> RecordingArrays:
        """The bare arrays, as `paxisim.logs` takes them; nothing is copied."""
        return RecordingArrays(**vars(self))

    def to_aligned(self) -> RecordingArrays:
        """Old name of `to_arrays`."""
        warn_renamed("Recording.to_aligned", "Recording.to_arrays")
        return self.to_arrays()
