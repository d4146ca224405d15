"""Progress of a long command: its current stage, the share done and the estimated time left."""

from __future__ import annotations

import sys
import threading
import time
from types import TracebackType
from typing import TextIO

from paxisim.cli.output import printable

EVERY = 0.2  # s between two updates of the line on a terminal
LOGGED = 10.0  # s between two lines of a log within one stage
SURE = 0.1  # share of the work after which the time left is estimated


class Stages:
    """Print progress: one line that changes on a terminal, or plain lines in a log.

    Use it as a context manager, and call it with the stage and the share of the work that is done.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        """Start the clock.

        Args:
            stream: Output stream; default: standard error.
        """
        self._stream = stream or sys.stderr
        self._live = self._stream.isatty()
        self._begun, self._last, self._stage, self._share, self._width = time.monotonic(), 0.0, "", 0.0, 0
        self._lock = threading.Lock()

    def __enter__(self) -> Stages:
        """Return the object itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Clear the line on a terminal."""
        if self._live and self._width:
            print("\r" + " " * self._width + "\r", end="", file=self._stream, flush=True)

    def __call__(self, stage: str, share: float) -> None:
        """Report progress; may be called from any thread.

        Args:
            stage: Description of the current stage.
            share: Share of the work that is done, from 0 to 1; it never decreases, so a smaller value has no effect.
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
