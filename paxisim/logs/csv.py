"""CSV recordings: files written by a board's own recorders, and plain tables.

There are three kinds, recognised by their columns. In the first two, every number is a raw count of 0.1 N from the
board: signed for x and y, unsigned for z. An empty cell is unknown and becomes NaN.

- **Host program** (one row per frame): ``Timestamp`` is the time of day, ``HH:MM:SS.mmm``; ``F-M-NxN-X[i]`` (and Y, Z)
  is taxel ``i`` of module ``M`` (0 proximal, 1 middle, 2 tip, 3 nail; 0 to 7 on the palm) of finger ``F`` (0 thumb to
  4 little, 5 palm); ``F-M-1x1-X`` is the module's resultant. A pad is named ``F-M``. The date is in the file's name,
  such as ``2026-10-04-231505.csv``, in the local time of the computer: it gives ``metadata["start"]``.
- **paxini-sdk, "native"**: an optional first line ``# {JSON}`` describes firmware and modules. The columns are
  ``timestamp_iso`` (local time), ``timestamp_monotonic_s`` (s), ``PAD_ptNNN_fx_lsb`` (and fy, fz), and
  ``PAD_resultant_fx_lsb``. Pads have names such as ``index_tip``.
- **Plain**: newtons, with the columns of `paxisim.logs.columns`. `csv_writer` adds a first line ``# {JSON}`` with all
  that columns cannot hold: layout, pads, unit, metadata and the shapes of covariates.

The resultants become the covariate ``resultant``, ``(T, pads, 3)`` newtons.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.logs.about import covariate_shapes, read_about
from paxisim.logs.clock import local_zone
from paxisim.logs.columns import from_columns, take_covariates
from paxisim.logs.csv_table import CsvTable, clipped
from paxisim.logs.recording_arrays import CountsToForce, RecordingArrays

DEFAULT_RESOLUTION = 0.1  # newtons per count
_COUNTS = np.iinfo(np.int16)
_DAY = 86400.0

# pad, taxel (None: the resultant), axis
_Column = tuple[str, "int | None", int]
_HOST = re.compile(r"(\d+-\d+)-(?:1x1-([XYZ])|NxN-([XYZ])\[(\d{1,9})\])")
_TIME_OF_DAY = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:\.\d*)?)")
_NAME = re.compile(r"(\d{4})-(\d\d)-(\d\d)-(\d\d)(\d\d)(\d\d)")
_FARTHEST = timedelta(hours=1)  # of the first row from the time in the file's name
_NATIVE = re.compile(r"(.+)_(?:resultant_f([xyz])|pt(\d{1,9})_f([xyz]))_lsb")


def read_csv(
    path: Path,
    layout: TaxelLayout | None = None,
    pads: tuple[str, ...] | None = None,
    profile: CountsToForce | None = None,
    start: float | None = None,
) -> tuple[RecordingArrays, bool]:
    """Read a CSV file of any of the three kinds.

    Args:
        path: The file.
        layout: Taxel layout of the pads; its ``vendor_order`` maps the file's taxels to the grid.
        pads: Names of the pads to read from a board's file, in this order. Needed if the hand's pads differ in their
            number of taxels, because a recording holds pads of one kind. Ignored for a plain table, which is read
            completely.
        profile: Conversion from counts to newtons, for a board's file.
        start: Unix time (s) of the first sample, instead of that in the name of the host program's file.

    Returns:
        The recording, and whether an incomplete last row was skipped.

    Raises:
        InvalidValueError: The file is of none of the three kinds, or a row is malformed; the message has its line.
        UnknownNameError: A pad does not exist.
    """
    table = CsvTable(path)
    for is_of, parse, read_time in (
        (_is_of_host, _host_column, _time_of_day),
        (lambda table: "timestamp_monotonic_s" in table.names, _native_column, _seconds),
    ):
        if is_of(table) and not table.is_ours:
            if table.last_may_be_cut and len(table.lines) > 1:
                table.lines.pop()  # recorders end each row with a newline, so the last number may be truncated
                table.is_cut = True
            time = read_time(table)
            found = _Board(table, parse).read(time, layout, pads, profile)
            if start is None and is_of is _is_of_host:
                found = replace(found, metadata={**found.metadata, **_start_from_name(path, float(time[0]))})
            return found, table.is_cut
    if profile is not None:
        raise InvalidValueError(f"profile is for the counts of a board's file; {path} is a plain table of newtons")
    columns = table.columns()
    known = take_covariates(columns, covariate_shapes(table.comment)) if table.is_ours else {}
    try:
        found = from_columns(columns)
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}: {error}") from error
    if table.is_ours:
        about = read_about(path, table.comment)
        about["layout"] = layout or about["layout"]
        return replace(found, **about, covariates={**found.covariates, **known}), table.is_cut
    return replace(found, layout=layout, metadata=table.comment), table.is_cut


class _Board:
    """A file of raw counts written by a board's recorder."""

    def __init__(self, table: CsvTable, parse: Callable[[str], _Column | None]) -> None:
        self.table, self.path = table, table.path
        self.columns = {column: name for name in table.names if (column := parse(name))}
        self.pads = list(dict.fromkeys(pad for pad, taxel, _ in self.columns if taxel is not None))
        if not self.pads:
            raise InvalidValueError(
                f"{self.path} has no taxels, only {', '.join(clipped(name) for name in table.names[:4])} ..."
            )

    def read(
        self,
        time: NDArray[np.float64],
        layout: TaxelLayout | None,
        pads: tuple[str, ...] | None,
        profile: CountsToForce | None,
    ) -> RecordingArrays:
        for pad in pads or ():
            if pad not in self.pads:
                raise UnknownNameError("pad", pad, self.pads)
        pads = tuple(self.pads) if pads is None else pads
        counts = {pad: len({taxel for p, taxel, _ in self.columns if p == pad and taxel is not None}) for pad in pads}
        if len(set(counts.values())) > 1:
            listed = ", ".join(f"{pad} has {count}" for pad, count in counts.items())
            raise InvalidValueError(
                f"a recording holds pads of one kind, but those of {self.path} differ in their taxels: {listed}; "
                "choose with pads=[...]"
            )
        taxels = counts[pads[0]]
        columns: list[_Column] = [(pad, taxel, axis) for pad in pads for taxel in range(taxels) for axis in range(3)]
        values = self._numbers(columns)
        self._check_counts(values, columns)
        values = values.reshape(-1, len(pads), taxels, 3)
        totals: list[_Column] = [(pad, None, axis) for pad in pads for axis in range(3)]
        resultant = None
        if all(column in self.columns for column in totals):
            resultant = self._numbers(totals).reshape(-1, len(pads), 3) * DEFAULT_RESOLUTION
        if profile is not None:
            if layout is not None:
                raise InvalidValueError("give layout or profile, not both: a profile defines the layout")
            layout, force = profile.layout, _to_force(values, profile)
        else:
            layout = layout or TaxelLayout(1, taxels, (1e-3, 1e-3), pitch_known=False)
            if layout.taxels != taxels:
                raise InvalidValueError(f"the pads of {self.path} have {taxels} taxels, layout has {layout.taxels}")
            force = layout.from_flat(
                (values * DEFAULT_RESOLUTION).astype(np.float32).reshape(len(values), len(pads), -1)
            )
        return RecordingArrays(
            time=time - time[0],
            measured=force,
            covariates={} if resultant is None else {"resultant": resultant},
            layout=layout,
            pads=pads,
            metadata={
                "source": self.path.name,
                **({} if profile is None else {"unit": profile.unit}),
                **self.table.comment,
            },
        )

    def _numbers(self, columns: list[_Column]) -> NDArray[np.float64]:
        for column in columns:
            if column not in self.columns:
                pad, taxel, axis = column
                raise InvalidValueError(f"{self.path} has no {'xyz'[axis]} of taxel {taxel} of pad {pad}")
        return self.table.numbers([self.columns[column] for column in columns])

    def _check_counts(self, values: NDArray[np.float64], columns: list[_Column]) -> None:
        counts = np.nan_to_num(values, posinf=np.inf, neginf=-np.inf)
        wrong = (counts < _COUNTS.min) | (counts > _COUNTS.max) | (counts != np.round(counts))
        if wrong.any():
            row, at = np.argwhere(wrong)[0]
            name = self.columns[columns[at]]
            raise InvalidValueError(
                f"{self.path}, line {self.table.first_row + row}, column {name!r}: a count must be a whole number from "
                f"{_COUNTS.min} to {_COUNTS.max}, got {values[row, at]:.9g}"
            )


