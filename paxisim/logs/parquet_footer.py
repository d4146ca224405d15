"""parquet_footer: the declared number of values in each column of a Parquet file, read before unpacking any.

The footer at the end of the file describes it in Thrift's compact protocol. pyarrow can read it too, but aborts the
process if the file is damaged.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_MAGIC = b"PAR1"
_TEXT = 6  # the physical type BYTE_ARRAY


@dataclass(frozen=True)
class ColumnChunk:
    """Part of a column within a row group.

    Attributes:
        path: Name of the column, followed by the names of its nested fields.
        is_text: Whether the values are text or bytes.
        values: Number of values.
        size: Uncompressed size of its pages in bytes.
    """

    path: tuple[str, ...]
    is_text: bool
    values: int
    size: int


def column_chunks(path: Path) -> list[ColumnChunk]:
    """Return the column chunks of the file.

    Raises:
        ValueError: The file does not end with a valid Parquet footer.
    """
    with open(path, "rb") as file:
        end = file.seek(0, 2)
        file.seek(max(end - 8, 0))
        tail = file.read(8)
        length = struct.unpack("<I", tail[:4])[0] if len(tail) == 8 else end
        if tail[4:] != _MAGIC or length > end - 8:
            raise ValueError("it does not end with a Parquet footer")
        file.seek(end - 8 - length)
        footer = _Compact(file.read(length))
    try:
        about = footer.struct(_FILE)
        return [_chunk(column[3]) for group in about.get(4, ()) for column in group.get(1, ()) if 3 in column]
    except (LookupError, TypeError, AttributeError, RecursionError, UnicodeDecodeError) as error:
        raise ValueError("its footer is damaged") from error


def _chunk(about: Mapping[int, Any]) -> ColumnChunk:
    names = tuple(name.decode() for name in about[3])
    return ColumnChunk(names, about[1] == _TEXT, max(about[5], 0), max(about[6], 0))


# the fields to keep, by their numbers in Parquet's Thrift definition: None for a number or text; for a struct or a list
# of structs, a mapping of its fields
_Wanted = Mapping[int, Any]
_FILE: _Wanted = {4: {1: {3: {1: None, 3: None, 5: None, 6: None}}}}


class _Compact:
    """Reader of Thrift's compact protocol; raises IndexError if the data end too early."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0
        integer = self._integer
        self._readers: dict[int, Callable[[_Wanted | None], Any]] = {
            **{1: lambda _: True, 2: lambda _: False, 3: lambda _: self._bytes(1)},
            **{4: lambda _: integer(), 5: lambda _: integer(), 6: lambda _: integer(), 7: lambda _: self._bytes(8)},
            **{8: lambda _: self._bytes(self._varint()), 9: self._list, 10: self._list, 11: self._map},
            **{12: self.struct, 13: lambda _: self._bytes(16)},
        }

    def struct(self, wanted: _Wanted | None) -> dict[int, Any]:
        """Read a struct and return its wanted fields by their numbers."""
        found, number = {}, 0
        while head := self._bytes(1)[0]:
            number = number + (head >> 4) if head >> 4 else self._integer()
            is_wanted = wanted is not None and number in wanted
            value = self._readers[head & 15](wanted[number] if is_wanted else None)  # type: ignore[index]
            if is_wanted:
                found[number] = value
        return found

    def _list(self, wanted: _Wanted | None) -> list[Any]:
        head = self._bytes(1)[0]
        size, kind = head >> 4, head & 15
        size = self._varint() if size == 15 else size
        if size > len(self._data):
            raise IndexError
        read = self._readers[3 if kind in (1, 2) else kind]
        return [read(wanted) for _ in range(size)]

    def _map(self, _: _Wanted | None) -> None:
        size = self._varint()
        kinds = self._bytes(1)[0] if size else 0
        for _i in range(size):
            for kind in (kinds >> 4, kinds & 15):
                self._readers[3 if kind in (1, 2) else kind](None)

    def _bytes(self, count: int) -> bytes:
        found = self._data[self._at : self._at + count]
        if len(found) < count:
            raise IndexError
        self._at += count
        return found

    def _varint(self) -> int:
        value = shift = 0
        while True:
            byte = self._bytes(1)[0]
            value |= (byte & 127) << shift
            if byte < 128:
                return value
            shift += 7
            if shift > 63:
                raise IndexError

    def _integer(self) -> int:
        value = self._varint()
        return (value >> 1) ^ -(value & 1)
