"""CsvTable: the text of a CSV file as named columns of numbers.

Columns are separated by commas, semicolons or tabs, whichever gives the header most columns; with semicolons, a comma
in a number is its decimal point. A first line ``# {JSON}`` is a comment; paxisim's own says what columns cannot. A
line above the header, such as one of sizes, is skipped. An empty cell is unknown and becomes NaN.
`paxisim.logs.clock` says how the time is read.
"""

from __future__ import annotations

import csv
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.files import parse_json
from paxisim.logs import schemas
from paxisim.logs.clock import local_zone, put_in_order, time_columns, timed, unix_time

_GREATEST = float(np.finfo(np.float32).max)
_DELIMITERS = ",;\t"
_LONGEST = 24  # characters of a cell that a message repeats; a file of another kind may hold anything


class CsvTable:
    """Text of a CSV file, split into lines.

    Attributes:
        path: The file.
        comment: Contents of an optional first line ``# {JSON}``.
        is_ours: Whether paxisim wrote the file, so that times are in seconds and names are exact.
        names: Column names.
        lines: The non-empty rows; the last one has a value for every column.
        first_row: Line number of the first row.
        last_may_be_cut: True if the last row does not end with a newline.
        is_cut: True if an incomplete last row was skipped.
    """

    def __init__(self, path: Path) -> None:
        """Read the text and its header.

        Raises:
            InvalidValueError: The file is not a CSV file in UTF-8, or two columns have the same name.
            FileNotFoundError: The file does not exist.
        """
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
        self.is_ours = self.comment.get("format") == schemas.FORMAT
        if not _has_time(lines[0]) and len(lines) > 1 and _has_time(lines[1]):
            lines.pop(0)
            self.first_row += 1
        self._delimiter, self.names = _header(lines[0])
        exact = next(csv.reader([lines[0]]))
        if self.is_ours and "time" in exact:  # otherwise another program has saved it again
            self._delimiter, self.names = ",", exact
        self.lines = lines[1:]
        if self._delimiter == ";":
            self.lines = [line.replace(",", ".") for line in self.lines]
        if all(_is_number(name) for name in self.names):
            raise InvalidValueError(
                f"{path} has no header: expected the columns' names in its first line, got numbers; eFlesh's file "
                "needs its states.csv beside it"
            )
        if len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise InvalidValueError(f"{path} has two columns {clipped(twice)}")
        if self.lines and len(next(self._cells(self.lines[-1:]))) < len(self.names):
            self.lines.pop()  # it ends in the middle of a row
            last_may_be_cut = False
            self.is_cut = True
        elif self.is_ours and last_may_be_cut and len(self.lines) > 1:
            self.lines.pop()  # the last number may be truncated
            self.is_cut = True
        self.last_may_be_cut = last_may_be_cut
        if not self.lines:
            raise InvalidValueError(f"{path} has no complete row or is not a CSV file")

    def numbers(self, names: list[str]) -> NDArray[np.float64]:
        """Return the named columns as ``(T, columns)``; an empty cell is NaN."""
        columns = [self.names.index(name) for name in names]
        try:
            if any(line.count(self._delimiter) != len(self.names) - 1 for line in self.lines):
                raise ValueError("rows of different lengths, or delimiters in quotes")
            return np.loadtxt(
                self.lines, delimiter=self._delimiter, usecols=columns, ndmin=2, comments=None, quotechar='"'
            )
        except ValueError:  # slow path: finds the malformed cell, and accepts empty ones
            values = np.empty((len(self.lines), len(columns)))
            for i, row in enumerate(self.rows()):
                values[i] = [self._number(row[at], i, at) for at in columns]
            return values

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Return every column of a plain table, with the time in seconds and the rows in order.

        Raises:
            InvalidValueError: A cell is not a number, or one that a recording cannot hold; or the unit or the order of
                the times cannot be told.
        """
        times = time_columns(self.path, self.names)
        first = [] if self.is_ours else next(self.rows())
        dates = [name for name, text in zip(self.names, first, strict=False) if unix_time(text) is not None]
        plain = [name for name in self.names if name not in dates]
        dates = [name for name in dates if name in times]  # a second clock is left out
        values = self.numbers(plain)
        found = {name: self._dates(name) for name in dates} | dict(zip(plain, values.T, strict=True))
        found = found if self.is_ours else timed(self.path, found)
        for name in ("time", "timestamp"):
            if name in found:
                self.check_times(found[name][:, None], name)
        self.check(
            values, plain, _GREATEST, "a number must be finite and below 3.4e38 (leave the cell empty if unknown)"
        )
        return found if self.is_ours else put_in_order(self.path, found)

    def check_times(self, times: NDArray[np.float64], name: str) -> None:
        """Raise an error if a time (s) is too large; NaN passes."""
        self.check(times, [name], schemas.LATEST * 1e-9, "a time must be in seconds and not beyond the year 2262")

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
        for i, row in enumerate(self._cells(self.lines)):
            if len(row) != len(self.names):
                raise InvalidValueError(
                    f"{self.path}, line {self.first_row + i}: expected {len(self.names)} values, got {len(row)}"
                )
            yield row

    def cell(self, row: int, name: str) -> str:
        """Return the text of a cell, "" if the row is too short."""
        cells, at = next(self._cells(self.lines[row : row + 1])), self.names.index(name)
        return cells[at].strip() if at < len(cells) else ""

    def _cells(self, lines: list[str]) -> Iterator[list[str]]:
        return iter(csv.reader(lines, delimiter=self._delimiter))

    def _dates(self, name: str) -> NDArray[np.float64]:
        """Return Unix times (s) of a column of dates; an empty cell is NaN."""
        times, at, is_local = np.full(len(self.lines), np.nan), self.names.index(name), False
        for i, row in enumerate(self.rows()):
            found = unix_time(row[at])
            if found is not None:
                times[i] = found[0]
                is_local |= found[1]
            elif row[at].strip():
                raise InvalidValueError(
                    f"{self.path}, line {self.first_row + i}, column {name!r}: expected a date and time such as "
                    f"2026-10-04T23:15:05.120+02:00, got {clipped(row[at])}"
                )
        if is_local:
            warnings.warn(
                f"{self.path}: the times in column {name!r} have no time zone; that of this computer was taken, "
                f"{local_zone(float(np.nanmin(times)))}",
                stacklevel=5,
            )
        return times

    def _number(self, text: str, row: int, column: int) -> float:
        try:
            return float(text) if text.strip() else float("nan")
        except ValueError:
            if len(self.names) == 1:  # the cell may be a line of anything
                raise InvalidValueError(
                    f"{self.path}: expected columns separated by commas, semicolons or tabs, got one column of text"
                ) from None
            raise InvalidValueError(
                f"{self.path}, line {self.first_row + row}, column {clipped(self.names[column])}: {clipped(text)} is "
                "not a number"
            ) from None


def clipped(text: str) -> str:
    """Return the text in quotes, shortened to what a message may repeat of a file."""
    return repr(text if len(text) <= _LONGEST else text[:_LONGEST] + "...")


def _header(line: str) -> tuple[str, list[str]]:
    """Return the delimiter and the column names."""
    cells = {delimiter: next(csv.reader([line], delimiter=delimiter)) for delimiter in _DELIMITERS}
    delimiter = max(cells, key=lambda delimiter: len(cells[delimiter]))
    return delimiter, [name.strip() for name in cells[delimiter]]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _has_time(line: str) -> bool:
    return any(name.lower().startswith("time") for name in _header(line)[1])
