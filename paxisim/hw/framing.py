"""Framing: from bytes in any pieces to messages, without I/O.

A family of boards describes one kind of message by a function ``parse(buffer, at)``; `FrameDecoder` does what is the
same for all of them: collect, hunt past garbage, never get stuck, count what was bad.
"""

from __future__ import annotations

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


class FrameDecoder(Generic[Message]):
    """Turns bytes, fed in any pieces, into the messages of one family.

    Where no valid frame begins, it moves on by **one** byte, so a frame is found whatever precedes it, even where a
    damaged one claimed its bytes. What claims more bytes than have come is waited for; a reader that knows that the
    line is silent calls `flush`, which gives that claim up and looks behind it.

    Attributes:
        frames: Messages returned so far.
        skipped: Bytes that belonged to no message.
        bad_checksums: Frames whole but for their check byte.
    """

    def __init__(self, parse: Parser[Message]) -> None:
        """Start with nothing.

        Args:
            parse: The family's parser, ``parse(buffer, at)``; it must never ask for more bytes than the longest
                frame that can be expected.
        """
        self._parse = parse
        self._buffer = b""
        self.frames = self.skipped = self.bad_checksums = 0

    @property
    def pending(self) -> int:
        """Bytes held back because they may begin a frame."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Message]:
        """The messages that `data` completes, in order."""
        self._buffer += bytes(data)
        return self._scan(silent=False)

    def flush(self) -> list[Message]:
        """The messages inside what is held back, knowing that its rest will not come. Nothing stays pending."""
        return self._scan(silent=True)

    def clear(self) -> None:
        """Forget what is held back, as after emptying the port's input."""
        self.skipped += len(self._buffer)
        self._buffer = b""

    def _scan(self, silent: bool) -> list[Message]:
        buffer, at, found = self._buffer, 0, []
        while at < len(buffer):
            result = self._parse(buffer, at)
            if isinstance(result, Incomplete):
                if not silent:
                    break
                result = NO_FRAME
            if isinstance(result, Invalid):
                self.bad_checksums += result.checksum
                self.skipped += 1
                at += 1
            else:
                length, message = result
                found.append(message)
                at += length
        self._buffer = buffer[at:]
        self.frames += len(found)
        return found
