"""Protocols as human-readable JSON: one waypoint per line."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable
from typing import Any

from paxisim.errors import InvalidValueError
from paxisim.protocols.protocol import Protocol, Segment

_BETWEEN = "minimum jerk, at rest at each waypoint"
_PLAIN = {"name": str, "about": str, "scene": str, "frame": str}


def entries_of(protocol: Protocol) -> dict[str, Any]:
    """Return the entries of a protocol's JSON object; times in s, positions in m."""
    return {
        **{name: getattr(protocol, name) for name in ("name", "about", "scene")},
        "seconds": protocol.seconds,
        "units": {"time": "s", "position": "m", "speed": "m/s", "force": "N", "rate": "Hz"},
        "frame": protocol.frame,
        "between_waypoints": _BETWEEN,
        "max_speed": protocol.max_speed,
        "stop_at_normal_force_on_a_pad": protocol.stop_force,
        "record_at_least": protocol.rate,
        "columns": ["time", *protocol.streams],
        "segments": [_segment(segment) for segment in protocol.segments],
    }


def _segment(segment: Segment) -> dict[str, Any]:
    return {
        "episode": segment.episode,
        "name": segment.name,
        "does": segment.does,
        "motions": list(segment.motions),
        "excites": list(segment.excites),
        "waypoints": [list(point) for point in segment.waypoints],
    }


def in_lines(document: dict[str, Any]) -> str:
    """Return a protocol's JSON object as text, with each value and each waypoint on a line."""
    segments = [_lines(segment, "waypoints", map(json.dumps, segment["waypoints"])) for segment in document["segments"]]
    return _lines(document, "segments", segments)


def _lines(table: dict[str, Any], last: str, items: Iterable[str]) -> str:
    """Return the entries of a table a line each, and for the list `last` the texts of its items."""
    lines = [f"{json.dumps(key)}: {json.dumps(value)}," for key, value in table.items() if key != last]
    listed = textwrap.indent(",\n".join(items), "  ")
    return "{\n" + textwrap.indent("\n".join([*lines, f"{json.dumps(last)}: [\n{listed}\n]"]), "  ") + "\n}"


def from_entries(entries: dict[str, Any]) -> Protocol:
    """Return the protocol that the entries describe; derived ones (``seconds``, ``excites``) are not read.

    Raises:
        InvalidValueError: A value is missing or cannot be used.
        UnknownNameError: There is no such motion.
    """
    columns = _value(entries, "columns", list)
    if columns[:1] != ["time"] or not all(isinstance(name, str) for name in columns):
        raise InvalidValueError(f'columns must be "time" and the names of the streams, got {columns!r}')
    return Protocol(
        **{name: _value(entries, name, kind) for name, kind in _PLAIN.items()},
        streams=tuple(columns[1:]),
        max_speed=_number(entries, "max_speed"),
        stop_force=_number(entries, "stop_at_normal_force_on_a_pad"),
        rate=_number(entries, "record_at_least"),
        segments=tuple(_parsed(segment) for segment in _value(entries, "segments", list)),
    )


def _parsed(segment: Any) -> Segment:
    if not isinstance(segment, dict):
        raise InvalidValueError(f"a segment must be a JSON object, got {segment!r}")
    points = _value(segment, "waypoints", list)
    for point in points:
        if not isinstance(point, list) or not all(_is_number(value) for value in point):
            raise InvalidValueError(f"a waypoint must be a list of numbers, got {point!r}")
    return Segment(
        _value(segment, "name", str),
        _value(segment, "episode", int),
        _value(segment, "does", str),
        tuple(str(motion) for motion in _value(segment, "motions", list)),
        tuple(tuple(float(value) for value in point) for point in points),
    )


def _value(table: dict[str, Any], key: str, kind: type) -> Any:
    if not isinstance(table.get(key), kind) or isinstance(table.get(key), bool):
        expected = {str: "a string", int: "a whole number", list: "a list"}[kind]
        raise InvalidValueError(f"{key} must be {expected}, got {table.get(key)!r}")
    return table[key]


def _number(table: dict[str, Any], key: str) -> float:
    if not _is_number(table.get(key)):
        raise InvalidValueError(f"{key} must be a number, got {table.get(key)!r}")
    return float(table[key])


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
