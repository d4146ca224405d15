"""PacedLine: bytes on their way to the port, no faster than the line carries them. No I/O."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from paxisim.hw.faults import Piece

GRAIN = 2e-3
"""Seconds of line time that are handed over in one piece, as a USB adapter collects them."""


class PacedLine:
    """A queue of bytes with the time at which each has passed the line (s, any clock that does not run back)."""

    def __init__(self, bytes_per_second: float = math.inf) -> None:
        """Start empty.

        Args:
            bytes_per_second: What the line carries; infinite: everything at once.
        """
        self._speed = bytes_per_second
        self._waiting: deque[tuple[float, bytes]] = deque()  # when its first byte begins to pass
        self.free_at = -math.inf

    def put(self, pieces: Sequence[Piece], now: float) -> None:
        """Send pieces, each so many seconds after the one before it, all behind what is already on its way."""
        for wait, data in pieces:
            start = max(self.free_at, now) + wait
            self._waiting.append((start, data))
            self.free_at = start + len(data) / self._speed

    def take(self, now: float) -> bytes:
        """What has passed the line by now and was not taken yet."""
        passed = b""
        while self._waiting and self._waiting[0][0] <= now:
            start, data = self._waiting.popleft()
            count = len(data) if now >= start + len(data) / self._speed else int((now - start) * self._speed)
            passed += data[:count]
            if count < len(data):
                self._waiting.appendleft((start + count / self._speed, data[count:]))
                break
        return passed

    @property
    def next(self) -> float:
        """When it is worth calling `take` again: the end of the first piece, or a grain of it; infinite: never."""
        if not self._waiting:
            return math.inf
        start, data = self._waiting[0]
        return start + min(len(data) / self._speed, GRAIN)

    def clear(self) -> None:
        """Forget what is on its way."""
        self._waiting.clear()
        self.free_at = -math.inf
