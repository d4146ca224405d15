"""Building blocks of protocols: a path of waypoints, and the motions that a diagnosis recommends."""

from __future__ import annotations

import math

from paxisim.protocols.protocol import PEAK_TO_MEAN_SPEED
from paxisim.protocols.segment import Segment

UNLOADED_SECONDS = 60.0
"""Time without load (s), as recommended in `paxisim.diagnose.data.motions.MOTIONS`."""
HOLD_SECONDS = 30.0
"""Duration of a held press (s), from the same table."""
STAIRCASE_LEVELS = 6
"""Number of levels of a staircase."""


class Path:
    """A growing list of waypoints; the streams rest at each.

    Attributes:
        episode: Episode of the segments ended from now on.
        segments: Segments ended so far.
    """

    def __init__(self, max_speed: float, pressing: str, away: float, **start: float) -> None:
        """Begin at a position.

        Args:
            max_speed: Maximum speed (m/s); a move takes as long as this requires.
            pressing: Name of the stream that presses.
            away: Position (m) of that stream without contact.
            start: Initial position (m) of each stream.
        """
        self._speed, self._pressing, self._away = max_speed, pressing, away
        self._now, self._at = 0.0, dict(start)
        self._points: list[tuple[float, ...]] = [(0.0, *start.values())]
        self.episode = 0
        self.segments: list[Segment] = []

    def to(self, seconds: float = 0.0, **goal: float) -> None:
        """Move to `goal` (m) in `seconds`, or in the shortest time that the speed limit allows if that is longer."""
        farthest = max(abs(value - self._at[name]) for name, value in goal.items())
        self._at |= goal
        self.rest(max(seconds, math.ceil(101 * PEAK_TO_MEAN_SPEED * farthest / self._speed) / 100))

    def press(self, seconds: float, level: float) -> None:
        """Move the pressing stream to `level` (m)."""
        self.to(seconds, **{self._pressing: level})

    def lift(self, seconds: float = 0.0) -> None:
        """Move the pressing stream out of contact."""
        self.press(seconds, self._away)

    def rest(self, seconds: float) -> None:
        """Stay for `seconds`; adds nothing if that is 0."""
        if seconds:
            self._now = round(self._now + seconds, 3)
            self._points.append((self._now, *(round(value, 7) for value in self._at.values())))

    def end(self, name: str, does: str, *motions: str) -> None:
        """Make a segment of the waypoints added since the last one."""
        self.segments.append(Segment(name, self.episode, does, motions, tuple(self._points)))
        self._points = []


def free(path: Path, seconds: float) -> None:
    """Stay without contact for `seconds`."""
    path.rest(seconds)
    path.end("free", "do not touch", "free", "sessions")


def taps(path: Path, level: float) -> None:
    """Tap three times, each time faster."""
    for seconds in (0.4, 0.2, 0.12):
        path.press(seconds, level)
        path.lift(seconds)
        path.rest(0.3)
    path.end("taps", "tap three times, each time faster", "taps")


def staircase(path: Path, low: float, high: float, *more: str) -> None:
    """Press in steps, then stop at two of them on the way out; `more` names further motions of the segment."""
    levels = [low + step / STAIRCASE_LEVELS * (high - low) for step in range(1, STAIRCASE_LEVELS + 1)]
    for level in (*levels, levels[3], levels[1]):
        path.press(0.5, level)
        path.rest(1.0)
    path.lift(0.5)
    path.end("staircase", f"{STAIRCASE_LEVELS} steps in and two out, 1 s at each", "staircase", *more)


def hold(path: Path, level: float) -> None:
    """Hold a press for long, then rest for long."""
    path.press(0.5, level)
    path.rest(HOLD_SECONDS)
    path.lift(0.5)
    path.rest(UNLOADED_SECONDS)
    path.end("hold", f"hold for {HOLD_SECONDS:g} s, then do not touch for {UNLOADED_SECONDS:g} s", "holds")


def waves(path: Path, level: float) -> None:
    """Press and release at three speeds that span two decades."""
    for seconds, times in ((0.15, 4), (1.5, 2), (15.0, 1)):
        for _ in range(times):
            path.press(seconds, level)
            path.lift(seconds)
    path.end("waves", "press and release at three speeds that span two decades", "triangles")


def hold_both_ways(path: Path, middle: float, level: float) -> None:
    """Hold for long at `middle` (m) on the way in to `level` (m) and on the way out."""
    for goal, seconds in ((middle, HOLD_SECONDS), (level, 1.0), (middle, HOLD_SECONDS)):
        path.press(2.0, goal)
        path.rest(seconds)
    path.lift(1.0)
    path.end("holds", f"hold half the depth for {HOLD_SECONDS:g} s on the way in and on the way out", "triangles")


def light(path: Path, touch: float, level: float) -> None:
    """Press so slowly that the reading passes through every count; contact begins at `touch` (m)."""
    path.press(1.0, touch)
    path.press(6.0, level)
    path.press(6.0, touch)
    path.lift(1.0)
    path.end("light", "press very lightly and slowly", "light")
