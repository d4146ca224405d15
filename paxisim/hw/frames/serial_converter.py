"""Messages of the GEN3 serial converter, and of a GEN3 part on its own USB: one request, one reply.

::

    request   55 AA | L(2) | ID | 00 | FC | ADDR(4) | N(2) | data          | LRC
    reply     AA 55 | L(2) | ID | 00 | FC | ADDR(4) | N(2) | status | data | LRC
    offset    0       2      4    5    6    7         11     13

Numbers are little-endian; L is the length of the frame less 5; the LRC covers everything before it. Function FB reads N
bytes, 79 writes the N bytes of data. A reply repeats ID, FC, ADDR and N; that to a write has no data although N is what
the request said (15 bytes).

How it fails, and what is done about it:

- Status 01 comes with valid readings on real parts: 00 and 01 are both good. Replies with another status may lack data.
- A damaged L could claim the following 64 kB. `reply_parser` takes the lengths that can be expected, and N must fit L,
  so such a frame is given up as soon as its header is there.
- Replies carry no sequence number: a late one looks like the answer to a repeated request. The board reads the line
  empty after a repetition.
- An 8-bit check lets one frame in 256 with changed bytes pass; header fields that must repeat the request lower that.
  Lost bytes are another matter, see `FrameDecoder`.
- Functions 7A and 78 replace the firmware. They are not built, not encoded and not recognised here.

The write acknowledgement and the lengths were observed on hardware by the author of a public driver; the data of other
functions are from code and the vendor's example programs. This project tried nothing on a device.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from paxisim.errors import InvalidValueError
from paxisim.hw.framing import BAD_CHECKSUM, INCOMPLETE, NO_FRAME, Incomplete, Invalid, Parser, lrc
from paxisim.hw.registers import CONVERTER_VERSION, CONVERTER_VERSION_BYTES, CONVERTER_ZERO

READ = 0xFB
WRITE = 0x79
REQUEST_HEAD = b"\x55\xaa"
REPLY_HEAD = b"\xaa\x55"
LONGEST_WRITE = 16
"""Bytes that a request may write; the longest known write has 1."""
LONGEST_READ = 4096
"""Bytes that a reply may bring where nobody says how many are expected; the largest part needs 747."""
MOST_READ = 0xFFFF - 10
"""Bytes that a reply can bring at all, with an L of 16 bits."""
GOOD = (0, 1)
"""Status bytes of replies whose data are valid."""

ERRORS = {
    0x00: "ok",
    0x01: "length",
    0x02: "check byte",
    0x03: "main command",
    0x04: "sub command",
    0x05: "overflow",
    0x06: "parameter",
    0x07: "no data",
    0x0A: "arrangement",
}

_HEADER = 13


def error_name(status: int) -> str:
    """A status byte for people, e.g. ``"error 0x07 (no data)"``."""
    return f"error 0x{status:02X} ({ERRORS.get(status, 'unknown')})"


@dataclass(frozen=True)
class Request:
    """What the host asks of the sensor.

    Attributes:
        id: The sensor's id, its module number plus 1.
        function: `READ` or `WRITE`.
        address: Of the first byte.
        count: Bytes to read or write.
        data: The bytes to write; empty when reading.
    """

    id: int
    function: int
    address: int
    count: int
    data: bytes = b""

    def encode(self) -> bytes:
        """The frame.

        Raises:
            InvalidValueError: Another function than reading and writing, above all a firmware update; a count that is
                not that of the data; too much data.
        """
        if self.function not in (READ, WRITE):
            raise InvalidValueError(
                f"function must be {READ:02X} (read) or {WRITE:02X} (write), got {self.function:02X}; "
                "7A and 78 would replace the sensor's firmware"
            )
        expected = self.count if self.function == WRITE else 0
        if len(self.data) != expected or expected > LONGEST_WRITE:
            raise InvalidValueError(
                f"data of function {self.function:02X} with count {self.count} must have {expected} bytes "
                f"and at most {LONGEST_WRITE}, got {len(self.data)}"
            )
        return _frame(REQUEST_HEAD, self, self.data)


@dataclass(frozen=True)
class Reply:
    """What the sensor answers.

    Attributes:
        id: As in the request.
        function: As in the request.
        address: As in the request.
        count: As in the request, for a write as well, which brings no data.
        status: 0 and 1 are good.
        data: The bytes read.
    """

    id: int
    function: int
    address: int
    count: int
    status: int = 0
    data: bytes = b""

    def encode(self) -> bytes:
        """The frame."""
        return _frame(REPLY_HEAD, self, bytes([self.status]) + self.data)

    def answers(self, request: Request) -> bool:
        """Whether id, function, address and count are those of `request`."""
        mine = (self.id, self.function, self.address, self.count)
        return mine == (request.id, request.function, request.address, request.count)


def read_request(id: int, address: int, count: int) -> Request:
    """The request for `count` bytes from `address` on."""
    return Request(id, READ, address, count)


def version_request(id: int) -> Request:
    """The request for the version: 100 bytes of ASCII, ended by zeros."""
    return read_request(id, CONVERTER_VERSION, CONVERTER_VERSION_BYTES)


def zero_request(id: int) -> Request:
    """The request to take what the sensor reads now as zero."""
    return Request(id, WRITE, CONVERTER_ZERO, 1, b"\x01")


def answer(request: Request, data: bytes = b"", status: int = 0) -> Reply:
    """The reply to `request`; `data` are the bytes read."""
    return Reply(request.id, request.function, request.address, request.count, status, data)


def parse_request(buffer: bytes, at: int) -> tuple[int, Request] | Incomplete | Invalid:
    """The request at `at`, for `FrameDecoder`: the sensor's side."""
    frame = _whole_frame(buffer, at, REQUEST_HEAD, range(LONGEST_WRITE + 1), extra=0)
    if not isinstance(frame, bytes):
        return frame
    return len(frame), Request(*_fields(frame), frame[_HEADER:-1])


