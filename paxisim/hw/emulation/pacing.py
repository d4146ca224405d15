"""PacedLine: bytes in transit to the port, limited to the line's speed. No I/O."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from paxisim.hw.emulation.faults import Piece

GRAIN = 2e-3
"""Seconds of line time that are delivered as one piece, as a USB adapter does."""


class PacedLine:
    """A queue of bytes with the time at which each leaves the line (s, any clock that never runs backwards).

    Attributes:
        free_at: Time at which the last queued byte leaves the line (s).
    """

    def __init__(self, bytes_per_second: float = math.inf) -> None:
        """Start empty.

        Args:
            bytes_per_second: Speed of the line; infinite: everything passes at once.
        """
        self._speed = bytes_per_second
        self._waiting: deque[tuple[float, bytes]] = deque()  # each with the time at which its first byte starts
        self.free_at = -math.inf

    def put(self, pieces: Sequence[Piece], now: float) -> None:
        """Queue pieces behind those already in transit, each with its delay in seconds after the one before it."""
        for wait, data in pieces:
            start = max(self.free_at, now) + wait
            self._waiting.append((start, data))
            self.free_at = start + len(data) / self._speed

    def take(self, now: float) -> bytes:
        """Return the bytes that have left the line by now and were not taken yet."""
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
        """Next time to call `take`: the end of the first piece or of its first `GRAIN`; infinite: never."""
        if not self._waiting:
            return math.inf
        start, data = self._waiting[0]
        return start + min(len(data) / self._speed, GRAIN)

    def clear(self) -> None:
        """Discard the bytes in transit."""
        self._waiting.clear()
        self.free_at = -math.inf
