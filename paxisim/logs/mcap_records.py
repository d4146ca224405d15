"""McapRecords: the records of an MCAP file, as far as it is whole."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from paxisim.errors import InvalidValueError

_RECORD = struct.Struct("<BQ")  # opcode, length
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, start of the summary, of its offsets, checksum
_CHECKSUM = struct.Struct("<I")
# what parsing a damaged record may raise; decompressors raise subclasses of Exception of their own
DAMAGE = (McapError, struct.error, ValueError, LookupError, TypeError, OverflowError, zlib.error)


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
        self.damaged = self.has_footer = self._ends_well = False

    @property
    def is_whole(self) -> bool:
        """The end was reached, and every chunk read."""
        return self._ends_well and not self.damaged

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """Opcode and body of each record.

        Raises:
            InvalidValueError: It is no MCAP file.
            FileNotFoundError: There is no such file.
        """
        with open(self._path, "rb") as file:
            size = self._path.stat().st_size
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
            stream, size = get_chunk_data_stream(Chunk.read(as_stream(body)), validate_crc=True)
        except Exception:  # each decompressor has an error of its own, and more than one
            self.damaged = True
            return
        yield from _records(io.BytesIO(stream.read(size)), size)


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
