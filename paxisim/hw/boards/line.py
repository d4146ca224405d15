"""Line: what a board hears, decoded, with the moment it came."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from paxisim.hw.clock import Clock
from paxisim.hw.framing import Decoder
from paxisim.hw.transport import Transport

Message = TypeVar("Message")

QUEUE_PAUSE = 2e-3
"""Seconds of silence after which a port counts as read empty; a system hands on what it has kept piece by piece."""
QUEUE_TIME = 20e-3
"""Seconds that reading a port empty may take, for a line that is never silent."""
_KEPT = 4096


class Line(Generic[Message]):
    """A transport with a decoder behind it.

    Attributes:
        silent: Whether the last `collect` ended with `quiet` seconds without a byte.
        recent: The last bytes that came, up to 4096, to tell what speaks there if none of them fits.
    """

    def __init__(self, transport: Transport, clock: Clock, decoder: Decoder[Message]) -> None:
        """Remember; no I/O."""
        self.silent = True
        self.recent = b""
        self._transport, self._clock, self._decoder = transport, clock, decoder

    @property
    def bad_checksums(self) -> int:
        """See `Board.bad_checksums`."""
        return self._decoder.bad_checksums

    @property
    def skipped(self) -> int:
        """See `Board.skipped`."""
        return self._decoder.skipped

    def empty(self) -> None:
        """Throw away what has arrived and was not yet returned."""
        self._transport.discard_input()
        self._decoder.clear()

    def collect(
        self, until: Callable[[Message], bool], timeout: float, quiet: float | None = None
    ) -> list[tuple[float, Message]]:
        """What comes, each with the moment of its arrival (s, monotonic), until one message fits.

        Several messages in one read have waited for this program, as when the system stopped it for a while. Then the
        port is read empty, and all of them have the moment of that as their arrival: see `with_behind`.

        Args:
            until: The message to wait for. What came with it is returned with it.
            timeout: How long to wait for it (s).
            quiet: Give up after so many seconds of silence behind the last byte, and with them what they left
                incomplete; default: `timeout`.
        """
        deadline = self._clock.monotonic() + timeout
        quiet = timeout if quiet is None else quiet
        wait = timeout
        collected: list[tuple[float, Message]] = []
        while True:
            data = self._transport.read(max(wait, 0.0))
            now = self._clock.monotonic()
            # a wait that the deadline cut short proves nothing
            self.silent = not data and wait >= quiet
            messages = self._decoder.flush_at() if self.silent else self._take(data, now)
            if sum(came == now for came, _ in messages) > 1:
                messages, now = self._empty_queue(messages, now)
            collected += messages
            left = deadline - now
            if not data or left <= 0 or any(until(message) for _, message in messages):
                return collected
            wait = min(left, quiet)

    def _take(self, data: bytes, now: float) -> list[tuple[float, Message]]:
        self.recent = (self.recent + data)[-_KEPT:]
        return self._decoder.feed_at(data, now)

    def _empty_queue(
        self, messages: list[tuple[float, Message]], came: float
    ) -> tuple[list[tuple[float, Message]], float]:
        """Read on until nothing waits; all that came at `came` or since has come now."""
        rest, now = b"", came
        while now - came < QUEUE_TIME:
            data = self._transport.read(QUEUE_PAUSE)
            if not data:
                break
            rest += data
            now = self._clock.monotonic()
        messages = [(now if time == came else time, message) for time, message in messages]
        return messages + self._take(rest, now), now


def with_behind(messages: Sequence[tuple[float, Message]]) -> list[tuple[float, int, Message]]:
    """Messages with their arrivals, and between them how many of those behind each arrived at the same moment."""
    out: list[tuple[float, int, Message]] = []
    for time, message in reversed(messages):
        out.append((time, out[-1][1] + 1 if out and out[-1][0] == time else 0, message))
    return out[::-1]
