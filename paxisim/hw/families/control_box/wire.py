"""Messages of the GEN1 / GEN2 control box: one reply per request, nothing unprompted. No I/O.

A request and its reply, with bytes from left to right and little-endian numbers::

    offset   0            4    5      6     7    8   9            11
    request  55 AA 7B 7B  0E   INDEX  MAIN  SUB SUB  LEN LEN      DATA ...  LRC  55 AA 7D 7D

    offset   0            4    5      6     7    8   9      10          12
    reply    55 AA 7B 7B  0E   INDEX  MAIN  SUB SUB  ERROR  LEN LEN     DATA ...  LRC  55 AA 7D 7D

LEN is the number of bytes of DATA. The LRC covers everything from ``0E`` to the last byte of DATA, including the error
byte, but neither head nor tail. The DATA of the reply to a read is ``status 7B address(2) count(2) payload``.

Failures and how the parser handles them:

- Bytes lost or flipped: head, ``0E``, LRC and tail must all match, so a damaged frame passes only if its LRC collides.
  A single wrong byte causes such a collision only in LEN. The next frame is found, since the search advances by one
  byte at a time.
- LEN damaged: a frame that claims an unexpected length is rejected at once (`reply_parser`), and one that claims too
  few bytes fails at its tail. If a frame claims another expected length and not all of its bytes have come, the decoder
  waits for them; a caller that knows that the line is silent calls ``flush``.
- A head inside DATA: the enclosing frame is parsed first. Inside a damaged frame, LRC and tail decide.
- Requests and replies begin alike and do not state their direction, so each end parses the kind that it expects. The
  INDEX may stay 0 and is not relied on; a late reply is recognised by the fields that it echoes.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from paxisim.errors import InvalidValueError
from paxisim.hw.link.framing import BAD_CHECKSUM, INCOMPLETE, NO_FRAME, Incomplete, Invalid, Parser, lrc

HEAD = bytes.fromhex("55AA7B7B")
TAIL = bytes.fromhex("55AA7D7D")
FIX = 0x0E
READ_FUNCTION = 0x7B

# MAIN, then SUB with its first byte on the wire as the high byte, as in the vendor's document
GET_VERSION = (0x60, 0xA001)
SET_MODE = (0x70, 0xC00C)
GET_MODE = (0x70, 0xC00D)
SELECT_PORT = (0x70, 0xB10A)
READ_REGISTERS = (0x70, 0xC006)
WRITE_REGISTERS = (0x70, 0xB002)

REQUEST_OVERHEAD = 16
REPLY_OVERHEAD = 17
REGION_OVERHEAD = 6  # status, function, address and count precede the payload of the reply to a read
MAX_REQUEST_DATA = 64
MAX_REPLY_DATA = 1024  # the largest known part, with 239 taxels and its resultant block, needs 753

ZERO_GOOD = (0x00, 0x06)
"""Errors that the box returns when zeroing works."""


@dataclass(frozen=True)
class Request:
    """A request from the host.

    Attributes:
        main: MAIN.
        sub: SUB; its first byte on the wire is the high byte.
        data: DATA, up to 65535 bytes.
        index: INDEX, which may stay 0.
    """

    main: int
    sub: int
    data: bytes = b""
    index: int = 0

    def encode(self) -> bytes:
        """Encode the frame."""
        return _frame(bytes([FIX, self.index, self.main]) + self.sub.to_bytes(2, "big"), self.data)


@dataclass(frozen=True)
class Reply:
    """A reply from the box.

    Attributes:
        main: MAIN.
        sub: SUB; its first byte on the wire is the high byte.
        data: DATA, up to 65535 bytes.
        error: One of `paxisim.hw.families.errors.CONTROL_BOX`; 0 means success.
        index: INDEX.
    """

    main: int
    sub: int
    data: bytes = b""
    error: int = 0
    index: int = 0

    def encode(self) -> bytes:
        """Encode the frame."""
        header = bytes([FIX, self.index, self.main]) + self.sub.to_bytes(2, "big") + bytes([self.error])
        return _frame(header, self.data)


@dataclass(frozen=True)
class Region:
    """The data of the reply to a read.

    Attributes:
        address: Address of the first byte.
        payload: The bytes from that address on.
        status: Status byte; 0 means success.
    """

    address: int
    payload: bytes
    status: int = 0

    def encode(self) -> bytes:
        """Encode the data of the `Reply`."""
        count = len(self.payload).to_bytes(2, "little")
        return bytes([self.status, READ_FUNCTION]) + self.address.to_bytes(2, "little") + count + self.payload


def version_request() -> Request:
    """Return the request for the version; the reply's data are ASCII."""
    return Request(*GET_VERSION)