def _to_force(counts: NDArray[np.float64], profile: CountsToForce) -> NDArray[np.float32]:
    """Convert counts, some of which may be NaN, to newtons."""
    missing = np.isnan(counts)
    force = profile.to_force(np.where(missing, 0, counts).astype(np.int16))
    if missing.any():
        # convert a mask of ones in the same way: outputs that are not 0 depend on a missing count
        force = np.where(profile.to_force(missing.astype(np.int16)) != 0, np.float32(np.nan), force)
    return force


def _is_of_host(table: CsvTable) -> bool:
    """Return whether the times are times of day; a plain table may have a column of this name, too."""
    return "Timestamp" in table.names and bool(_TIME_OF_DAY.fullmatch(table.cell(0, "Timestamp")))


def _start_from_name(path: Path, time_of_day: float) -> dict[str, float]:
    """Return the start in the metadata: the time of day (s) of the first row at the date in the file's name."""
    match = _NAME.fullmatch(path.stem)
    if not match:
        return {}
    try:
        year, month, day, hour, minute, second = (int(part) for part in match.groups())
        named = datetime(year, month, day, hour, minute, second)
    except ValueError:
        return {}
    midnight = named.replace(hour=0, minute=0, second=0)
    days = [midnight + timedelta(days=day, seconds=time_of_day) for day in (-1, 0, 1)]
    first = min(days, key=lambda moment: abs(moment - named))
    if abs(first - named) > _FARTHEST:
        warnings.warn(
            f"{path}: the time in its name is not that of its first row, {first.time()}, so it is unknown when the "
            "recording began; state it with start (paxisim convert --start)",
            stacklevel=5,
        )
        return {}
    start = first.timestamp()
    warnings.warn(
        f"{path}: by its name it began at {first.isoformat(sep=' ', timespec='milliseconds')} in the time zone of this "
        f"computer, {local_zone(start)}; state another time with start (paxisim convert --start)",
        stacklevel=5,
    )
    return {"start": start}


