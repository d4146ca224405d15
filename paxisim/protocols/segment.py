"""Segment: a part of a protocol with one purpose, and its form in JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.data.motions import MOTIONS
from paxisim.errors import InvalidValueError, UnknownNameError


@dataclass(frozen=True)
class Segment:
    """A part of a protocol that serves one purpose.

    Attributes:
        name: Name of the segment.
        episode: Episode of the recording that the segment belongs to.
        does: Description of the motion.
        motions: Motions recommended by a diagnosis that the segment provides: keys of
            `paxisim.diagnose.data.motions.MOTIONS`; empty for a move from one place to the next.
        waypoints: Points where the motion rests, each a time (s, from the beginning of the protocol) and a position of
            each stream (m).

    Raises:
        UnknownNameError: There is no such motion.
        InvalidValueError: The segment has no waypoint.
    """

    name: str
    episode: int
    does: str
    motions: tuple[str, ...]
    waypoints: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        """Check the motions."""
        for motion in self.motions:
            if motion not in MOTIONS:
                raise UnknownNameError(f"motion of segment {self.name!r}", motion, MOTIONS)
        if not self.waypoints:
            raise InvalidValueError(f"segment {self.name!r} of episode {self.episode} needs a waypoint")

    @property
    def excites(self) -> tuple[str, ...]:
        """Names of the causes of a diagnosis that these motions excite best."""
        return tuple(name for name in known_causes() if cause(name).excites in self.motions)


def entries_of(segment: Segment) -> dict[str, Any]:
    """Return a segment as it stands in a protocol's JSON; times in s, positions in m."""
    return {
        "episode": segment.episode,
        "name": segment.name,
        "does": segment.does,
        "motions": list(segment.motions),
        "excites": list(segment.excites),
        "waypoints": [list(point) for point in segment.waypoints],
    }


def segment_from(document: Any) -> Segment:
    """Return the segment that `entries_of` describes; what is derived (``excites``) is not read.

    Raises:
        InvalidValueError: A value is missing or cannot be used.
        UnknownNameError: There is no such motion.
    """
    if not isinstance(document, dict):
        raise InvalidValueError(f"a segment must be a JSON object, got {document!r}")
    points = value_of(document, "waypoints", list)
    for point in points:
        if not isinstance(point, list) or not all(_is_number(value) for value in point):
            raise InvalidValueError(f"a waypoint must be a list of numbers, got {point!r}")
    return Segment(
        value_of(document, "name", str),
        value_of(document, "episode", int),
        value_of(document, "does", str),
        tuple(str(motion) for motion in value_of(document, "motions", list)),
        tuple(tuple(float(value) for value in point) for point in points),
    )


def value_of(table: dict[str, Any], key: str, kind: type) -> Any:
    """Return an entry of a JSON object, which must be of a type: str, int or list."""
    if not isinstance(table.get(key), kind) or isinstance(table.get(key), bool):
        expected = {str: "a string", int: "a whole number", list: "a list"}[kind]
        raise InvalidValueError(f"{key} must be {expected}, got {table.get(key)!r}")
    return table[key]


def number_of(table: dict[str, Any], key: str) -> float:
    """Return an entry of a JSON object, which must be a number."""
    if not _is_number(table.get(key)):
        raise InvalidValueError(f"{key} must be a number, got {table.get(key)!r}")
    return float(table[key])


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
