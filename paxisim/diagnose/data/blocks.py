"""Blocks: process long arrays a few frames at a time, so that temporaries stay in the cache."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from paxisim.diagnose.data.noise import FloatArray

BLOCK_VALUES = 40_000  # values per block


def in_blocks(values: FloatArray, function: Callable[[slice], FloatArray]) -> FloatArray:
    """Apply a function to ``(T, ...)`` values block by block and concatenate the results.

    Args:
        values: Array that gives the shape of the result; the function is expected to close over its data.
        function: Takes a slice of frames and returns an array with the shape of `values` for that slice.
    """
    out = np.empty_like(values)
    frames = max(BLOCK_VALUES // max(values[:1].size, 1), 1)
    for start in range(0, len(values), frames):
        part = slice(start, start + frames)
        out[part] = function(part)
    return out
