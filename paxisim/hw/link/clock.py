"""Clocks that can be passed as arguments."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Clock interface of the driver; tests pass one that they advance themselves."""

    def monotonic(self) -> float:
        """Return the seconds since a fixed moment; never goes back."""
        ...

    def wall(self) -> float:
        """Return the seconds since 1970-01-01 UTC."""
        ...

    def sleep(self, seconds: float) -> None:
        """Wait for `seconds`."""
        ...


class SystemClock:
    """The system's clocks."""

    def monotonic(self) -> float:
        """See `Clock.monotonic`."""
        return time.monotonic()

    def wall(self) -> float:
        """See `Clock.wall`."""
        return time.time()

    def sleep(self, seconds: float) -> None:
        """See `Clock.sleep`."""
        time.sleep(seconds)
