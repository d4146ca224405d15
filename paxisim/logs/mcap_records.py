"""McapRecords: the records in the intact part of an MCAP file."""

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
_RATIO = 1000  # limit on the compression ratio; 28 pads at rest, whose values are all zeros, reach 400
_CHECKSUM = struct.Struct("<I")
# errors from parsing a damaged record; decompressors raise their own subclasses of Exception
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
    """Records of a file, for a single iteration; the file may be truncated and have damaged chunks.

    Chunks are opened one by one. The channels and schemas of the summary come first, because they would otherwise be
    lost if the chunk that contains them is damaged.

    Attributes:
        damaged: Whether a chunk could not be read.
        has_footer: Whether the footer was reached, the record that ends a file.
    """

    def __init__(self, path: Path) -> None:
        """Store the path; the file is opened on iteration."""
        self._path = path
        self._most = self._unpacked = 0
        self.damaged = self.has_footer = self._ends_well = False

    @property
    def is_whole(self) -> bool:
        """Whether the end was reached and every chunk could be read."""
        return self._ends_well and not self.damaged

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """Yield the opcode and body of each record.

        Raises:
            InvalidValueError: The file is not an MCAP file, or unpacks to more than `paxisim.logs.limits` allows.
            FileNotFoundError: The file does not exist.
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
                raise ValueError("the checksum does not match")
        except UnpackedTooLarge as error:
            refuse_unpacked(self._path, self._unpacked + error.size, self._most)
            raise
        except Exception:  # each decompressor raises several errors of its own
            self.damaged = True
            return
        self._unpacked += len(data)
        yield from _records(io.BytesIO(data), len(data))


class UnpackedTooLarge(Exception):
    """A chunk unpacks to more than the limit."""

    def __init__(self, size: int) -> None:
        """Store the size (bytes) that the chunk unpacks to at least."""
        self.size = size


def unpacked(chunk: Chunk, most: int) -> bytes:
    """Return the records of a chunk; whatever size it declares, unpacking stops once `most` bytes are exceeded.

    Raises:
        UnpackedTooLarge: The chunk unpacks to more than `most` bytes.
        Exception: Any error of the decompressor for damaged data.
    """
    if chunk.compression == "zstd":
        import zstandard

        # streaming allocates memory as data arrive, not by the declared size
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
    """Wrap a record's body in the stream from which mcap's record classes read."""
    from mcap.data_stream import ReadDataStream

    return ReadDataStream(io.BytesIO(body))


def _summary(file: io.BufferedReader, size: int) -> list[tuple[int, bytes]]:
    """Return the records of the summary at the end, which repeats schemas and channels; empty if there is none."""
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
    """Yield the complete records of a file or chunk, up to the footer."""
    while True:
        head = file.read(_RECORD.size)
        if len(head) < _RECORD.size:
            return
        opcode, length = _RECORD.unpack(head)
        # opcode 0 is no record: a disk that lost power leaves zeros at the end of a file
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
        return f"{path} is an MCAP file that ends before its description"
    return f"{path} is not an MCAP file" + (f" but {kind}" if kind else f": it begins with {head!r}")
