"""Limits on the decompressed size of a file, so that a small malicious file cannot exhaust the memory.

A recording of an unloaded hand is all zeros and compresses by a factor of several hundred; a decompression bomb, by
many thousands. The limit follows from the file's size, and the environment variable `VARIABLE` (bytes) overrides it.
"""

from __future__ import annotations

import os
from pathlib import Path

from paxisim.errors import InvalidValueError

VARIABLE = "PAXISIM_MAX_UNPACKED"
MIN_LIMIT = 4 << 20  # bytes; a small file may contain almost only zeros


def most_unpacked(path: Path, ratio: int) -> int:
    """Return the maximum decompressed size (bytes) of the file: `ratio` times its size, plus a margin for small files.

    Raises:
        InvalidValueError: The environment variable is not a number of bytes.
        FileNotFoundError: The file does not exist.
    """
    given = os.environ.get(VARIABLE)
    if given is None:
        return MIN_LIMIT + ratio * path.stat().st_size
    if not given.isascii() or not given.isdigit() or len(given) > 18:
        raise InvalidValueError(f"{VARIABLE} must be a number of bytes, got {given[:40]!r}")
    return int(given)


def refuse_unpacked(path: Path, size: int, most: int) -> None:
    """Check that the file unpacks to no more than the limit.

    Raises:
        InvalidValueError: `size` is more than `most` bytes.
    """
    if size > most:
        raise InvalidValueError(
            f"{path} unpacks to {size} bytes or more, expected at most {most} for a file of its size; if you trust it, "
            f"set {VARIABLE}={size} or higher"
        )
