"""Messages of the GEN3 serial converter, and of a GEN3 part with its own USB connection: one reply per request. No I/O.

::

    request   55 AA | L(2) | ID | 00 | FC | ADDR(4) | N(2) | data          | LRC
    reply     AA 55 | L(2) | ID | 00 | FC | ADDR(4) | N(2) | status | data | LRC
    offset    0       2      4    5    6    7         11     13

Numbers are little-endian; L is the length of the frame less 5; the LRC covers everything before it. Function FB reads N
bytes, 79 writes the N bytes of data. A reply repeats ID, FC, ADDR and N. The reply to a write has no data although it
repeats the request's N (15 bytes in total).

Failures and how they are handled:

- Real parts send status 01 with valid readings, so 00 and 01 are both good. Replies with another status may lack data.
- A damaged L could claim the following 64 kB. `reply_parser` takes the set of permitted lengths, and N must match L, so
  such a frame is rejected as soon as its header has arrived.
- Replies carry no sequence number, so a late one looks like the reply to a repeated request. The driver drains the line
  after a repetition.
- An 8-bit check byte lets one in 256 frames with changed bytes pass; header fields that must repeat the request reduce
  this rate. For lost bytes, see `FrameDecoder`.
- Functions 7A and 78 replace the firmware. This module neither encodes nor recognises them.

The write acknowledgement and the lengths were observed on hardware by the author of a public driver. The data of other
functions come from code and the vendor's example programs. This project tested nothing on a device.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from paxisim.errors import InvalidValueError
from paxisim.hw.families.registers import CONVERTER_VERSION, CONVERTER_VERSION_BYTES, CONVERTER_ZERO
from paxisim.hw.link.framing import BAD_CHECKSUM, INCOMPLETE, NO_FRAME, Incomplete, Invalid, Parser, lrc

READ = 0xFB
WRITE = 0x79
REQUEST_HEAD = b"\x55\xaa"
REPLY_HEAD = b"\xaa\x55"
MAX_WRITE = 16
"""Maximum number of bytes that a request may write; the longest known write has 1."""
MAX_READ_REPLY = 4096
"""Maximum number of data bytes in a reply if the expected number is unknown; the largest part needs 747."""
MAX_READ_REQUEST = 0xFFFF - 10
"""Maximum number of data bytes in any reply, given the 16 bits of L."""
GOOD = (0, 1)
"""Status bytes of replies with valid data."""


_HEADER = 13


@dataclass(frozen=True)
class Request:
    """A request from the host.

    Attributes:
        id: The sensor's id, its module number plus 1.
        function: `READ` or `WRITE`.
        address: Address of the first byte.
        count: Number of bytes to read or write.
        data: The bytes to write; empty for a read.
    """

    id: int
    function: int
    address: int
    count: int
    data: bytes = b""

    def encode(self) -> bytes:
        """Encode the frame.

        Raises:
            InvalidValueError: The function is neither read nor write (above all a firmware update), the count does not
                match the data, or there are too many data.
        """
        if self.function not in (READ, WRITE):
            raise InvalidValueError(
                f"function must be {READ:02X} (read) or {WRITE:02X} (write), got {self.function:02X}; "
                "7A and 78 would replace the sensor's firmware"
            )
        expected = self.count if self.function == WRITE else 0
        if len(self.data) != expected or expected > MAX_WRITE:
            raise InvalidValueError(
                f"data of function {self.function:02X} with count {self.count} must have {expected} bytes "
                f"and at most {MAX_WRITE}, got {len(self.data)}"
            )
        return _frame(REQUEST_HEAD, self, self.data)


@dataclass(frozen=True)
class Reply:
    """A reply from the sensor.

    Attributes:
        id: As in the request.
        function: As in the request.
        address: As in the request.
        count: As in the request, even for a write, whose reply has no data.
        status: Status byte; 0 and 1 mean success.
        data: The bytes read.
    """

    id: int
    function: int
    address: int
    count: int
    status: int = 0
    data: bytes = b""

    def encode(self) -> bytes:
        """Encode the frame."""
        return _frame(REPLY_HEAD, self, bytes([self.status]) + self.data)

    def answers(self, request: Request) -> bool:
        """Whether id, function, address and count equal those of `request`."""
        mine = (self.id, self.function, self.address, self.count)
        return mine == (request.id, request.function, request.address, request.count)


def read_request(id: int, address: int, count: int) -> Request:
    """Return the request for `count` bytes from `address` on."""
    return Request(id, READ, address, count)


def version_request(id: int) -> Request:
    """Return the request for the version: 100 bytes of ASCII, terminated by zeros."""
    return read_request(id, CONVERTER_VERSION, CONVERTER_VERSION_BYTES)


def zero_request(id: int) -> Request:
    """Return the request to take the sensor's present reading as zero."""
    return Request(id, WRITE, CONVERTER_ZERO, 1, b"\x01")


def answer(request: Request, data: bytes = b"", status: int = 0) -> Reply:
    """Return the reply to `request`; `data` holds the bytes read."""
    return Reply(request.id, request.function, request.address, request.count, status, data)


def parse_request(buffer: bytes, at: int) -> tuple[int, Request] | Incomplete | Invalid:
    """A `Parser` of requests, for the sensor's end of the line."""
    frame = _whole_frame(buffer, at, REQUEST_HEAD, range(MAX_WRITE + 1), extra=0)
    if not isinstance(frame, bytes):
        return frame
    return len(frame), Request(*_fields(frame), frame[_HEADER:-1])


def reply_parser(lengths: Container[int]) -> Parser[Reply]:
    """A `Parser` of replies, for the host's end of the line.

    Args:
        lengths: Permitted numbers of data bytes in a reply; 0 is for the reply to a write or to a refused read. A frame
            that claims another length is rejected.
    """

    def parse(buffer: bytes, at: int) -> tuple[int, Reply] | Incomplete | Invalid:
        frame = _whole_frame(buffer, at, REPLY_HEAD, lengths, extra=1)
        if not isinstance(frame, bytes):
            return frame
        return len(frame), Reply(*_fields(frame), frame[_HEADER], frame[_HEADER + 1 : -1])

    return parse


parse_reply = reply_parser(range(MAX_READ_REPLY + 1))


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
    """Return id, function, address and count."""
    return frame[4], frame[6], int.from_bytes(frame[7:11], "little"), int.from_bytes(frame[11:13], "little")


def _whole_frame(
    buffer: bytes, at: int, head: bytes, lengths: Container[int], extra: int
) -> bytes | Incomplete | Invalid:
    """Return the frame at `at` once it is complete; the header is checked as soon as it has arrived.

    Args:
        buffer: The bytes available.
        at: Offset at which the frame would begin.
        head: Its first two bytes.
        lengths: Permitted numbers of data bytes.
        extra: Number of bytes between header and data: 1 in a reply.
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
