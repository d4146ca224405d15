"""Line: what a board hears, decoded, with the moment it came."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from paxisim.hw.clock import Clock
from paxisim.hw.framing import FrameDecoder, Incomplete, Invalid, Parser
from paxisim.hw.transport import Transport

Message = TypeVar("Message")

_KEPT = 4096


class Line(Generic[Message]):
    """A transport with a decoder behind it.

    Attributes:
        parse: The parser of what is expected now; may be replaced at any time.
        silent: Whether the last `collect` ended with `quiet` seconds without a byte.
        recent: The last bytes that came, up to 4096, to tell what speaks there if none of them fits.
    """

    def __init__(self, transport: Transport, clock: Clock, parse: Parser[Message]) -> None:
        """Remember; no I/O."""
        self.parse = parse
        self.silent = True
        self.recent = b""
        self._transport, self._clock = transport, clock
        self._decoder = FrameDecoder(self._parse_now)

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

        Args:
            until: The message to wait for. What came in the same read is returned with it.
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
            self.recent = (self.recent + data)[-_KEPT:]
            messages = self._decoder.flush() if self.silent else self._decoder.feed(data)
            collected += [(now, message) for message in messages]
            left = deadline - now
            if not data or left <= 0 or any(until(message) for message in messages):
                return collected
            wait = min(left, quiet)

    def _parse_now(self, buffer: bytes, at: int) -> tuple[int, Message] | Incomplete | Invalid:
        return self.parse(buffer, at)
