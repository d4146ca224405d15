"""Emulator: a sensor made of bytes, on a real serial port (a pseudo-terminal)."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from paxisim.hw.profile import Profile

# seconds since the emulator started -> (pads, 3, rows, cols) newtons of the profile's wire layout
Signal = Callable[[float], NDArray[np.floating]]


class Emulator:
    """Speaks a profile's protocol byte for byte on a pseudo-terminal, in a thread of its own; a context manager.

    Attributes:
        port: The name of the pseudo-terminal, to be opened as any serial port.
    """

    port: str

    def __init__(self, profile: str | Profile, signal: Signal) -> None:
        """Make it; `start` or ``with`` opens the port."""
        raise NotImplementedError

    def start(self) -> Emulator:
        """Open the port and answer."""
        raise NotImplementedError

    def stop(self) -> None:
        """Close the port."""
        raise NotImplementedError

    def __enter__(self) -> Emulator:
        """Start."""
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop."""
        self.stop()
