"""McapRecords: the records of an MCAP file, as far as it is whole."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.writer import MCAP0_MAGIC

from paxisim.errors import InvalidValueError
from paxisim.logs.limits import most_unpacked, refuse_unpacked

_RECORD = struct.Struct("<BQ")  # opcode, length
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, start of the summary, of its offsets, checksum
_RATIO = 1000  # of what a chunk unpacks to; that of 28 pads at rest, whose numbers are zeros, is 400
_CHECKSUM = struct.Struct("<I")
# what parsing a damaged record may raise; decompressors raise subclasses of Exception of their own
DAMAGE = (
    McapError,
    struct.error,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
    MemoryError,
    zlib.error,
)


class McapRecords:
    """The records of a file, to be gone through once; the file may end anywhere, and have damaged chunks.

    Chunks are opened one by one. The channels and schemas of the summary come first, as else they are lost with the
    chunk that has them.

    Attributes:
        damaged: A chunk could not be read.
        has_footer: The records reached the one that ends a file.
    """

    def __init__(self, path: Path) -> None:
        """Remember the path; the file is opened when the records are gone through."""
        self._path = path
        self._most = self._unpacked = 0
        self.damaged = self.has_footer = self._ends_well = False

    @property
    def is_whole(self) -> bool:
        """The end was reached, and every chunk read."""
        return self._ends_well and not self.damaged

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """Opcode and body of each record.

        Raises:
            InvalidValueError: It is no MCAP file, or unpacks to more than `paxisim.logs.limits` allows.
            FileNotFoundError: There is no such file.
        """
        with open(self._path, "rb") as file:
            size = self._path.stat().st_size
            self._most = most_unpacked(self._path, _RATIO)
            head = file.read(len(MCAP0_MAGIC))
            if head != MCAP0_MAGIC:
                raise InvalidValueError(_not_mcap(self._path, head))
            for opcode, body in _summary(file, size):
                if opcode in (Opcode.CHANNEL, Opcode.SCHEMA):
                    yield opcode, body
            file.seek(len(MCAP0_MAGIC))
            for opcode, body in _records(file, size):
                if opcode == Opcode.CHUNK:
                    yield from self._in_chunk(body)
                else:
                    self.has_footer |= opcode == Opcode.FOOTER
                    yield opcode, body
            self._ends_well = self.has_footer and file.read(len(MCAP0_MAGIC)) == MCAP0_MAGIC

    def _in_chunk(self, body: bytes) -> Iterator[tuple[int, bytes]]:
        try:
            chunk = Chunk.read(as_stream(body))
            data = unpacked(chunk, self._most - self._unpacked)
            if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
                raise ValueError("a check sum that does not fit")
        except UnpackedTooLarge as error:
            refuse_unpacked(self._path, self._unpacked + error.size, self._most)
            raise
        except Exception:  # each decompressor has an error of its own, and more than one
            self.damaged = True
            return
        self._unpacked += len(data)
        yield from _records(io.BytesIO(data), len(data))


class UnpackedTooLarge(Exception):
    """A chunk unpacks to more than it may."""

    def __init__(self, size: int) -> None:
        """With the least number of bytes that it unpacks to."""
        self.size = size


def unpacked(chunk: Chunk, most: int) -> bytes:
    """The records of a chunk; no more than `most` bytes are unpacked, whatever the chunk says of itself.

    Raises:
        UnpackedTooLarge: There is more.
        Exception: Whatever the decompressor raises for damaged data.
    """
    if chunk.compression == "zstd":
        import zstandard

        # room for what the data say is made only where that is little; else it grows with what is there
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
            data = _at_most(reader.read, most)
    elif chunk.compression == "lz4":
        import lz4.frame

        with lz4.frame.LZ4FrameFile(io.BytesIO(chunk.data)) as reader:
            data = _at_most(reader.read, most)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise ValueError(f"compression {chunk.compression!r}")
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"{len(data)} bytes instead of {chunk.uncompressed_size}")
    return data


def _at_most(read: Callable[[int], bytes], most: int) -> bytes:
    parts = bytearray()
    while part := read(1 << 16):
        parts += part
        if len(parts) > most:
            raise UnpackedTooLarge(len(parts))
    return bytes(parts)


def as_stream(body: bytes) -> Any:
    """A record's body as mcap's own records read it."""
    from mcap.data_stream import ReadDataStream

    return ReadDataStream(io.BytesIO(body))


def _summary(file: io.BufferedReader, size: int) -> list[tuple[int, bytes]]:
    """The records at the end that repeat the channels, which else are lost with the chunk that has them; often none."""
    end = len(MCAP0_MAGIC) + _FOOTER.size
    if size < end + len(MCAP0_MAGIC):
        return []
    file.seek(size - end)
    footer = file.read(_FOOTER.size)
    opcode, length, start, _, checksum = _FOOTER.unpack(footer)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _RECORD.size or not 0 < start < size - end:
        return []
    file.seek(start)
    summary = file.read(size - end - start)
    if zlib.crc32(summary + footer[: -_CHECKSUM.size]) != checksum:
        return []
    return list(_records(io.BytesIO(summary), len(summary)))


def _records(file: io.BufferedIOBase | io.BufferedReader, size: int) -> Iterator[tuple[int, bytes]]:
    """The records of a file or chunk that are there whole, up to the footer."""
    while True:
        head = file.read(_RECORD.size)
        if len(head) < _RECORD.size:
            return
        opcode, length = _RECORD.unpack(head)
        # no record has opcode 0: it is what a disk that lost its power leaves at the end of a file
        if opcode == 0 or length > size - file.tell():
            return
        yield opcode, file.read(length)
        if opcode == Opcode.FOOTER:
            return


def _not_mcap(path: Path, head: bytes) -> str:
    if not head:
        return f"{path} is empty"
    kinds = {b"PK": "a zip or npz file", b"PAR1": "a Parquet file", b"#ROSBAG": "a ROS 1 bag", b"SQLite": "a ROS 2 bag"}
    kind = next((kind for start, kind in kinds.items() if head.startswith(start)), "")
    if MCAP0_MAGIC.startswith(head):
        return f"{path} is an MCAP file that ends before it says what it holds"
    return f"{path} is not an MCAP file" + (f" but {kind}" if kind else f": it begins with {head!r}")
