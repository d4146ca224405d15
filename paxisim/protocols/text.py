"""Protocols as human-readable JSON: one waypoint per line."""

from __future__ import annotations

import json
from typing import Any

from paxisim.errors import InvalidValueError
from paxisim.logs.text import parse_json
from paxisim.protocols.protocol import Protocol, Segment

VERSION = 1
_BETWEEN = "minimum jerk, at rest at each waypoint"
_PLAIN = {"name": str, "about": str, "scene": str, "frame": str}


def format_protocol(protocol: Protocol) -> str:
    """Return the protocol as JSON; times in s, positions in m."""
    head: dict[str, Any] = {
        "version": VERSION,
        **{name: getattr(protocol, name) for name in ("name", "about", "scene")},
        "seconds": protocol.seconds,
        "units": {"time": "s", "position": "m", "speed": "m/s", "force": "N", "rate": "Hz"},
        "frame": protocol.frame,
        "between_waypoints": _BETWEEN,
        "max_speed": protocol.max_speed,
        "stop_at_normal_force_on_a_pad": protocol.stop_force,
        "record_at_least": protocol.rate,
        "columns": ["time", *protocol.streams],
    }
    lines = [f"  {json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
    segments = ",\n".join(_segment(segment) for segment in protocol.segments)
    return "{\n" + "\n".join(lines) + '\n  "segments": [\n' + segments + "\n  ]\n}\n"


def _segment(segment: Segment) -> str:
    head = {
        "episode": segment.episode,
        "name": segment.name,
        "does": segment.does,
        "motions": list(segment.motions),
        "excites": list(segment.excites),
    }
    lines = [f"      {json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
    points = ",\n".join(f"        {json.dumps(list(point))}" for point in segment.waypoints)
    return "    {\n" + "\n".join(lines) + '\n      "waypoints": [\n' + points + "\n      ]\n    }"


def parse_protocol(text: str) -> Protocol:
    """Parse a protocol from its JSON.

    Derived values (``seconds``, ``excites``) are not read.

    Raises:
        InvalidValueError: The text is not JSON, has another version, or holds a value that cannot be used.
        UnknownNameError: There is no such motion.
    """
    document = parse_json(text)
    if not isinstance(document, dict) or "segments" not in document:
        raise InvalidValueError("not a protocol: expected a JSON object with segments, as paxisim protocol writes it")
    if document.get("version") != VERSION:
        raise InvalidValueError(
            f"expected version {VERSION} of a protocol, got {document.get('version')!r}: write it again with paxisim "
            "protocol"
        )
    columns = _value(document, "columns", list)
    if columns[:1] != ["time"] or not all(isinstance(name, str) for name in columns):
        raise InvalidValueError(f'columns must be "time" and the names of the streams, got {columns!r}')
    return Protocol(
        **{name: _value(document, name, kind) for name, kind in _PLAIN.items()},
        streams=tuple(columns[1:]),
        max_speed=_number(document, "max_speed"),
        stop_force=_number(document, "stop_at_normal_force_on_a_pad"),
        rate=_number(document, "record_at_least"),
        segments=tuple(_parsed(segment) for segment in _value(document, "segments", list)),
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
