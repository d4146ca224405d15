"""The clock of a table: the column that holds it, its unit, and the order of the rows.

| column, in upper or lower case | holds |
|---|---|
| ``time``, ``timestamp`` | a date and time (ISO 8601), or a number whose unit is found as below |
| ``time_s``, ``time_ms``, ``time_us``, ``time_ns``, ``time [ms]``; ``timestamp`` likewise | a number in that unit |

Without a stated unit, numbers that are Unix times in seconds are seconds. The unit of any other clock is the largest of
s, ms, us and ns in which the rows come at 1 Hz or more. If that is not seconds, a warning says so, unless the times are
Unix times in that unit. A clock whose numbers are Unix times in one unit and whose rate belongs to another is refused.

Rows that are out of order are sorted, with a warning. A clock that starts anew is refused, because the rows of its
passes would be mixed.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Container, Iterable
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.logs import schemas
from paxisim.logs.recording_arrays import episode_spans

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
UNIX_FROM = 9e8
"""Least time (s) that is taken for a Unix time: 1998."""
_LATEST = schemas.LATEST * 1e-9
_NAME = re.compile(r"(time|timestamp)(?:_(s|ms|us|ns)| ?[\[(](s|ms|us|ns)[\])])?", re.IGNORECASE)
_ISO = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):?(\d\d):?(\d\d)(?:[.,](\d{1,9}))?(?: ?(?:([Zz])|([+-])(\d\d):?(\d\d)))?"
)
# a row out of place and its gap make up to this many breaks in the sorted order, a clock that starts anew one a row
_BREAKS = 3


def time_columns(path: Path, names: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Return the columns that hold the time: ``time`` or ``timestamp``, and the unit or "" for each.

    Columns with exactly these names come before all others.

    Raises:
        InvalidValueError: Several columns may hold the time.
    """
    found = {name: _NAME.fullmatch(name) for name in names}
    times = {name: (match[1].lower(), (match[2] or match[3] or "").lower()) for name, match in found.items() if match}
    exact = {name: what for name, what in times.items() if name in ("time", "timestamp")}
    if len(times) > 1 and not exact:
        raise InvalidValueError(
            f"{path} has several columns of time, {', '.join(times)}: name the one to read 'time', or remove the others"
        )
    return exact or times


