"""Messages of the GEN1 / GEN2 control box: one request, one reply, nothing unasked. No I/O.

A request and its reply, bytes left to right, numbers little-endian::

    offset   0            4    5      6     7    8   9            11
    request  55 AA 7B 7B  0E   INDEX  MAIN  SUB SUB  LEN LEN      DATA ...  LRC  55 AA 7D 7D

    offset   0            4    5      6     7    8   9      10          12
    reply    55 AA 7B 7B  0E   INDEX  MAIN  SUB SUB  ERROR  LEN LEN     DATA ...  LRC  55 AA 7D 7D

LEN counts the bytes of DATA. The LRC covers everything from ``0E`` to the last byte of DATA, the error byte included;
head and tail are outside it. The reply to a read carries, as its DATA, ``status 7B address(2) count(2) payload``.

How reading can fail, and what happens then:

- Bytes lost or flipped: head, ``0E``, LRC and tail must all fit, so a damaged frame passes only if its LRC collides,
  which a single wrong byte never does but in LEN. What follows is found, for the search moves on by one byte.
- LEN damaged: a frame that claims a length which cannot be expected is rejected at once (`reply_parser`), one that
  claims too few bytes fails at its tail. One that claims another length that can be expected, and more than came, is
  waited for; whoever knows that the line is silent calls ``flush``.
- A head inside DATA: the frame around it is read first; inside a damaged frame the LRC and tail decide.
- Requests and replies begin alike and nothing in them tells the direction, so each end parses what it expects. The
  INDEX may stay 0 and is not relied on: a late reply is told by what it echoes.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from paxisim.errors import InvalidValueError
from paxisim.hw.framing import BAD_CHECKSUM, INCOMPLETE, NO_FRAME, Incomplete, Invalid, Parser, lrc

HEAD = bytes.fromhex("55AA7B7B")
TAIL = bytes.fromhex("55AA7D7D")
FIX = 0x0E
READ_FUNCTION = 0x7B

# MAIN, then SUB as it is printed: its first byte on the wire is the high one
VERSION = (0x60, 0xA001)
SET_MODE = (0x70, 0xC00C)
GET_MODE = (0x70, 0xC00D)
SELECT_PORT = (0x70, 0xB10A)
READ = (0x70, 0xC006)
WRITE = (0x70, 0xB002)

REQUEST_OVERHEAD = 16
REPLY_OVERHEAD = 17
REGION_OVERHEAD = 6  # status, function, address, count: before the payload of a read's reply
LONGEST_REQUEST_DATA = 64
LONGEST_REPLY_DATA = 1024  # the largest known part, 239 taxels and its resultant block, fills 753

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
    0x0C: "host id",
    0x0D: "others",
    0x10: "get",
    0x11: "execute",
    0x12: "CRC",
}
ZERO_GOOD = (0x00, 0x06)
"""Errors that zeroing answers where it works."""


def error_name(code: int) -> str:
    """An error byte for people, e.g. ``"error 0x07 (no data)"``."""
    return f"error 0x{code:02X} ({ERRORS.get(code, 'unknown')})"


@dataclass(frozen=True)
class Request:
    """What the host asks.

    Attributes:
        main: MAIN.
        sub: SUB, its first byte on the wire being the high one.
        data: Up to 65535 bytes.
        index: INDEX, which may stay 0.
    """

    main: int
    sub: int
    data: bytes = b""
    index: int = 0

    def encode(self) -> bytes:
        """The frame."""
        return _frame(bytes([FIX, self.index, self.main]) + self.sub.to_bytes(2, "big"), self.data)


@dataclass(frozen=True)
class Reply:
    """What the box answers.

    Attributes:
        main: MAIN.
        sub: SUB, its first byte on the wire being the high one.
        data: Up to 65535 bytes.
        error: One of `ERRORS`; 0 is good.
        index: INDEX.
    """

    main: int
    sub: int
    data: bytes = b""
    error: int = 0
    index: int = 0

    def encode(self) -> bytes:
        """The frame."""
        header = bytes([FIX, self.index, self.main]) + self.sub.to_bytes(2, "big") + bytes([self.error])
        return _frame(header, self.data)


@dataclass(frozen=True)
class Region:
    """The data of a read's reply.

    Attributes:
        address: Where it begins.
        payload: The bytes from there on.
        status: 0 is good.
    """

    address: int
    payload: bytes
    status: int = 0

    def encode(self) -> bytes:
        """The data of the `Reply`."""
        count = len(self.payload).to_bytes(2, "little")
        return bytes([self.status, READ_FUNCTION]) + self.address.to_bytes(2, "little") + count + self.payload


def version_request() -> Request:
    """Ask who it is; the reply's data are ASCII."""
    return Request(*VERSION)


