"""Framing: turns bytes in arbitrary pieces into messages, without I/O.

`Decoder` does what is common to all families of boards: it collects bytes, counts, and reports when a message was
complete. A family with a check byte describes each kind of message by a function ``parse(buffer, at)``, and
`FrameDecoder` finds the messages: it skips garbage and never gets stuck.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

Message = TypeVar("Message")


def lrc(data: bytes) -> int:
    """Return the check byte of all PaXini protocols: the two's complement of the 8-bit sum of `data`."""
    return -sum(data) & 0xFF


class Incomplete:
    """Result of a parser if the available bytes may be the beginning of a frame."""


INCOMPLETE = Incomplete()


@dataclass(frozen=True)
class Invalid:
    """Result of a parser if no frame begins at the position.

    Attributes:
        checksum: True if the frame is complete but its check byte is wrong.
    """

    checksum: bool = False


NO_FRAME = Invalid()
BAD_CHECKSUM = Invalid(checksum=True)

# parse(buffer, at) -> (length, message), or the reason why there is none
Parser = Callable[[bytes, int], "tuple[int, Message] | Incomplete | Invalid"]


class Decoder(ABC, Generic[Message]):
    """Turns bytes, fed in arbitrary pieces, into messages.

    Attributes:
        frames: Number of messages returned so far.
        skipped: Number of bytes that belonged to no message.
        bad_checksums: Number of frames that had a wrong check byte or inside which the next frame began.
    """

    def __init__(self) -> None:
        """Start without bytes."""
        self._buffer = b""
        self._passed = 0  # bytes before the buffer
        self._pieces: deque[tuple[int, float]] = deque()  # end position and arrival time of each piece
        self.frames = self.skipped = self.bad_checksums = 0

    @property
    def pending(self) -> int:
        """Number of bytes held back: they may begin a frame, or be one that the following bytes must confirm."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Message]:
        """Add `data` and return the messages that it completes, in order."""
        return [message for _, message in self.feed_at(data, 0.0)]

    def feed_at(self, data: bytes, time: float) -> list[tuple[float, Message]]:
        """Like `feed` for bytes that arrived at `time` (s); each message comes with its last byte's arrival time."""
        if data:
            self._buffer += bytes(data)
            self._pieces.append((self._passed + len(self._buffer), time))
        return self._scan(silent=False)

    def flush(self) -> list[Message]:
        """Return the messages among the pending bytes, given that no more will come. Nothing stays pending."""
        return [message for _, message in self.flush_at()]

    def flush_at(self) -> list[tuple[float, Message]]:
        """Like `flush`; each message comes with its last byte's arrival time."""
        found = self._scan(silent=True)
        self.clear()
        return found

    def clear(self) -> None:
        """Discard the pending bytes, as after emptying the port's input."""
        self.skipped += len(self._buffer)
        self._drop(len(self._buffer))

    @abstractmethod
    def _next(self, buffer: bytes, at: int, silent: bool) -> tuple[int, int, Message | None]:
        """Find the next message from `at` on.

        Args:
            buffer: The available bytes.
            at: Position where the last message ended or the buffer begins.
            silent: True if nothing follows the buffer.

        Returns:
            Start, end and the message. The message is None if there is none yet; the bytes to keep then begin at start.
        """

    def _scan(self, silent: bool) -> list[tuple[float, Message]]:
        at, found = 0, []
        while True:
            begin, end, message = self._next(self._buffer, at, silent)
            self.skipped += begin - at
            if message is None:
                break
            at = end
            while self._pieces[0][0] < self._passed + end:
                self._pieces.popleft()
            found.append((self._pieces[0][1], message))
        self._drop(begin)
        self.frames += len(found)
        return found

    def _drop(self, count: int) -> None:
        """Remove the first `count` bytes of the buffer."""
        self._buffer = self._buffer[count:]
        self._passed += count
        while self._pieces and self._pieces[0][0] <= self._passed:
            self._pieces.popleft()


class FrameDecoder(Decoder[Message]):
    """A `Decoder` of frames with a check byte, found by a family's parser.

    Where no valid frame begins, the decoder moves on by **one** byte. It therefore finds a frame whatever precedes it,
    even if a damaged frame claimed its bytes. If a frame claims more bytes than have arrived, the decoder waits for
    them; a reader that knows that the line is silent calls `flush`, which drops the claim and searches the bytes after
    it.

    An 8-bit sum does not protect against lost bytes. A frame that lost some is completed by the first bytes of the next
    frame, and its check byte fits if those have the same sum as the lost ones, as a head ``AA 56`` and two zeros do.
    Therefore a frame waits for the bytes that follow if another frame may begin inside it and reach beyond its end. It
    is accepted if a frame begins at its end, or if the bytes inside match only the first byte of a head, as the last
    byte of one frame in 256 does by chance. Otherwise it is discarded and counted as a bad checksum, even if the other
    frame turns out to be damaged as well.

    Two cases are indistinguishable: a frame ends in the first byte of a head and the next head loses that byte, or the
    frame itself loses it. The bytes are the same, and the earlier frame is discarded. A loss across the boundary of two
    frames that removes the head goes unnoticed if the check byte fits by chance.

    Attributes:
        stream: Whether frames may follow one another unasked. If False, because each frame answers a request, no frame
            waits for the bytes that follow.
    """

    def __init__(self, parse: Parser[Message], stream: bool = True) -> None:
        """Start without bytes.

        Args:
            parse: Parser of the family, ``parse(buffer, at)``. It must never ask for more bytes than the longest frame
                expected, and must return `INCOMPLETE` for a single byte that can begin a frame.
            stream: See the class.
        """
        super().__init__()
        self.parse = parse
        self.stream = stream

    @property
    def parse(self) -> Parser[Message]:
        """Parser of the frames expected now; may be replaced at any time."""
        return self._parse

    @parse.setter
    def parse(self, parse: Parser[Message]) -> None:
        self._parse = parse
        firsts = [bytes([b]) for b in range(256) if isinstance(parse(bytes([b]), 0), Incomplete)]
        self._first = re.compile(b"|".join(map(re.escape, firsts)) or b"(?!)")

    def _next(self, buffer: bytes, at: int, silent: bool) -> tuple[int, int, Message | None]:
        while (first := self._first.search(buffer, at)) is not None:
            at = first.start()
            result = self._parse(buffer, at)
            if isinstance(result, tuple):
                end = at + result[0]
                stands = self._stands(buffer, at, end, silent) if self.stream else True
                if stands is None:
                    return at, at, None
                if stands:
                    return at, end, result[1]
                self.bad_checksums += 1
            elif isinstance(result, Invalid):
                self.bad_checksums += result.checksum
            elif not silent:
                return at, at, None
            at += 1
        return len(buffer), len(buffer), None

    def _stands(self, buffer: bytes, at: int, end: int, silent: bool) -> bool | None:
        """Return whether to accept the frame from `at` to `end`; None if that takes more bytes."""
        frame = buffer[at:end]
        place = 0
        while (first := self._first.search(frame, place + 1)) is not None:
            place = first.start()
            if not isinstance(self._parse(frame, place), Incomplete):
                continue  # no frame begins there, or it ends inside this one: it is data
            if end == len(buffer):
                return True if silent else None
            if isinstance(self._parse(buffer, at + place), Incomplete) and not silent:
                return None
            head = buffer[at + place : at + place + 2]
            if _begins(self._parse(head, 0)) and not _begins(self._parse(buffer, end)):
                return False
        return True


def _begins(result: object) -> bool:
    """Return whether a frame begins there, even a damaged or incomplete one."""
    return not isinstance(result, Invalid) or result.checksum
