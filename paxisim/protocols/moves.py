"""Moves that protocols are made of: a path of waypoints, and the motions that a diagnosis asks for."""

from __future__ import annotations

import math

from paxisim.protocols.protocol import FASTEST, Segment

LONG = 60.0
"""Seconds without load, as `paxisim.diagnose.advice.MOTIONS` asks for them."""
HOLD = 30.0
"""Seconds of a held press, likewise."""
STEPS = 6
"""Levels of a staircase."""


class Path:
    """Waypoints as they are added, of streams that rest at each.

    Attributes:
        episode: The episode to which segments belong that are ended from now on.
        segments: What was ended.
    """

    def __init__(self, max_speed: float, pressing: str, away: float, **start: float) -> None:
        """Begin at a position.

        Args:
            max_speed: Speed (m/s) that no move exceeds: it takes as long as that asks for.
            pressing: The stream that presses.
            away: Where it does not touch (m).
            start: Position (m) of each stream at the beginning.
        """
        self._speed, self._pressing, self._away = max_speed, pressing, away
        self._now, self._at = 0.0, dict(start)
        self._points: list[tuple[float, ...]] = [(0.0, *start.values())]
        self.episode = 0
        self.segments: list[Segment] = []

    def to(self, seconds: float = 0.0, **goal: float) -> None:
        """Move there in that time, or in the shortest one that is allowed if this is longer."""
        farthest = max(abs(value - self._at[name]) for name, value in goal.items())
        self._at |= goal
        self.rest(max(seconds, math.ceil(101 * FASTEST * farthest / self._speed) / 100))

    def press(self, seconds: float, level: float) -> None:
        """Move the stream that presses."""
        self.to(seconds, **{self._pressing: level})

    def lift(self, seconds: float = 0.0) -> None:
        """Move it away."""
        self.press(seconds, self._away)

    def rest(self, seconds: float) -> None:
        """Stay; for no time, nothing is added."""
        if seconds:
            self._now = round(self._now + seconds, 3)
            self._points.append((self._now, *(round(value, 7) for value in self._at.values())))

    def end(self, name: str, does: str, *motions: str) -> None:
        """What was added since the last segment is one."""
        self.segments.append(Segment(name, self.episode, does, motions, tuple(self._points)))
        self._points = []


def free(path: Path, seconds: float) -> None:
    """No touch for that long."""
    path.rest(seconds)
    path.end("free", "do not touch", "free", "sessions")


def taps(path: Path, level: float) -> None:
    """Three taps, each faster."""
    for seconds in (0.4, 0.2, 0.12):
        path.press(seconds, level)
        path.lift(seconds)
        path.rest(0.3)
    path.end("taps", "tap three times, each faster", "taps")


def staircase(path: Path, low: float, high: float, *more: str) -> None:
    """Steps in, of which two are taken out as well; `more` are motions that it is beside a staircase."""
    levels = [low + step / STEPS * (high - low) for step in range(1, STEPS + 1)]
    for level in (*levels, levels[3], levels[1]):
        path.press(0.5, level)
        path.rest(1.0)
    path.lift(0.5)
    path.end("staircase", f"{STEPS} steps in and two out, 1 s at each", "staircase", *more)


def hold(path: Path, level: float) -> None:
    """A long hold and a long rest."""
    path.press(0.5, level)
    path.rest(HOLD)
    path.lift(0.5)
    path.rest(LONG)
    path.end("hold", f"hold for {HOLD:g} s, then do not touch for {LONG:g} s", "holds")


def waves(path: Path, level: float) -> None:
    """Presses and releases at three speeds over two decades."""
    for seconds, times in ((0.15, 4), (1.5, 2), (15.0, 1)):
        for _ in range(times):
            path.press(seconds, level)
            path.lift(seconds)
    path.end("waves", "press and release at three speeds over two decades", "triangles")


def hold_both_ways(path: Path, middle: float, level: float) -> None:
    """A long hold at `middle` on the way in and on the way out."""
    for goal, seconds in ((middle, HOLD), (level, 1.0), (middle, HOLD)):
        path.press(2.0, goal)
        path.rest(seconds)
    path.lift(1.0)
    path.end("holds", f"hold half the depth for {HOLD:g} s on the way in and on the way out", "triangles")


def light(path: Path, touch: float, level: float) -> None:
    """A press so slow that the reading passes through every count; `touch` is where contact begins."""
    path.press(1.0, touch)
    path.press(6.0, level)
    path.press(6.0, touch)
    path.lift(1.0)
    path.end("light", "press very lightly and slowly", "light")
