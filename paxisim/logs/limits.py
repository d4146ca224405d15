"""Limits on what a file may ask for, so that a small malicious file cannot exhaust the memory or the user's patience.

A recording of an unloaded hand is all zeros and compresses by a factor of several hundred; a decompression bomb, by
many thousands. The limit on the unpacked size follows from the file's size, but is at most `MOST_BYTES`, or four times
the size of a larger file. The environment variable `VARIABLE` (bytes) overrides it.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

from paxisim.errors import InvalidValueError

VARIABLE = "PAXISIM_MAX_UNPACKED"
MOST_BYTES = 2 << 30
"""Limit on the unpacked size (bytes) of files that are not large themselves."""
MOST_STREAMS = 2000
"""Limit on the number of streams of a file."""
MIN_LIMIT = 4 << 20  # bytes; a small file may contain almost only zeros


def most_unpacked(path: Path, ratio: float = math.inf) -> int:
    """Return the maximum unpacked size (bytes) of the file, at most `ratio` times its size and a margin.

    Without `ratio` it is the limit on the numbers that come out of the file.

    Raises:
        InvalidValueError: The environment variable is not a number of bytes.
        FileNotFoundError: The file does not exist.
    """
    given = os.environ.get(VARIABLE)
    if given is None:
        size = path.stat().st_size
        return int(min(MIN_LIMIT + ratio * max(size, 1), max(MOST_BYTES, 4 * size)))
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


def refuse_streams(path: Path, count: int) -> None:
    """Check the number of streams that a file names.

    Raises:
        InvalidValueError: It is more than `MOST_STREAMS`.
    """
    if count > MOST_STREAMS:
        raise InvalidValueError(f"{path} has more than {MOST_STREAMS} streams, which no recording of a robot has")
