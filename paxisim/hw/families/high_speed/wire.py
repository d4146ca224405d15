"""Messages of the GEN3 high-speed board: requests, replies, and frames that it pushes unprompted. No I/O.

::

    request   55 AA | 00 | FC    | REG(2) | N(2) | data | LRC
    reply     AA 55 | 00 | FC    | REG(2) | N(2) | data | LRC
    offset    0       2    3       4        6      8
    push      AA 56 | 00 | FL(2) | EC     | data        | LRC
    offset    0       2    3       5        6

Numbers are little-endian; the LRC covers everything before it. FC 03 reads N <= 512 bytes, 10 writes N <= 10 bytes, 17
zeroes. The data of a reply are the bytes read, or one byte after a write or zeroing, with 00 for success. A reply with
bit 7 of FC set is an error; its number is the rest of FC. FL is the length of a push's data plus 1, EC its error code.
The reply to a write to the push register has the head AA 56: a push without data. See
`paxisim.hw.families.high_speed.stream_layout` for the data of a push.

Failures and how they are handled:

- Replies are lost in a running stream. The driver stops the stream before it sends a request.
- One read may contain several pushes; all of them are returned.
- A damaged FL could claim the following 64 kB, two seconds of the stream. `push_parser` takes the set of permitted
  lengths, so such a frame is rejected as soon as its header has arrived.
- A push that lost two zeros passes its check byte together with the next one's head ``AA 56``, whose bytes add up to 0
  as well: see `FrameDecoder`. If FL is 256 to 511, a push that lost the low byte of FL may pass as a push without data
  but with an error code, if the first bytes of its data happen to match the check byte.
- The heads differ in one byte, so a flipped bit can turn a push into a reply. `push_parser` accepts only pushes.
- Switching a module off or on changes the length of every push. No push matches then until the board is started anew.

Layout and stream were observed on hardware by the author of a public driver. Error replies, the limits of N and the
acknowledgement of the push register come from a document or from code. This project tested nothing on a device.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from paxisim.errors import InvalidValueError
from paxisim.hw.families import registers
from paxisim.hw.link.framing import BAD_CHECKSUM, INCOMPLETE, NO_FRAME, Incomplete, Invalid, Parser, lrc

READ = 0x03
WRITE = 0x10
ZERO = 0x17
FUNCTIONS = (READ, WRITE, ZERO)
ERROR_BIT = 0x80
REQUEST_HEAD = b"\x55\xaa"
REPLY_HEAD = b"\xaa\x55"
PUSH_HEAD = b"\xaa\x56"
MAX_READ = 512
MAX_WRITE = 10
MAX_PUSH = registers.HIGH_SPEED_MODULES * (6 + 3 * 239)
"""Number of data bytes in the longest push, with every module the part with the most taxels."""

_HEADER = 8
_PUSH_HEADER = 6


@dataclass(frozen=True)
class Request:
    """A request from the host.

    Attributes:
        function: `READ`, `WRITE` or `ZERO`.
        register: The first register.
        count: Number of bytes to read or write.
        data: The bytes to write; empty for a read.
    """

    function: int
    register: int
    count: int
    data: bytes = b""

    def encode(self) -> bytes:
        """Encode the frame.

        Raises:
            InvalidValueError: The function is unknown, the count exceeds what the board accepts, or it does not match
                the data.
        """
        if self.function not in FUNCTIONS:
            raise InvalidValueError(
                f"function must be 03 (read), 10 (write) or 17 (zero), got {self.function:02X}; no other is ever sent"
            )
        limit = MAX_READ if self.function == READ else MAX_WRITE
        if not 1 <= self.count <= limit:
            raise InvalidValueError(f"count of function {self.function:02X} must be in 1..{limit}, got {self.count}")
        if len(self.data) != (0 if self.function == READ else self.count):
            raise InvalidValueError(
                f"data of function {self.function:02X} with count {self.count} cannot have {len(self.data)} bytes"
            )
        return _frame(REQUEST_HEAD, self.function, self.register, self.count, self.data)


@dataclass(frozen=True)
class Reply:
    """A reply from the board.

    Attributes:
        function: As in the request; an error sets `ERROR_BIT`.
        register: As in the request.
        data: The bytes read, or one byte after a write.
    """

    function: int
    register: int
    data: bytes = b""

    @property
    def error(self) -> int:
        """Error number; 0 means no error."""
        return self.function & ~ERROR_BIT if self.function & ERROR_BIT else 0

    def encode(self) -> bytes:
        """Encode the frame."""
        return _frame(REPLY_HEAD, self.function, self.register, len(self.data), self.data)

    def answers(self, request: Request) -> bool:
        """Whether this replies to `request`: same register and function, and as many bytes as requested."""
        if self.register != request.register:
            return False
        if self.function & ERROR_BIT:
            return True
        return self.function == request.function and (self.function != READ or len(self.data) == request.count)


@dataclass(frozen=True)
class Push:
    """A frame that the board sends unprompted, or its answer to starting or stopping the stream.

    Attributes:
        error: Error code; 0 means no error.
        data: Resultants and taxels of the active modules, see `stream_layout`; may be empty.
    """

    error: int = 0
    data: bytes = b""

    def encode(self) -> bytes:
        """Encode the frame."""
        frame = PUSH_HEAD + b"\x00" + (len(self.data) + 1).to_bytes(2, "little") + bytes([self.error]) + self.data
        return frame + bytes([lrc(frame)])


def read_request(register: int, count: int) -> Request:
    """Return the request for `count` bytes from `register` on."""
    return Request(READ, register, count)


def write_request(register: int, data: bytes) -> Request:
    """Return the request to write `data` from `register` on."""
    return Request(WRITE, register, len(data), data)


def version_request() -> Request:
    """Return the request for the version; the reply's data are ASCII."""
    return read_request(registers.HIGH_SPEED_VERSION, registers.HIGH_SPEED_VERSION_BYTES)


