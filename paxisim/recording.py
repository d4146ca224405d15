"""Recording: what a sensor measured beside what the simulation of the same motion says, on one clock."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.aligned import Aligned, CountsToForce, Method, episode_starts

# kept in fields of their own, so that a file holds each of them once
_FIELDS_NOT_METADATA = ("format", "layout", "pads", "time_zero_ns")


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Aligned arrays over one time axis.

    NaN in a tensor or a covariate marks what is not known at that time. So it is with the forces and the resultant of a
    pad that reported an error, or whose port had gone silent, when they were recorded.

    Attributes:
        time: ``(T,)`` float64 seconds; not decreasing within an episode. A recording that was loaded counts from its
            first sample, whose Unix time is ``metadata["start"]`` where it is known.
        measured: ``(T, pads, 3, rows, cols)`` float32 newtons, or None.
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
        put = object.__setattr__
        put(self, "time", _numbers("time", self.time, np.float64))
        if self.time.ndim != 1 or not len(self.time):
            raise InvalidValueError(f"time must be (T,) with at least one sample, got shape {self.time.shape}")
        for name in ("measured", "simulated"):
            if getattr(self, name) is not None:
                put(self, name, self._tensor(name, getattr(self, name)))
        shape = self.tensor.shape
        if self.measured is not None and self.simulated is not None and self.simulated.shape != shape:
            raise InvalidValueError(
                f"measured and simulated must have one shape, got {shape} and {self.simulated.shape}"
            )
        put(self, "layout", self._checked_layout(shape))
        put(self, "pads", self._checked_pads(shape[1]))
        put(self, "covariates", {name: self._covariate(name, value) for name, value in self.covariates.items()})
        put(self, "episode", self._checked_episode())
        self._check_order()
        taken = [name for name in _FIELDS_NOT_METADATA if name in self.metadata]
        if taken:
            raise InvalidValueError(f"metadata must not hold {taken[0]!r}, files keep that name for themselves")
        put(self, "metadata", dict(self.metadata))

    def _tensor(self, name: str, value: Any) -> NDArray[np.float32]:
        tensor = _numbers(name, value, np.float32)
        if tensor.ndim != 5 or tensor.shape[2] != 3 or 0 in tensor.shape:
            raise InvalidValueError(f"{name} must have shape (T, pads, 3, rows, cols), got {tensor.shape}")
        if len(tensor) != len(self.time):
            raise InvalidValueError(f"{name} has {len(tensor)} samples, time has {len(self.time)}")
        return tensor

    def _checked_layout(self, shape: tuple[int, ...]) -> TaxelLayout:
        rows, cols = shape[-2:]
        if self.layout is None:
            return TaxelLayout(rows, cols, (1e-3, 1e-3))
        if not isinstance(self.layout, TaxelLayout):
            raise InvalidValueError(f"layout must be a TaxelLayout, got {type(self.layout).__name__}")
        if (rows, cols) != (self.layout.rows, self.layout.cols):
            raise InvalidValueError(
                f"layout has {self.layout.rows}x{self.layout.cols} taxels, the tensors have {rows}x{cols}"
            )
        return self.layout

    def _checked_pads(self, count: int) -> tuple[str, ...]:
        if isinstance(self.pads, str):
            raise InvalidValueError(f"pads must be a sequence of names, got the string {self.pads!r}")
        pads = tuple(str(name) for name in self.pads) or tuple(f"pad{i}" for i in range(count))
        if len(pads) != count or len(set(pads)) != count:
            raise InvalidValueError(f"pads must be {count} different names, one for each pad, got {list(pads)}")
        return pads

    def _covariate(self, name: str, value: Any) -> NDArray[np.float64]:
        if not isinstance(name, str) or not name:
            raise InvalidValueError(f"covariates must have names, got {name!r}")
        covariate = _numbers(f"covariates[{name!r}]", value, np.float64)
        if covariate.ndim == 0 or len(covariate) != len(self.time) or not covariate.size:
            raise InvalidValueError(
                f"covariates[{name!r}] must be ({len(self.time)}, ...) as time has so many, got shape {covariate.shape}"
            )
        return covariate

    def _checked_episode(self) -> NDArray[np.int64]:
        if self.episode is None:
            return np.zeros(len(self.time), dtype=np.int64)
        episode = np.asarray(self.episode)
        if episode.shape != self.time.shape:
            raise InvalidValueError(f"episode must have shape {self.time.shape} as time has, got {episode.shape}")
        whole = _numbers("episode", episode, np.float64)
        if not np.all(np.isfinite(whole)) or np.any(whole != np.round(whole)):
            raise InvalidValueError("episode must hold whole numbers")
        return episode.astype(np.int64)

    def _check_order(self) -> None:
        if not np.all(np.isfinite(self.time)):
            raise InvalidValueError(f"time must be finite, sample {int(np.argmin(np.isfinite(self.time)))} is not")
        starts = self._starts()
        numbers, counts = np.unique(self.episode[starts], return_counts=True)
        if counts.max() > 1:
            number = numbers[counts.argmax()]
            raise InvalidValueError(f"the samples of an episode must be adjacent, those of episode {number} are not")
        back = np.diff(self.time) < 0
        back[starts[1:] - 1] = False
        if back.any():
            at = int(back.argmax())
            raise InvalidValueError(
                f"time must not run back within an episode: sample {at + 1} is at {self.time[at + 1]:.9g} s, "
                f"the one before at {self.time[at]:.9g} s"
            )

    def _starts(self) -> NDArray[np.intp]:
        """Index of the first sample of each episode."""
        return episode_starts(self.episode)

    @property
    def tensor(self) -> NDArray[np.float32]:
        """``(T, pads, 3, rows, cols)``: `measured`, or `simulated` where nothing was measured."""
        tensor = self.measured if self.measured is not None else self.simulated
        if tensor is None:
            raise InvalidValueError("a recording needs a tensor: give measured, simulated or both")
        return tensor

    @property
    def rate(self) -> float:
        """Samples a second: one over the median interval within the episodes; NaN where there is no interval."""
        intervals = np.diff(self.time)[np.diff(self.episode) == 0]
        intervals = intervals[intervals > 0]
        return float(1 / np.median(intervals)) if len(intervals) else float("nan")

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
            time = self.time[samples]
        except IndexError as error:
            raise InvalidValueError(f"no such samples in a recording of {len(self)}: {error}") from error
        if not len(time):
            raise InvalidValueError("no sample is left, a recording needs at least one")
        return Recording(
            time,
            None if self.measured is None else self.measured[samples],
            None if self.simulated is None else self.simulated[samples],
            {name: value[samples] for name, value in self.covariates.items()},
            self.episode[samples],
            self.layout,
            self.pads,
            self.metadata,
        )

    def episodes(self) -> Iterator[Recording]:
        """One recording for each episode, in order; nothing is copied."""
        starts = self._starts()
        for start, end in zip(starts, [*starts[1:], len(self)], strict=True):
            yield self[start:end]

    def select(self, episodes: Sequence[int]) -> Recording:
        """The samples of those episodes, in the order of the recording.

        Raises:
            InvalidValueError: There is no such episode.
        """
        numbers = self.episode[self._starts()]
        missing = [number for number in episodes if number not in numbers]
        if missing:
            known = ", ".join(str(number) for number in numbers)
            raise InvalidValueError(f"there is no episode {missing[0]} in the recording; its episodes are {known}")
        return self[np.isin(self.episode, np.asarray(episodes, dtype=np.int64))]

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
    ) -> Recording:
        """Read an MCAP, npz or CSV file and bring its streams onto one time axis, that of the measured tensors.

        An MCAP file is read as far as it is whole, so one that ends in a crash loads as well. Where it has no measured
        tensors, the simulated ones give the time axis. A stream that has these very times is taken as it is; any
        other is interpolated between its own neighbouring samples, never beyond its first and last.

        Args:
            path: The file: ``.mcap``, ``.npz``, or ``.csv`` as `paxisim.logs.csv` describes.
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

        Raises:
            InvalidValueError: Not such a file; no tensors in it; measured and simulated do not overlap in time.
            FileNotFoundError: There is no such file.
        """
        from paxisim.logs.load import load_aligned

        if missing not in ("nan", "drop"):
            raise InvalidValueError(f"missing must be 'nan' or 'drop', got {missing!r}")
        wanted = None if pads is None else _names(pads)
        found = load_aligned(Path(path), align=align, max_gap=max_gap, layout=layout, pads=wanted, profile=profile)
        try:
            whole = cls(**vars(found))
        except InvalidValueError as error:
            raise InvalidValueError(f"{path}: {error}") from error
        if wanted is None and missing == "nan":
            return whole
        chosen = whole.to_aligned() if wanted is None else whole.to_aligned().choose(wanted)
        return cls(**vars(chosen.known() if missing == "drop" else chosen))

    def save(self, path: str | Path) -> None:
        """Write an MCAP or npz file, by the suffix; an existing file is replaced, whole or not at all.

        `load` gives equal arrays back, the tensors to the bit and the time to 1 ns.

        Raises:
            InvalidValueError: Another suffix, no such folder, metadata that JSON cannot hold, an infinite value.
            OSError: The file cannot be written.
        """
        from paxisim.logs.load import save_aligned

        save_aligned(Path(path), self.to_aligned())

    def to_aligned(self) -> Aligned:
        """The bare arrays, as `paxisim.logs` takes them; nothing is copied."""
        return Aligned(
            self.time,
            self.measured,
            self.simulated,
            self.covariates,
            self.episode,
            self.layout,
            self.pads,
            self.metadata,
        )


def _names(pads: Iterable[str]) -> tuple[str, ...]:
    names = (pads,) if isinstance(pads, str) else tuple(pads)
    if not names or len(set(names)) < len(names):
        raise InvalidValueError(f"pads must name different pads, at least one, got {list(names)}")
    return names


def _numbers(name: str, value: Any, dtype: type) -> NDArray[Any]:
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "biuf":
            raise TypeError(f"dtype {array.dtype}")
        return np.ascontiguousarray(array, dtype=dtype) if array.ndim else array.astype(dtype)
    except (TypeError, ValueError) as error:
        raise InvalidValueError(f"{name} must be an array of numbers: {error}") from error
