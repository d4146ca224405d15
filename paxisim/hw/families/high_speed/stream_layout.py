"""Layout of the data in the high-speed board's pushes, and the register of its active modules. No I/O."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.hw.families import registers, taxels

RESULTANT_BYTES = 6
RESULTANTS, TAXELS = 1, 2
"""Bits of the data type, which selects what is streamed."""


@dataclass(frozen=True)
class StreamLayout:
    """Layout of the data in a push: the resultant and then the taxels of each active module, in ascending order.

    A resultant has 6 bytes, three little-endian 16-bit numbers of which only the low byte is used; a taxel has 3 bytes.

    Attributes:
        modules: Numbers of the active modules, ascending.
        taxels: Number of taxels of each active module.
        data_type: Which parts are sent: the sum of `RESULTANTS` and `TAXELS`, or one of them.
    """

    modules: tuple[int, ...]
    taxels: tuple[int, ...]
    data_type: int = RESULTANTS | TAXELS

    @property
    def size(self) -> int:
        """Number of data bytes in every push."""
        return sum(sum(self._parts(count)) for count in self.taxels)

    def resultant_at(self, module: int) -> slice:
        """Return the slice of an active module's resultant; empty if resultants are not sent."""
        return self._at(module)[0]

    def taxels_at(self, module: int) -> slice:
        """Return the slice of an active module's taxels; empty if taxels are not sent."""
        return self._at(module)[1]

    def encode(self, resultants: Sequence[NDArray[np.int16]], readings: Sequence[NDArray[np.int16]]) -> bytes:
        """Encode the data of a push.

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
        """Return the number of bytes of a module's resultant and of its `count` taxels."""
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
    """Return the numbers of the active modules, given the bytes of the register."""
    bits = int.from_bytes(bitmap, "little")
    return tuple(module for module in range(registers.HIGH_SPEED_MODULES) if bits >> module & 1)


def active_bitmap(modules: Sequence[int]) -> bytes:
    """Return the bytes of the register, given the numbers of the active modules."""
    return sum(1 << module for module in set(modules)).to_bytes(registers.HIGH_SPEED_ACTIVE_BYTES, "little")