def set_mode_request(mode: int) -> Request:
    """Return the request to set the mode, which selects the kind of parts connected.

    The SUB of the reply may differ from the request's.
    """
    return Request(*SET_MODE, bytes([mode]))


def get_mode_request() -> Request:
    """Return the request for the mode; the reply's data are that single byte."""
    return Request(*GET_MODE)


def select_port_request(port: int) -> Request:
    """Return the request to select the port for the reads and writes that follow."""
    return Request(*SELECT_PORT, bytes([port]))


def read_request(address: int, count: int) -> Request:
    """Return the request for `count` bytes from `address` on; the reply's data are a `Region`."""
    return Request(
        *READ_REGISTERS, bytes([READ_FUNCTION]) + address.to_bytes(2, "little") + count.to_bytes(2, "little")
    )


def write_request(address: int, value: int) -> Request:
    """Return the request to write one configuration byte; the reply's data are a status."""
    return Request(*WRITE_REGISTERS, bytes([address, value]))


def parse_region(data: bytes) -> Region | None:
    """Return the region in the data of the reply to a read; None if the data are something else."""
    if len(data) < REGION_OVERHEAD or data[1] != READ_FUNCTION:
        return None
    address, count = int.from_bytes(data[2:4], "little"), int.from_bytes(data[4:6], "little")
    payload = data[REGION_OVERHEAD:]
    return Region(address, payload, data[0]) if len(payload) == count else None


def parse_request(buffer: bytes, at: int) -> tuple[int, Request] | Incomplete | Invalid:
    """A `Parser` of requests, for the box's end of the line."""
    found = _bounds(buffer, at, 9, range(MAX_REQUEST_DATA + 1))
    if not isinstance(found, int):
        return found
    body = buffer[at + 5 : at + found - 5]
    return found, Request(body[1], int.from_bytes(body[2:4], "big"), body[6:], body[0])


def reply_parser(lengths: Container[int]) -> Parser[Reply]:
    """A `Parser` of replies, for the host's end of the line.

    Args:
        lengths: Permitted numbers of data bytes. A reply that claims another length is rejected, so the decoder never
            waits for bytes that do not come.
    """

    def parse(buffer: bytes, at: int) -> tuple[int, Reply] | Incomplete | Invalid:
        found = _bounds(buffer, at, 10, lengths)
        if not isinstance(found, int):
            return found
        body = buffer[at + 5 : at + found - 5]
        return found, Reply(body[1], int.from_bytes(body[2:4], "big"), body[7:], body[4], body[0])

    return parse


parse_reply: Parser[Reply] = reply_parser(range(MAX_REPLY_DATA + 1))
"""A `Parser` of replies of any length up to `MAX_REPLY_DATA`."""


def _frame(header: bytes, data: bytes) -> bytes:
    if len(data) > 0xFFFF:
        raise InvalidValueError(f"data must be at most 65535 bytes, got {len(data)}")
    covered = header + len(data).to_bytes(2, "little") + data
    return HEAD + covered + bytes([lrc(covered)]) + TAIL


def _bounds(buffer: bytes, at: int, length_at: int, lengths: Container[int]) -> int | Incomplete | Invalid:
    """Return the length of the frame at `at`; its LEN is `length_at` bytes after its beginning."""
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
    # if the tail already mismatches, waiting for the rest is pointless
    if not TAIL.startswith(buffer[tail_at : tail_at + 4]):
        return NO_FRAME
    if len(buffer) < tail_at + 4:
        return INCOMPLETE
    if lrc(buffer[at + 4 : tail_at - 1]) != buffer[tail_at - 1]:
        return BAD_CHECKSUM
    return tail_at + 4 - at
