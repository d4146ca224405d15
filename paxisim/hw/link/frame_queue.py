"""FrameQueue: a bounded queue between the thread that reads frames and the one that takes them."""

from __future__ import annotations

import threading
from collections import deque

from paxisim.hw.frame import Frame


class FrameQueue:
    """Bounded queue of frames; drops and counts the oldest when full. Thread-safe.

    Attributes:
        dropped: Number of frames lost because they were not read in time.
    """

    def __init__(self, size: int) -> None:
        """Start empty.

        Args:
            size: Maximum number of frames.
        """
        self.dropped = 0
        self._frames: deque[Frame] = deque(maxlen=size)
        self._error: Exception | None = None
        self._changed = threading.Condition()

    def put(self, frame: Frame) -> None:
        """Add the newest frame."""
        with self._changed:
            self.dropped += len(self._frames) == self._frames.maxlen
            self._frames.append(frame)
            self._changed.notify()

    def fail(self, error: Exception) -> None:
        """Make every `get` raise `error` once the queued frames have been read."""
        with self._changed:
            self._error = self._error or error
            self._changed.notify_all()

    def clear(self) -> None:
        """Discard the queued frames without counting them."""
        with self._changed:
            self._frames.clear()

    def get(self, timeout: float, newest: bool = False) -> Frame | None:
        """Return the oldest frame, or None if none arrives within `timeout` seconds.

        Args:
            timeout: Maximum waiting time (s); `math.inf` waits without limit.
            newest: Whether to return the newest frame instead and discard the others.
        """
        with self._changed:
            # the system accepts no timeout above this maximum
            self._changed.wait_for(lambda: self._frames or self._error, min(timeout, threading.TIMEOUT_MAX))
            if self._frames:
                frame = self._frames.pop() if newest else self._frames.popleft()
                if newest:
                    self._frames.clear()
                return frame
            if self._error:
                raise self._error.with_traceback(None)
            return None
