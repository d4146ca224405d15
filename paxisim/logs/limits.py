"""How much a file may unpack to, so that a small one cannot fill the memory.

A recording of an unloaded hand is zeros, which compress several hundred times; a file that is made to do harm, many
thousand times. The limit follows from the file's size, and the environment variable `VARIABLE` (bytes) overrides it.
"""

from __future__ import annotations

import os
from pathlib import Path

from paxisim.errors import InvalidValueError

VARIABLE = "PAXISIM_MAX_UNPACKED"
AT_LEAST = 4 << 20  # bytes; a small file may be one with little but zeros in it


def most_unpacked(path: Path, ratio: int) -> int:
    """Bytes that the file may hold once it is unpacked: `ratio` times its size, and a little for small ones.

    Raises:
        InvalidValueError: The environment variable is set to no number of bytes.
        FileNotFoundError: There is no such file.
    """
    given = os.environ.get(VARIABLE)
    if given is None:
        return AT_LEAST + ratio * path.stat().st_size
    if not given.isascii() or not given.isdigit() or len(given) > 18:
        raise InvalidValueError(f"{VARIABLE} must be a number of bytes, got {given[:40]!r}")
    return int(given)


def refuse_unpacked(path: Path, size: int, most: int) -> None:
    """Raise if the file would unpack to more than the limit.

    Raises:
        InvalidValueError: `size` is more than `most` bytes.
    """
    if size > most:
        raise InvalidValueError(
            f"{path} unpacks to {size} bytes or more, expected at most {most} for a file of its size; if you trust it, "
            f"set {VARIABLE}={size} or higher"
        )
