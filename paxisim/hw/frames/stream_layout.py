"""What the high-speed board streams: the data of a push, and which modules they are of. No I/O."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.hw import registers, taxels

RESULTANT_BYTES = 6
RESULTANTS, TAXELS = 1, 2
"""Bits of the data type: what is streamed."""


@dataclass(frozen=True)
class StreamLayout:
    """What the data of a push are: for each active module in ascending order its resultant, then its taxels.

    A resultant has 6 bytes, three little-endian numbers of which only the low byte counts; a taxel has 3.

    Attributes:
        modules: Numbers of the active modules, ascending.
        taxels: How many taxels each of them has.
        data_type: Which of the two parts are sent: `RESULTANTS` and `TAXELS`, added.
    """

    modules: tuple[int, ...]
    taxels: tuple[int, ...]
    data_type: int = RESULTANTS | TAXELS

    @property
    def size(self) -> int:
        """Bytes of data in every push."""
        return sum(sum(self._parts(count)) for count in self.taxels)

    def resultant_at(self, module: int) -> slice:
        """Where the resultant of an active module stands; empty if none are sent."""
        return self._at(module)[0]

    def taxels_at(self, module: int) -> slice:
        """Where the taxels of an active module stand; empty if none are sent."""
        return self._at(module)[1]

    def encode(self, resultants: Sequence[NDArray[np.int16]], readings: Sequence[NDArray[np.int16]]) -> bytes:
        """The data of a push.

        Args:
            resultants: ``(3,)`` counts of each active module.
            readings: ``(N, 3)`` counts of each active module.
        """
        parts = []
        for resultant, counts in zip(resultants, readings, strict=True):
            if self.data_type & RESULTANTS:
                parts.append(np.asarray(resultant).astype("<i2").tobytes())
            if self.data_type & TAXELS:
                parts.append(taxels.to_bytes(counts))
        return b"".join(parts)

    def _parts(self, count: int) -> tuple[int, int]:
        """Bytes of a module's resultant and of its `count` taxels."""
        return (
            RESULTANT_BYTES if self.data_type & RESULTANTS else 0,
            taxels.BYTES_PER_TAXEL * count if self.data_type & TAXELS else 0,
        )

    def _at(self, module: int) -> tuple[slice, slice]:
        place = self.modules.index(module)
        start = sum(sum(self._parts(count)) for count in self.taxels[:place])
        resultant, block = self._parts(self.taxels[place])
        return slice(start, start + resultant), slice(start + resultant, start + resultant + block)


def active_modules(bitmap: bytes) -> tuple[int, ...]:
    """Numbers of the active modules from the bytes of the register."""
    bits = int.from_bytes(bitmap, "little")
    return tuple(module for module in range(registers.HIGH_SPEED_MODULES) if bits >> module & 1)


def active_bitmap(modules: Sequence[int]) -> bytes:
    """The bytes of the register from the numbers of the active modules."""
    return sum(1 << module for module in set(modules)).to_bytes(registers.HIGH_SPEED_ACTIVE_BYTES, "little")