def _host_column(name: str) -> _Column | None:
    match = _HOST.fullmatch(name)
    if not match:
        return None
    pad, total, axis, taxel = match.groups()
    return pad, None if total else int(taxel), "XYZ".index(total or axis)


def _native_column(name: str) -> _Column | None:
    match = _NATIVE.fullmatch(name)
    if not match:
        return None
    pad, total, taxel, axis = match.groups()
    return pad, None if total else int(taxel), "xyz".index(total or axis)


def _seconds(table: CsvTable) -> NDArray[np.float64]:
    times = table.numbers(["timestamp_monotonic_s"])
    table.check_times(times, "timestamp_monotonic_s")
    return times[:, 0]


def _time_of_day(table: CsvTable) -> NDArray[np.float64]:
    """Return seconds since the midnight before the first row, adding a day at each midnight passed."""
    times = np.empty(len(table.lines))
    at = table.names.index("Timestamp")
    for i, row in enumerate(table.rows()):
        match = _TIME_OF_DAY.fullmatch(row[at].strip())
        if not match:
            raise InvalidValueError(
                f"{table.path}, line {table.first_row + i}: the time of day must be HH:MM:SS.mmm, got "
                f"{clipped(row[at])}"
            )
        times[i] = 3600 * int(match[1]) + 60 * int(match[2]) + float(match[3])
    times += _DAY * np.cumsum(np.diff(times, prepend=times[0]) < -_DAY / 2)
    return times