def timed(path: Path, columns: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a table with its times in seconds, in ``time`` or ``timestamp``; Unix times in ``time``.

    Raises:
        InvalidValueError: Several columns may hold the time, or its unit cannot be told.
    """
    times = time_columns(path, [name for name, values in columns.items() if values.ndim == 1])
    found = {}
    for name, (kind, unit) in times.items():
        seconds = _in_seconds(path, name, columns[name], unit)
        is_unix = len(times) == 1 and np.isfinite(seconds).any() and float(np.nanmedian(seconds)) >= UNIX_FROM
        found["time" if is_unix else kind] = seconds
    return found | {name: values for name, values in columns.items() if name not in times}


def clock_of(columns: Container[str]) -> str | None:
    """Return the name of the column that gives the time: ``time``, or else ``timestamp``; None if there is neither."""
    return next((name for name in ("time", "timestamp") if name in columns), None)


def _in_seconds(path: Path, name: str, times: NDArray[np.float64], unit: str) -> NDArray[np.float64]:
    """Return the times of column `name` in seconds, where `unit` is "" if the column does not state it.

    Raises:
        InvalidValueError: The unit cannot be told.
    """
    if unit:
        return times * UNITS[unit]
    steps = np.diff(times)
    steps = steps[steps > 0]
    size = float(np.nanmedian(np.abs(times))) if np.isfinite(times).any() else 0.0
    step = float(np.median(steps)) if len(steps) else 0.0
    possible = [unit for unit, scale in UNITS.items() if size * scale <= _LATEST] or ["s"]
    unix = next((unit for unit, scale in UNITS.items() if UNIX_FROM <= size * scale <= _LATEST), None)
    by_rate = next((unit for unit in possible if step * UNITS[unit] <= 1), possible[-1])
    if unix == "s" or not step:
        return times * UNITS[unix or "s"]
    if unix is not None and unix != by_rate:
        raise InvalidValueError(
            f"{path}: the unit of column {name!r} cannot be told: it holds Unix times if in {unix}, but its rows come "
            f"at {1 / (step * UNITS[unix]):.3g} Hz then, and at {1 / (step * UNITS[by_rate]):.3g} Hz if in {by_rate}; "
            f"name it time_{unix} or time_{by_rate}"
        )
    if by_rate != "s" and unix is None:
        warnings.warn(
            f"{path}: column {name!r} is taken to be in {by_rate}, so that its rows come at "
            f"{1 / (step * UNITS[by_rate]):.3g} Hz; name it time_s if it is in seconds",
            stacklevel=5,
        )
    return times * UNITS[by_rate]


def unix_time(text: str) -> tuple[float, bool] | None:
    """Return the Unix time (s) of an ISO 8601 date and time, and whether it lacks a time zone; None if it is neither.

    Without a time zone, it is the local time of this computer.
    """
    match = _ISO.fullmatch(text.strip())
    if not match:
        return None
    fraction = float(f"0.{match[7] or 0}")
    sign = -1 if match[9] == "-" else 1
    offset = sign * timedelta(hours=int(match[10] or 0), minutes=int(match[11] or 0))
    try:
        zone = timezone(offset) if match[8] or match[9] else None
        year, month, day, hour, minute, second = (int(match[i]) for i in range(1, 7))
        return datetime(year, month, day, hour, minute, second, tzinfo=zone).timestamp() + fraction, zone is None
    except (ValueError, OverflowError, OSError):
        return None


def start_time(start: str) -> float:
    """Return the Unix time (s) of a start that a user states; without a time zone, a warning says which was taken.

    Raises:
        InvalidValueError: It is not a date and time.
    """
    found = unix_time(start) if isinstance(start, str) else None
    if found is None:
        raise InvalidValueError(
            f"start must be a date and time such as 2026-10-04T23:15:05+02:00 (ISO 8601), got {start!r}"
        )
    if found[1]:
        warnings.warn(
            f"start {start} has no time zone; that of this computer was taken, {local_zone(found[0])}", stacklevel=4
        )
    return found[0]


def local_zone(time: float) -> str:
    """Return the time zone of this computer at a Unix time (s), such as ``UTC+02:00``."""
    text = datetime.fromtimestamp(time).astimezone().strftime("%z")
    return f"UTC{text[:3]}:{text[3:5]}"


def put_in_order(path: Path, columns: dict[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return the columns with the rows of each episode sorted by time, with a warning if any moved.

    Raises:
        InvalidValueError: The clock starts anew within an episode.
    """
    clock, episode = clock_of(columns), columns.get("episode_index")
    if clock is None or columns[clock].ndim > 1:
        return columns  # refused, as the next, when the recording is made
    time = columns[clock]
    if not np.isfinite(time).all() or (episode is not None and not np.isfinite(episode).all()):
        return columns
    spans = (slice(0, len(time)),) if episode is None else episode_spans(episode.astype(np.int64))
    order, late = np.arange(len(time)), 0
    for span in spans:
        back = np.flatnonzero(np.diff(time[span]) < 0)
        if not len(back):
            continue
        order[span] = span.start + np.argsort(time[span], kind="stable")
        if np.count_nonzero(np.abs(np.diff(order[span])) != 1) > _BREAKS * len(back):
            at = span.start + int(back[0])
            raise InvalidValueError(
                f"{path}: the clock starts anew: column {clock!r} goes from {time[at]:.9g} s in row {at + 1} to "
                f"{time[at + 1]:.9g} s in the next; number the parts in a column episode_index, or split the file"
            )
        late += len(back)
    if not late:
        return columns
    warnings.warn(
        f"{path}: {late} row{'s are' if late > 1 else ' is'} earlier than the one before; the rows were sorted by time",
        stacklevel=5,
    )
    return {name: values[order] for name, values in columns.items()}
