"""Taxels on the wire: three bytes each, the same in all PaXini families of boards. No I/O.

A taxel is x, y (signed) and z (unsigned: a pad is never pulled). Some firmware of the GEN1 hand board sends z signed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BYTES_PER_TAXEL = 3


def to_counts(data: bytes, signed_normal: bool = False) -> NDArray[np.int16]:
    """Convert ``3 N`` bytes to ``(N, 3)`` int16 counts.

    Args:
        data: Bytes of whole taxels.
        signed_normal: Whether to read z as signed, as some firmware sends it.
    """
    raw = np.frombuffer(data, dtype=np.int8).reshape(-1, 3)
    counts = raw.astype(np.int16)
    if not signed_normal:
        counts[:, 2] &= 0xFF
    return counts


def to_bytes(counts: NDArray[np.integer]) -> bytes:
    """Convert ``(N, 3)`` counts to ``3 N`` bytes. Counts outside a byte (-128..127, 0..255) wrap: clip them before."""
    return (np.asarray(counts, dtype=np.int16) & 0xFF).astype(np.uint8).tobytes()
