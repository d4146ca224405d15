"""Stages: what a long command is at, how far it is, and how long it may still take."""

from __future__ import annotations

import sys
import threading
import time
from types import TracebackType
from typing import TextIO

from paxisim.cli.output import printable

EVERY = 0.2  # s between two changes of the line on a terminal
LOGGED = 10.0  # s between two lines of a log within a stage
SURE = 0.1  # share of the work, from which on the time left is estimated


class Stages:
    """Prints progress: one line that changes on a terminal, and plain lines in a log.

    Used as a context manager, and called with the stage and the share of the work that is done.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        """Start the clock.

        Args:
            stream: Where to print; default: standard error.
        """
        self._stream = stream or sys.stderr
        self._live = self._stream.isatty()
        self._begun, self._last, self._stage, self._share, self._width = time.monotonic(), 0.0, "", 0.0, 0
        self._lock = threading.Lock()

    def __enter__(self) -> Stages:
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Clear the line on a terminal."""
        if self._live and self._width:
            print("\r" + " " * self._width + "\r", end="", file=self._stream, flush=True)

    def __call__(self, stage: str, share: float) -> None:
        """Say where the work is; from any thread.

        Args:
            stage: In words.
            share: Of the work, from 0 to 1; less than said before counts as that.
        """
        with self._lock:
            now = time.monotonic()
            self._share = max(self._share, min(share, 1.0))
            if stage == self._stage and now - self._last < (EVERY if self._live else LOGGED):
                return
            self._stage, self._last = stage, now
            line = f"{self._share:4.0%} {stage}{self._left(now - self._begun)}"
            if self._live:
                print("\r" + printable(line).ljust(self._width), end="", file=self._stream, flush=True)
                self._width = len(line)
            else:
                print(printable(line), file=self._stream, flush=True)

    def _left(self, spent: float) -> str:
        if self._share < SURE:
            return ""
        left = spent * (1 - self._share) / self._share
        return f", about {left:.0f} s left" if left < 90 else f", about {left / 60:.0f} min left"