def set_mode_request(mode: int) -> Request:
    """Set the mode, which says what parts hang on it. The reply may carry another SUB than the request."""
    return Request(*SET_MODE, bytes([mode]))


def get_mode_request() -> Request:
    """Ask for the mode; the reply's data are that one byte."""
    return Request(*GET_MODE)


def select_port_request(port: int) -> Request:
    """Choose the port that the following reads and writes mean."""
    return Request(*SELECT_PORT, bytes([port]))


def read_request(address: int, count: int) -> Request:
    """Read `count` bytes from `address`; the reply's data are a `Region`."""
    return Request(*READ, bytes([READ_FUNCTION]) + address.to_bytes(2, "little") + count.to_bytes(2, "little"))


def write_request(address: int, value: int) -> Request:
    """Write one byte of the configuration; the reply's data are a status."""
    return Request(*WRITE, bytes([address, value]))


def parse_region(data: bytes) -> Region | None:
    """The region in the data of a read's reply; None where the data are something else."""
    if len(data) < REGION_OVERHEAD or data[1] != READ_FUNCTION:
        return None
    address, count = int.from_bytes(data[2:4], "little"), int.from_bytes(data[4:6], "little")
    payload = data[REGION_OVERHEAD:]
    return Region(address, payload, data[0]) if len(payload) == count else None


def parse_request(buffer: bytes, at: int) -> tuple[int, Request] | Incomplete | Invalid:
    """A `Parser` of requests, for the box's end of the line."""
    found = _bounds(buffer, at, 9, range(LONGEST_REQUEST_DATA + 1))
    if not isinstance(found, int):
        return found
    body = buffer[at + 5 : at + found - 5]
    return found, Request(body[1], int.from_bytes(body[2:4], "big"), body[6:], body[0])


def reply_parser(lengths: Container[int]) -> Parser[Reply]:
    """A `Parser` of replies, for the host's end of the line.

    Args:
        lengths: How many bytes of data the replies to come may have; what claims another length is no frame, so that
            nothing waits for bytes that never come.
    """

    def parse(buffer: bytes, at: int) -> tuple[int, Reply] | Incomplete | Invalid:
        found = _bounds(buffer, at, 10, lengths)
        if not isinstance(found, int):
            return found
        body = buffer[at + 5 : at + found - 5]
        return found, Reply(body[1], int.from_bytes(body[2:4], "big"), body[7:], body[4], body[0])

    return parse


parse_reply: Parser[Reply] = reply_parser(range(LONGEST_REPLY_DATA + 1))
"""A `Parser` of replies of any length up to `LONGEST_REPLY_DATA`."""


def _frame(header: bytes, data: bytes) -> bytes:
    if len(data) > 0xFFFF:
        raise InvalidValueError(f"data must be at most 65535 bytes, got {len(data)}")
    covered = header + len(data).to_bytes(2, "little") + data
    return HEAD + covered + bytes([lrc(covered)]) + TAIL


def _bounds(buffer: bytes, at: int, length_at: int, lengths: Container[int]) -> int | Incomplete | Invalid:
    """The length of the frame at `at`, whose LEN stands `length_at` bytes behind its beginning."""
    start = buffer[at : at + 5]
    if not (HEAD + bytes([FIX])).startswith(start):
        return NO_FRAME
    data_at = at + length_at + 2
    if len(buffer) < data_at:
        return INCOMPLETE
    size = int.from_bytes(buffer[data_at - 2 : data_at], "little")
    if size not in lengths:
        return NO_FRAME
    tail_at = data_at + size + 1
    # a tail that has begun wrongly makes the rest not worth waiting for
    if not TAIL.startswith(buffer[tail_at : tail_at + 4]):
        return NO_FRAME
    if len(buffer) < tail_at + 4:
        return INCOMPLETE
    if lrc(buffer[at + 4 : tail_at - 1]) != buffer[tail_at - 1]:
        return BAD_CHECKSUM
    return tail_at + 4 - at
