"""CSV recordings: files written by a board's own recorders, and plain tables.

There are three kinds, recognised by their columns. In the first two, every number is a raw count of 0.1 N from the
board: signed for x and y, unsigned for z. An empty cell is unknown and becomes NaN.

- **Host program** (one row per frame): ``Timestamp`` is the time of day, ``HH:MM:SS.mmm``; ``F-M-NxN-X[i]`` (and Y, Z)
  is taxel ``i`` of module ``M`` (0 proximal, 1 middle, 2 tip, 3 nail; 0 to 7 on the palm) of finger ``F`` (0 thumb to
  4 little, 5 palm); ``F-M-1x1-X`` is the module's resultant. A pad is named ``F-M``.
- **paxini-sdk, "native"**: an optional first line ``# {JSON}`` describes firmware and modules. The columns are
  ``timestamp_iso`` (local time), ``timestamp_monotonic_s`` (s), ``PAD_ptNNN_fx_lsb`` (and fy, fz), and
  ``PAD_resultant_fx_lsb``. Pads have names such as ``index_tip``.
- **Plain**: newtons, with the columns of `paxisim.logs.columns`.

The resultants become the covariate ``resultant``, ``(T, pads, 3)`` newtons.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.files import parse_json
from paxisim.layout import TaxelLayout
from paxisim.logs import schemas
from paxisim.logs.columns import from_columns
from paxisim.logs.recording_arrays import CountsToForce, RecordingArrays

DEFAULT_RESOLUTION = 0.1  # newtons per count
_COUNTS = np.iinfo(np.int16)
_GREATEST = float(np.finfo(np.float32).max)
_DAY = 86400.0

# pad, taxel (None: the resultant), axis
_Column = tuple[str, "int | None", int]
_HOST = re.compile(r"(\d+-\d+)-(?:1x1-([XYZ])|NxN-([XYZ])\[(\d{1,9})\])")
_TIME_OF_DAY = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:\.\d*)?)")
_NATIVE = re.compile(r"(.+)_(?:resultant_f([xyz])|pt(\d{1,9})_f([xyz]))_lsb")


def read_csv(
    path: Path,
    layout: TaxelLayout | None = None,
    pads: tuple[str, ...] | None = None,
    profile: CountsToForce | None = None,
) -> tuple[RecordingArrays, bool]:
    """Read a CSV file of any of the three kinds.

    Args:
        path: The file.
        layout: Taxel layout of the pads; its ``vendor_order`` maps the file's taxels to the grid.
        pads: Names of the pads to read from a board's file, in this order. Needed if the hand's pads differ in their
            number of taxels, because a recording holds pads of one kind. Ignored for a plain table, which is read
            completely.
        profile: Conversion from counts to newtons, for a board's file.

    Returns:
        The recording, and whether an incomplete last row was skipped.

    Raises:
        InvalidValueError: The file is of none of the three kinds, or a row is malformed; the message has its line.
        UnknownNameError: A pad does not exist.
    """
    table = _Table(path)
    for time_column, parse, read_time in (
        ("Timestamp", _host_column, _time_of_day),
        ("timestamp_monotonic_s", _native_column, _seconds),
    ):
        if time_column in table.names:
            if table.last_may_be_cut and len(table.lines) > 1:
                table.lines.pop()  # recorders end each row with a newline, so the last number may be truncated
                table.is_cut = True
            return _Board(table, parse).read(read_time(table), layout, pads, profile), table.is_cut
    if profile is not None:
        raise InvalidValueError(f"profile is for the counts of a board's file; {path} is a plain table of newtons")
    columns = table.columns()
    try:
        found = from_columns(columns)
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}: {error}") from error
    return replace(found, layout=layout, metadata=table.comment), table.is_cut


def read_csv_columns(path: Path) -> tuple[dict[str, NDArray[np.float64]], bool]:
    """Return the columns of a plain table by name, and whether an incomplete last row was skipped.

    Raises:
        InvalidValueError: The file is not a table of numbers, or a row is malformed; the message has its line.
        FileNotFoundError: The file does not exist.
    """
    table = _Table(path)
    return table.columns(), table.is_cut


class _Table:
    """Text of a CSV file, split into lines.

    Attributes:
        comment: Contents of an optional first line ``# {JSON}``.
        names: Column names.
        lines: The non-empty rows; the last one has a value for every column.
        last_may_be_cut: True if the last row does not end with a newline.
        is_cut: True if an incomplete last row was skipped.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.is_cut = False
        try:
            text = path.read_text(encoding="utf-8-sig")
        except UnicodeDecodeError as error:
            raise InvalidValueError(
                f"{path}: expected a CSV file in UTF-8, got the byte {error.object[error.start]:#04x} after "
                f"{error.start} bytes; save the file as UTF-8"
            ) from error
        last_may_be_cut = not text.endswith("\n")
        lines = [line for line in re.split("\r\n|\n|\r", text) if line.strip()]
        self.comment: dict[str, Any] = {}
        self.first_row = 2
        if lines and lines[0].startswith("#"):
            said = lines.pop(0).lstrip("# ")
            self.first_row = 3
            try:
                self.comment = dict(parse_json(said))
            except (ValueError, TypeError):
                self.comment = {"comment": said}
        if not lines:
            raise InvalidValueError(f"{path} is empty")
        self.names = [name.strip() for name in next(csv.reader(lines[:1]))]
        self.lines = lines[1:]
        if len(self.names) == 1 and lines[0].count(";"):
            raise InvalidValueError(f"{path}: expected columns separated by commas, got semicolons: {lines[0][:40]!r}")
        if len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise InvalidValueError(f"{path} has two columns {twice!r}")
        if self.lines and len(next(csv.reader(self.lines[-1:]))) < len(self.names):
            self.lines.pop()  # it ends in the middle of a row
            last_may_be_cut = False
            self.is_cut = True
        self.last_may_be_cut = last_may_be_cut
        if not self.lines:
            raise InvalidValueError(f"{path} has no complete row or is not a CSV file; it begins {lines[0][:40]!r}")

    def numbers(self, names: list[str]) -> NDArray[np.float64]:
        """Return the named columns as ``(T, columns)``; an empty cell is NaN."""
        columns = [self.names.index(name) for name in names]
        try:
            if any(line.count(",") != len(self.names) - 1 for line in self.lines):
                raise ValueError("rows of different lengths, or commas in quotes")
            return np.loadtxt(self.lines, delimiter=",", usecols=columns, ndmin=2, comments=None, quotechar='"')
        except ValueError:  # slow path: finds the malformed cell, and accepts empty ones
            values = np.empty((len(self.lines), len(columns)))
            for i, row in enumerate(self.rows()):
                values[i] = [self._number(row[at], i, at) for at in columns]
            return values

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Return every column of a plain table, after checking that a recording can hold its times and values."""
        values = self.numbers(self.names)
        for name in [name for name in ("timestamp", "time") if name in self.names]:
            _check_times(self, values[:, [self.names.index(name)]], name)
        self.check(
            values, self.names, _GREATEST, "a number must be finite and below 3.4e38 (leave the cell empty if unknown)"
        )
        return dict(zip(self.names, values.T, strict=True))

    def check(self, values: NDArray[np.float64], names: list[str], limit: float, expected: str) -> None:
        """Raise an error if a magnitude exceeds `limit`; NaN passes."""
        wrong = np.abs(values) > limit
        if wrong.any():
            row, at = np.argwhere(wrong)[0]
            raise InvalidValueError(
                f"{self.path}, line {self.first_row + row}, column {names[at]!r}: {expected}, got {values[row, at]:.9g}"
            )

    def rows(self) -> Iterator[list[str]]:
        """Yield the cells of each row as text."""
        for i, row in enumerate(csv.reader(self.lines)):
            if len(row) != len(self.names):
                raise InvalidValueError(
                    f"{self.path}, line {self.first_row + i}: expected {len(self.names)} values, got {len(row)}"
                )
            yield row

    def _number(self, text: str, row: int, column: int) -> float:
        try:
            return float(text) if text.strip() else float("nan")
        except ValueError:
            raise InvalidValueError(
                f"{self.path}, line {self.first_row + row}, column {self.names[column]!r}: {text!r} is not a number"
            ) from None


class _Board:
    """A file of raw counts written by a board's recorder."""

    def __init__(self, table: _Table, parse: Callable[[str], _Column | None]) -> None:
        self.table, self.path = table, table.path
        self.columns = {column: name for name in table.names if (column := parse(name))}
        self.pads = list(dict.fromkeys(pad for pad, taxel, _ in self.columns if taxel is not None))
        if not self.pads:
            raise InvalidValueError(f"{self.path} has no taxels, only {', '.join(table.names[:4])} ...")

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
            layout = layout or TaxelLayout(1, taxels, (1e-3, 1e-3))
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


def _seconds(table: _Table) -> NDArray[np.float64]:
    times = table.numbers(["timestamp_monotonic_s"])
    _check_times(table, times, "timestamp_monotonic_s")
    return times[:, 0]


def _check_times(table: _Table, times: NDArray[np.float64], name: str) -> None:
    table.check(times, [name], schemas.LATEST * 1e-9, "a time must be in seconds and not beyond the year 2262")


def _time_of_day(table: _Table) -> NDArray[np.float64]:
    """Return seconds since the midnight before the first row, adding a day at each midnight passed."""
    times = np.empty(len(table.lines))
    at = table.names.index("Timestamp")
    for i, row in enumerate(table.rows()):
        match = _TIME_OF_DAY.fullmatch(row[at].strip())
        if not match:
            raise InvalidValueError(
                f"{table.path}, line {table.first_row + i}: the time of day must be HH:MM:SS.mmm, got {row[at]!r}"
            )
        times[i] = 3600 * int(match[1]) + 60 * int(match[2]) + float(match[3])
    times += _DAY * np.cumsum(np.diff(times, prepend=times[0]) < -_DAY / 2)
    return times