def reply_parser(lengths: Container[int]) -> Parser[Reply]:
    """A parser of replies, for `FrameDecoder`.

    Args:
        lengths: How many bytes of data a reply can have; 0 is that of a reply to a write, or to a read that is refused.
            What claims another length is no frame.
    """

    def parse(buffer: bytes, at: int) -> tuple[int, Reply] | Incomplete | Invalid:
        frame = _whole_frame(buffer, at, REPLY_HEAD, lengths, extra=1)
        if not isinstance(frame, bytes):
            return frame
        return len(frame), Reply(*_fields(frame), frame[_HEADER], frame[_HEADER + 1 : -1])

    return parse


parse_reply = reply_parser(range(LONGEST_READ + 1))


def _frame(head: bytes, message: Request | Reply, body: bytes) -> bytes:
    frame = (
        head
        + (_HEADER + len(body) + 1 - 5).to_bytes(2, "little")
        + bytes([message.id, 0, message.function])
        + message.address.to_bytes(4, "little")
        + message.count.to_bytes(2, "little")
        + body
    )
    return frame + bytes([lrc(frame)])


def _fields(frame: bytes) -> tuple[int, int, int, int]:
    """Id, function, address and count."""
    return frame[4], frame[6], int.from_bytes(frame[7:11], "little"), int.from_bytes(frame[11:13], "little")


def _whole_frame(
    buffer: bytes, at: int, head: bytes, lengths: Container[int], extra: int
) -> bytes | Incomplete | Invalid:
    """The frame at `at` once it is whole; its header is judged as soon as it is there.

    Args:
        buffer: The bytes at hand.
        at: Where the frame would begin.
        head: Its first two bytes.
        lengths: How many bytes of data it can have.
        extra: Bytes between header and data: 1 in a reply.
    """
    header = buffer[at : at + _HEADER]
    if header[:2] != head[: len(header)]:
        return NO_FRAME
    if len(header) < 4:
        return INCOMPLETE
    count = int.from_bytes(header[2:4], "little") + 5 - _HEADER - extra - 1
    if count not in lengths or (len(header) > 5 and header[5] != 0):
        return NO_FRAME
    if len(header) < _HEADER:
        return INCOMPLETE
    function, stated = header[6], int.from_bytes(header[11:13], "little")
    if function not in (READ, WRITE):
        return NO_FRAME
    brings_data = function == (READ if extra else WRITE)
    refused = extra and count == 0
    if count != (stated if brings_data else 0) and not refused:
        return NO_FRAME
    frame = buffer[at : at + _HEADER + extra + count + 1]
    if len(frame) < _HEADER + extra + count + 1:
        return INCOMPLETE
    return frame if lrc(frame[:-1]) == frame[-1] else BAD_CHECKSUM
