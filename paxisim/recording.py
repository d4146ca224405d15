"""Recording: measured and simulated tactile data of the same motion, on one clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

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

    NaN in a tensor or a covariate marks an unknown value. Examples are the forces and the resultant of a pad that
    reported an error, or whose port had stopped responding, during recording.

    Attributes:
        time: ``(T,)`` float64 times (s), not decreasing within an episode. In a loaded recording, time counts from the
            first sample, whose Unix time is ``metadata["start"]`` if known.
        measured: ``(T, pads, 3, rows, cols)`` float32 measured tensor, in newtons or in `unit`, or None.
        simulated: Simulated tensor of the same form, or None; at least one of the two is required.
        covariates: ``(T, ...)`` float64 arrays by name: gripper opening (m), temperature (degC), motor current (A) ...
        episode: ``(T,)`` int episode number of each sample; equal numbers are adjacent. Default: one episode, 0.
        layout: Layout of the pads' taxels. Default: a grid of the tensors' rows and columns, whose pitch is unknown
            (`TaxelLayout.pitch_known`) and taken as 1 mm.
        pads: Names of the pads. Default: ``("pad0", "pad1", ...)``.
        metadata: Further JSON-compatible information: sensor, profile, versions; ``scene`` is the text of the scene's
            MJCF.

    Raises:
        InvalidValueError: Shapes do not fit, there is no tensor or no sample, or time is not finite or runs backwards.
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
        """Convert the arrays, check that they are consistent and fill in the defaults."""
        for name, value in vars(check_fields(self.to_arrays())).items():
            object.__setattr__(self, name, value)

    def _starts(self) -> NDArray[np.intp]:
        """Index of the first sample of each episode."""
        return episode_starts(self.episode)

    @property
    def tensor(self) -> NDArray[np.float32]:
        """Tensor ``(T, pads, 3, rows, cols)``: `measured`, or `simulated` if `measured` is None."""
        return self.measured if self.measured is not None else self.simulated  # type: ignore[return-value]

    @property
    def unit(self) -> str:
        """Unit of `measured` from ``metadata["unit"]``, e.g. ``"uT"`` or ``"counts"``; ``"N"`` by default."""
        return unit_of(self.metadata)

    @property
    def rate(self) -> float:
        """Sampling rate (Hz): the inverse of the median interval within the episodes; NaN without an interval."""
        return rate_of(self.time, self.episode)

    @property
    def duration(self) -> float:
        """Duration (s) from the first to the last sample, summed over the episodes."""
        starts = self._starts()
        ends = np.append(starts[1:], len(self)) - 1
        return float(np.sum(self.time[ends] - self.time[starts]))

    @property
    def elapsed(self) -> NDArray[np.float64]:
        """``(T,)`` seconds since the first sample; an episode whose clock restarts follows the one before."""
        steps = np.diff(self.time, prepend=self.time[0])
        return np.cumsum(np.where(steps < 0, 1 / self.rate if np.isfinite(self.rate) else 0.0, steps))

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.time)

    def __repr__(self) -> str:
        """One-line summary."""
        pads, episodes = len(self.pads), len(self._starts())
        streams = [name for name in ("measured", "simulated") if getattr(self, name) is not None]
        parts = [
            f"{pads} pad{'s' * (pads != 1)} of {self.layout.rows}x{self.layout.cols} taxels"
            + " (pitch unknown)" * (not self.layout.pitch_known),
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
        """Return the recording of some samples; a slice does not copy.

        Raises:
            InvalidValueError: No sample is left, samples do not exist, or the index is neither a slice nor an array.
        """
        if not isinstance(samples, slice):
            array: NDArray[Any] = np.asarray(samples)
            if array.ndim != 1 or array.dtype.kind not in "biu":
                raise InvalidValueError(
                    "index a recording by a slice, a (T,) mask or an array of whole numbers; "
                    "for one sample use recording[i : i + 1]"
                )
            samples = array
        try:
            taken = take(self.to_arrays(), samples)
        except IndexError as error:
            raise InvalidValueError(f"no such samples in a recording of {len(self)}: {error}") from error
        if not len(taken.time):
            raise InvalidValueError("no sample is left: a recording needs at least one")
        return Recording(**vars(taken))

    def episodes(self) -> Iterator[Recording]:
        """Iterate over the episodes in order, each as a recording, without copying."""
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
        """Return a part of the recording: some of its episodes, pads or covariates.

        Args:
            episodes: Numbers of the episodes to keep, in the order of the recording. Default: all.
            pads: Names of the pads to keep, in the given order. The covariate ``resultant`` is selected likewise if it
                has one row per pad. Default: all.
            covariates: Names of the covariates to keep; an empty iterable keeps none. Default: all.
            known: Whether to keep only samples without a NaN in any kept tensor or covariate.

        Raises:
            InvalidValueError: There is no such episode, no pad is named, a pad is named twice, or no sample is left.
            UnknownNameError: There is no such pad or covariate.
        """
        return Recording(**vars(select(self.to_arrays(), episodes, pads, covariates, known)))

    def with_simulated(self, simulated: NDArray[np.floating], **metadata: Any) -> Recording:
        """Return the recording with another simulated tensor; nothing else is copied.

        Args:
            simulated: ``(T, pads, 3, rows, cols)`` forces (N) at the recording's times; NaN where unknown.
            metadata: Entries to add to the recording's metadata, e.g. ``scene`` (the text of the simulated MJCF).

        Raises:
            InvalidValueError: The shape differs from that of `tensor`.
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
        """Return the recording with a covariate added, or replaced if the name exists.

        Args:
            name: Name of the covariate.
            values: ``(T, ...)`` values at the recording's times, or ``(S, ...)`` at `time`.
            time: ``(S,)`` times (s) on the recording's clock, not decreasing. For a loaded live recording, these are
                Unix times minus ``metadata["start"]``.
            align: How values at other times are interpolated, as in `load`.
            max_gap: As in `load`. The covariate is NaN in longer gaps, before its first sample and after its last.

        Raises:
            InvalidValueError: Shapes do not fit; `time` runs backwards or does not overlap with the recording's; or
                `time` is given for a recording of several episodes whose clocks each restart; or the name is that of a
                tensor.
        """
        if name in ("measured", "simulated"):
            raise InvalidValueError(
                f"{name!r} is a tensor, not a covariate: use dataclasses.replace(recording, {name}=...)"
            )
        if time is not None:
            values = at_times_of(self.to_arrays(), name, values, time, align, max_gap)
        return replace(self, covariates={**self.covariates, name: values})

    def pool(self, rows: int, cols: int) -> Recording:
        """Return the recording of a coarser sensor, which sums the forces of each block of `rows` x `cols` taxels.

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
        """Return the recording at a constant rate; each episode begins at the time of its first sample.

        Values are interpolated between neighbouring samples, not averaged: low-pass filter fast streams first.

        Args:
            rate: Sampling rate (Hz).
            align: How streams are interpolated: one method for all, or one by stream name, as in `load`; here the
                names include ``"measured"``.
            max_gap: As in `load`.

        Raises:
            InvalidValueError: The rate is not above 0, or there is no such method.
            UnknownNameError: `align` names a stream that does not exist.
        """
        return Recording(**vars(at_rate(self.to_arrays(), rate, align, max_gap)))

    @classmethod
    def concatenate(cls, recordings: Iterable[Recording]) -> Recording:
        """Concatenate the episodes of several recordings, in order.

        Episodes keep their numbers if these are unique, and are renumbered from 0 otherwise, with the tasks and other
        metadata that belong to them. If every recording has a ``start``, all times count from that of the first;
        otherwise each keeps its own clock, and the result has no ``start``. Of the other metadata, the entries that
        all recordings share are kept.

        Args:
            recordings: At least one recording; all with the same layout, pads, tensors and covariates.

        Raises:
            InvalidValueError: There is no recording, or they differ; the message says how.
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
        axes: Mapping[str, str] | None = None,
        topics: str | Iterable[str] = (),
        names: Mapping[str, str] | None = None,
        rate: float | None = None,
        start: str | None = None,
        streams: str | Path | Iterable[str | Path] = (),
    ) -> Recording:
        """Read a file and align its streams to one time axis, that of the measured tensors.

        An MCAP file is read as far as it is intact, so a file truncated by a crash still loads. If it has no measured
        tensors, the simulated ones give the time axis. A stream with exactly these times is used unchanged; any other
        is interpolated between its own neighbouring samples, never beyond its first and last.

        Args:
            path: File to read: ``.mcap``, ``.npz``, ``.csv`` (`paxisim.logs.csv`), ``.txt`` of AnySkin
                (`paxisim.logs.anyskin`), eFlesh's ``sensor.csv`` (`paxisim.logs.eflesh`), ``.parquet``
                (`paxisim.logs.parquet`) or ``.hdf5`` of robosuite, robomimic (`paxisim.logs.hdf5`) or
                ACT (`paxisim.logs.hdf5_act`); ``.bag``,
                ``.db3``, ``.mcap`` or the folder of a bag of ROS (`paxisim.logs.ros_tactile`); or the folder of a
                LeRobotDataset (`paxisim.logs.lerobot_reader`).
            align: How streams at other times are interpolated: ``"linear"``, ``"nearest"`` or ``"previous"`` (the last
                value is held, as for a command); one method for all, or one by name (``"simulated"`` or a covariate's
                name).
            max_gap: Longest gap (s) between neighbouring samples of a stream that is interpolated; values in longer
                gaps are unknown. Default: five times the stream's median interval. If the samples arrive in bursts, as
                from a program that buffers its output, five times the interval between bursts, with a warning.
            missing: How to treat unknown values: ``"nan"`` marks them, ``"drop"`` removes the samples at which any
                tensor or covariate has a NaN.
            layout: Layout of the pads' taxels, instead of that of the file. A CSV from a board contains no layout, nor
                does a LeRobotDataset; by default, taxels without rows and columns form one row in the order of the
                file.
            pads: Names of the pads to keep, as used in the file and in this order. Default: all.
            profile: Conversion of the counts in a board's CSV to newtons, from `paxisim.load_profile`. It
                also gives the layout. Default: 0.1 N per count, without changing any axis.
            axes: Axes of features of a LeRobotDataset or of arrays in a bag of ROS, HDF5 or npz, by name: the words
                ``rows,cols`` or ``taxels``, with ``xyz`` and ``pads`` if the array has them, in its order, e.g.
                ``{"observation.touch": "rows,cols,xyz"}``. Needed where names and shape do not tell them, and to read a
                feature as pads without "tactile" in its name. See `paxisim.logs.lerobot_pads`.
            topics: Tactile topics of a bag of ROS, where they cannot be recognised (`paxisim.logs.ros_tactile`). All
                other numeric topics become covariates.
            names: Keys of an npz archive of another program, by what they are here: ``"time"``, ``"measured"``,
                ``"simulated"``, ``"episode"`` or the name of a covariate, e.g. ``{"measured": "tactile"}``.
            rate: Samples per second, for a file that has no times.
            start: Date and time of the first sample (ISO 8601, such as ``"2026-10-04T23:15:05+02:00"``), for a file
                that does not state it, so that `streams` with absolute times can be added. Without a time zone, it is
                the local time of this computer.
            streams: Files whose numeric streams, such as joint positions, are added as covariates: bags of ROS
                (`paxisim.logs.ros_bags`), MCAP of ROS 2 or with JSON (`paxisim.logs.mcap_topics`), CSV, Parquet, HDF5,
                LeRobotDataset. `paxisim.logs.add_streams` describes how their time is aligned with the recording's.

        Raises:
            InvalidValueError: The file has another format or no tensors; or the axes of a feature cannot be told; or
                measured and simulated, or the recording and a file of `streams`, do not overlap in time.
            UnknownNameError: `pads` or `axes` name a pad or a feature that does not exist.
            MissingExtraError: The package that reads this format is not installed.
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
            axes=axes,
            topics=(topics,) if isinstance(topics, str) else tuple(topics),
            names=names,
            rate=rate,
            start=start,
            streams=[Path(other) for other in others],
        )
        try:
            whole = cls(**vars(found))
        except InvalidValueError as error:
            raise InvalidValueError(f"{path}: {error}") from error
        return whole.select(pads=wanted, known=missing == "drop")

    def save(self, path: str | Path) -> None:
        """Write an MCAP or npz file, depending on the suffix; an existing file is replaced atomically.

        `load` restores equal arrays, the tensors bit for bit and the time to 1 ns.

        Raises:
            InvalidValueError: The suffix is another, the folder does not exist, the metadata is not JSON-compatible,
                or a value is infinite.
            OSError: The file cannot be written.
        """
        from paxisim.logs.load import save_arrays

        save_arrays(Path(path), self.to_arrays())

    def to_arrays(self) -> RecordingArrays:
        """Return the plain arrays in the form that `paxisim.logs` uses, without copying."""
        return RecordingArrays(**vars(self))