def push_request(on: bool) -> Request:
    """Return the request to start or stop the stream."""
    return write_request(registers.HIGH_SPEED_PUSH, b"\x01" if on else b"\x00")


def zero_request() -> Request:
    """Return the request to take the present readings of all modules as zero."""
    return Request(ZERO, registers.HIGH_SPEED_ZERO, 1, b"\x01")


def parse_request(buffer: bytes, at: int) -> tuple[int, Request] | Incomplete | Invalid:
    """A `Parser` of requests, for the board's end of the line."""
    frame = _whole_frame(buffer, at, REQUEST_HEAD)
    if not isinstance(frame, bytes):
        return frame
    return len(frame), Request(frame[3], _number(frame, 4), _number(frame, 6), frame[_HEADER:-1])


def parse_reply(buffer: bytes, at: int) -> tuple[int, Reply] | Incomplete | Invalid:
    """A `Parser` of replies, for the host's end of the line while nothing is streamed."""
    frame = _whole_frame(buffer, at, REPLY_HEAD)
    if not isinstance(frame, bytes):
        return frame
    return len(frame), Reply(frame[3], _number(frame, 4), frame[_HEADER:-1])


def push_parser(lengths: Container[int]) -> Parser[Push]:
    """A `Parser` of pushes, for the host's end of the line while the stream runs.

    Args:
        lengths: Permitted numbers of data bytes in a push. A frame that claims another length is rejected.
    """

    def parse(buffer: bytes, at: int) -> tuple[int, Push] | Incomplete | Invalid:
        header = buffer[at : at + _PUSH_HEADER]
        if not (PUSH_HEAD + b"\x00").startswith(header[:3]):
            return NO_FRAME
        if len(header) < 5:
            return INCOMPLETE
        length = _number(header, 3) - 1
        if length not in lengths:
            return NO_FRAME
        frame = buffer[at : at + _PUSH_HEADER + length + 1]
        if len(frame) < _PUSH_HEADER + length + 1:
            return INCOMPLETE
        if lrc(frame[:-1]) != frame[-1]:
            return BAD_CHECKSUM
        return len(frame), Push(frame[5], frame[_PUSH_HEADER:-1])

    return parse


parse_push: Parser[Push] = push_parser(range(MAX_PUSH + 1))
"""A `Parser` of pushes of any length."""


def incoming_parser(lengths: Container[int]) -> Parser[Reply | Push]:
    """A `Parser` of replies and pushes, for the time while the stream is being stopped.

    Args:
        lengths: As for `push_parser`.
    """
    parse_push = push_parser(lengths)

    def parse(buffer: bytes, at: int) -> tuple[int, Reply | Push] | Incomplete | Invalid:
        # the heads differ in the second byte; a head of one byte is left to parse_reply
        return parse_push(buffer, at) if buffer[at : at + 2] == PUSH_HEAD else parse_reply(buffer, at)

    return parse


parse_incoming: Parser[Reply | Push] = incoming_parser(range(MAX_PUSH + 1))
"""A `Parser` of replies and of pushes of any length."""


def _number(frame: bytes, at: int) -> int:
    return int.from_bytes(frame[at : at + 2], "little")


def _frame(head: bytes, function: int, register: int, count: int, data: bytes) -> bytes:
    header = bytes([0, function]) + register.to_bytes(2, "little") + count.to_bytes(2, "little")
    frame = head + header + data
    return frame + bytes([lrc(frame)])


def _whole_frame(buffer: bytes, at: int, head: bytes) -> bytes | Incomplete | Invalid:
    """Return the request or reply at `at` once it is complete; the header is checked as soon as it has arrived."""
    header = buffer[at : at + _HEADER]
    if not (head + b"\x00").startswith(header[:3]):
        return NO_FRAME
    if len(header) < 4:
        return INCOMPLETE
    function, asking = header[3], head == REQUEST_HEAD
    failed = not asking and function > ERROR_BIT
    if function not in FUNCTIONS and not failed:
        return NO_FRAME
    if len(header) < _HEADER:
        return INCOMPLETE
    count = _number(header, 6)
    if count > (MAX_READ if function == READ else MAX_WRITE) or (asking and not count):
        return NO_FRAME
    has_data = not (asking and function == READ)
    length = _HEADER + count * has_data + 1
    frame = buffer[at : at + length]
    if len(frame) < length:
        return INCOMPLETE
    return frame if lrc(frame[:-1]) == frame[-1] else BAD_CHECKSUM
