"""Framing: from bytes in any pieces to messages, without I/O.

`Decoder` does what is the same for every family of boards: collect, count, say when a message was complete. A family
with a check byte describes one kind of message by a function ``parse(buffer, at)``, and `FrameDecoder` finds them: it
hunts past garbage and never gets stuck.
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
    """The check byte of every PaXini protocol: two's complement of the 8-bit sum of `data`."""
    return -sum(data) & 0xFF


class Incomplete:
    """What a parser returns while the bytes at hand may be the beginning of a frame."""


INCOMPLETE = Incomplete()


@dataclass(frozen=True)
class Invalid:
    """What a parser returns where no frame begins.

    Attributes:
        checksum: True if a whole frame was there but for its check byte.
    """

    checksum: bool = False


NO_FRAME = Invalid()
BAD_CHECKSUM = Invalid(checksum=True)

# parse(buffer, at) -> (length, message), or why there is none
Parser = Callable[[bytes, int], "tuple[int, Message] | Incomplete | Invalid"]


class Decoder(ABC, Generic[Message]):
    """Turns bytes, fed in any pieces, into messages.

    Attributes:
        frames: Messages returned so far.
        skipped: Bytes that belonged to no message.
        bad_checksums: Frames whole but for their check byte, and such that the next one began inside them.
    """

    def __init__(self) -> None:
        """Start with nothing."""
        self._buffer = b""
        self._passed = 0  # bytes before the buffer
        self._pieces: deque[tuple[int, float]] = deque()  # where each piece ended, and when it came
        self.frames = self.skipped = self.bad_checksums = 0

    @property
    def pending(self) -> int:
        """Bytes held back because they may begin a frame, or a frame because what follows will tell whether it is."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Message]:
        """The messages that `data` completes, in order."""
        return [message for _, message in self.feed_at(data, 0.0)]

    def feed_at(self, data: bytes, time: float) -> list[tuple[float, Message]]:
        """As `feed`, for bytes that came at `time` (s): each message with the time at which its last byte came."""
        if data:
            self._buffer += bytes(data)
            self._pieces.append((self._passed + len(self._buffer), time))
        return self._scan(silent=False)

    def flush(self) -> list[Message]:
        """The messages inside what is held back, knowing that its rest will not come. Nothing stays pending."""
        return [message for _, message in self.flush_at()]

    def flush_at(self) -> list[tuple[float, Message]]:
        """As `flush`, each message with the time at which its last byte came."""
        found = self._scan(silent=True)
        self.clear()
        return found

    def clear(self) -> None:
        """Forget what is held back, as after emptying the port's input."""
        self.skipped += len(self._buffer)
        self._drop(len(self._buffer))

    @abstractmethod
    def _next(self, buffer: bytes, at: int, silent: bool) -> tuple[int, int, Message | None]:
        """The next message from `at` on.

        Args:
            buffer: The bytes at hand.
            at: Where the last message ended, or the buffer begins.
            silent: Nothing follows the buffer.

        Returns:
            Where it begins and ends, and the message; None: there is none yet, and what is to be kept begins there.
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
        """Let the first bytes of the buffer go."""
        self._buffer = self._buffer[count:]
        self._passed += count
        while self._pieces and self._pieces[0][0] <= self._passed:
            self._pieces.popleft()


class FrameDecoder(Decoder[Message]):
    """A `Decoder` of frames with a check byte, found by a family's parser.

    Where no valid frame begins, it moves on by **one** byte, so a frame is found whatever precedes it, even where a
    damaged one claimed its bytes. What claims more bytes than have come is waited for; a reader that knows that the
    line is silent calls `flush`, which gives that claim up and looks behind it.

    An 8-bit sum is no protection against lost bytes: a frame that lost some fits its check byte together with the first
    bytes of the next one wherever both add up alike, as two zeros and a head ``AA 56`` do. So a frame in which another
    may begin that reaches beyond its end waits for what follows. It stands if a frame begins at its end, or if what
    begins inside is not even two bytes of a head, as one frame in 256 ends in the first of them. Else it is thrown away
    and counted as a bad checksum, also where the other one does not go on, being damaged as well.

    What cannot be told apart: the head's first byte lost behind a frame that ends in that byte, and that byte lost in
    the frame. The bytes are the same, and the frame before is given up. A loss across the boundary of two frames, which
    takes away the head, passes where the check byte fits by chance.

    Attributes:
        stream: Frames may follow one another unasked. If not, as where each answers a request, none waits for what
            follows.
    """

    def __init__(self, parse: Parser[Message], stream: bool = True) -> None:
        """Start with nothing.

        Args:
            parse: The family's parser, ``parse(buffer, at)``; it must never ask for more bytes than the longest
                frame that can be expected, and answer a first byte that can begin a frame with `INCOMPLETE`.
            stream: See the class.
        """
        super().__init__()
        self.parse = parse
        self.stream = stream

    @property
    def parse(self) -> Parser[Message]:
        """The parser of what is expected now; may be replaced at any time."""
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
        """Whether the frame from `at` to `end` is one, though another may begin inside it; None: that needs more."""
        frame = buffer[at:end]
        place = 0
        while (first := self._first.search(frame, place + 1)) is not None:
            place = first.start()
            if not isinstance(self._parse(frame, place), Incomplete):
                continue  # nothing begins there, or it ends inside the frame: data
            if end == len(buffer):
                return True if silent else None
            if isinstance(self._parse(buffer, at + place), Incomplete) and not silent:
                return None
            head = buffer[at + place : at + place + 2]
            if _begins(self._parse(head, 0)) and not _begins(self._parse(buffer, end)):
                return False
        return True


def _begins(result: object) -> bool:
    """Whether a frame begins there, be it damaged or not yet whole."""
    return not isinstance(result, Invalid) or result.checksum
