"""FrameQueue: where frames wait between the thread that reads them and the one that wants them."""

from __future__ import annotations

import threading
from collections import deque

from paxisim.hw.frame import Frame


class FrameQueue:
    """Frames that wait for a caller: bounded, the oldest dropped and counted. Safe for several threads.

    Attributes:
        dropped: Frames lost because nobody read them in time.
    """

    def __init__(self, size: int) -> None:
        """Start empty.

        Args:
            size: Frames to keep.
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
        """Let every `get` raise `error`, once the frames at hand are read."""
        with self._changed:
            self._error = self._error or error
            self._changed.notify_all()

    def clear(self) -> None:
        """Throw away the frames at hand, without counting them."""
        with self._changed:
            self._frames.clear()

    def get(self, timeout: float, newest: bool = False) -> Frame | None:
        """The oldest frame, or None where none comes within `timeout` seconds.

        Args:
            timeout: Seconds; `math.inf` is without end.
            newest: Take the newest instead, and throw the others away.
        """
        with self._changed:
            # what the system calls for ever is less than infinity
            self._changed.wait_for(lambda: self._frames or self._error, min(timeout, threading.TIMEOUT_MAX))
            if self._frames:
                frame = self._frames.pop() if newest else self._frames.popleft()
                if newest:
                    self._frames.clear()
                return frame
            if self._error:
                raise self._error.with_traceback(None)
            return None
