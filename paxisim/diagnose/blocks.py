"""Blocks: long arrays gone through a few frames at a time, so that what is made in between stays in the cache."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from paxisim.diagnose.noise import FloatArray

BLOCK = 50_000  # numbers at a time


def in_blocks(values: FloatArray, function: Callable[[slice], FloatArray]) -> FloatArray:
    """What a function makes of some frames of ``(T, ...)`` values at a time, put together.

    Args:
        values: What it is made of.
        function: Given frames, the same shape as `values` has for them.
    """
    out = np.empty_like(values)
    frames = max(BLOCK // max(values[:1].size, 1), 1)
    for start in range(0, len(values), frames):
        part = slice(start, start + frames)
        out[part] = function(part)
    return out
