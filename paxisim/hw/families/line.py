"""Line: a transport whose bytes are decoded into messages with arrival times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

from paxisim.hw.families.board import Board
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.framing import Decoder
from paxisim.hw.link.transport import Transport

Message = TypeVar("Message")

QUEUE_PAUSE = 2e-3
"""Seconds of silence after which a port counts as drained; the system delivers buffered bytes in pieces."""
QUEUE_TIME = 20e-3
"""Upper bound in seconds for draining a port, for a line that is never silent."""
SUSPENDED_AFTER = 0.05
"""Seconds beyond its timeout that a wait takes only if the system suspended this program."""
_KEPT = 4096


class Line(Generic[Message]):
    """A transport combined with a decoder.

    Attributes:
        silent: Whether the last `collect` ended with `quiet` seconds without a byte.
        recent: The last bytes received, up to 4096; they help identify the device if no message decodes.
    """

    def __init__(self, transport: Transport, clock: Clock, decoder: Decoder[Message]) -> None:
        """Store the arguments; no I/O."""
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
        """Discard everything that has arrived but was not yet returned."""
        self._transport.discard_input()
        self._decoder.clear()

    def collect(
        self, until: Callable[[Message], bool], timeout: float, quiet: float | None = None
    ) -> list[tuple[float, Message]]:
        """Return the messages received until one satisfies `until`, each with its arrival time (s, monotonic).

        Several messages in one read had to wait for this program, for example because the system suspended it. In that
        case the port is drained, and all of them get the time of the drain as their arrival time; see `with_behind`.

        Args:
            until: Predicate for the message to wait for. Messages that arrive with it are returned as well.
            timeout: Maximum time to wait for it (s).
            quiet: Give up after this many seconds of silence since the last byte, and flush the decoder, which
                discards any incomplete message; default: `timeout`.
        """
        deadline = self._clock.monotonic() + timeout
        quiet = timeout if quiet is None else quiet
        wait = timeout
        collected: list[tuple[float, Message]] = []
        while True:
            data = self._transport.read(max(wait, 0.0))
            now = self._clock.monotonic()
            # a wait cut short by the deadline does not prove silence
            self.silent = not data and wait >= quiet
            messages = self._decoder.flush_at() if self.silent else self._take(data, now)
            if sum(came == now for came, _ in messages) > 1:
                messages, now = self._empty_queue(messages, now)
            collected += messages
            left = deadline - now
            if not data or left <= 0 or any(until(message) for _, message in messages):
                return collected
            wait = min(left, quiet)

    def ask(
        self, request: bytes, answers: Callable[[Message], bool], timeout: float, quiet: float
    ) -> tuple[list[tuple[float, Message]], float]:
        """Send a request and return its replies. Everything that arrived before is discarded.

        Args:
            request: The bytes to send.
            answers: Predicate for the reply.
            timeout: Maximum time to wait for the reply (s), counted from the request. A reply has all of it even if the
                caller's own time is up, as the system may have suspended this program before the request.
            quiet: Give up after this many seconds of silence since the last byte.

        Returns:
            The replies with their arrival times, and the number of seconds that must not count towards the caller's
            timeout. It is 0 unless the system suspended this program during the wait; there are no replies then, since
            their age is unknown.
        """
        self.empty()
        asked = self._clock.monotonic()
        self._transport.write(request)
        heard = self.collect(answers, timeout, quiet)
        waited = self._clock.monotonic() - asked
        if waited > timeout + SUSPENDED_AFTER:
            return [], waited
        return [(time, message) for time, message in heard if answers(message)], 0.0

    def _take(self, data: bytes, now: float) -> list[tuple[float, Message]]:
        self.recent = (self.recent + data)[-_KEPT:]
        return self._decoder.feed_at(data, now)

    def _empty_queue(
        self, messages: list[tuple[float, Message]], came: float
    ) -> tuple[list[tuple[float, Message]], float]:
        """Read until the port is drained; everything received at `came` or later gets the time of the last read."""
        rest, now = b"", came
        while now - came < QUEUE_TIME:
            data = self._transport.read(QUEUE_PAUSE)
            if not data:
                break
            rest += data
            now = self._clock.monotonic()
        messages = [(now if time == came else time, message) for time, message in messages]
        return messages + self._take(rest, now), now


class LineBoard(Board):
    """A board that speaks over a `Line`, whose decoder counts what it discards."""

    _line: Line[Any]

    @property
    def bad_checksums(self) -> int:
        """See `Board.bad_checksums`."""
        return self._line.bad_checksums

    @property
    def skipped(self) -> int:
        """See `Board.skipped`."""
        return self._line.skipped


def with_behind(messages: Sequence[tuple[float, Message]]) -> list[tuple[float, int, Message]]:
    """Return ``(arrival, behind, message)``, where `behind` counts the later messages with the same arrival time."""
    out: list[tuple[float, int, Message]] = []
    for time, message in reversed(messages):
        out.append((time, out[-1][1] + 1 if out and out[-1][0] == time else 0, message))
    return out[::-1]
