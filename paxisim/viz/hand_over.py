"""HandOver: a queue that passes values to a slower thread without making the producer wait."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from paxisim.errors import InvalidValueError

Value = TypeVar("Value")


class HandOver(Generic[Value]):
    """A bounded queue between a producer that must not wait and a consumer that may be slow; newer values win.

    The consumer is called in its own thread with all values received since its last call. Processing several values
    together is cheaper, so the calls are at least `period` apart.

    Attributes:
        given: Number of values put into the queue.
        taken: Number of values that the consumer has processed.
        dropped: Number of values dropped, because the queue was full or the rate was exceeded.
    """

    def __init__(
        self, consume: Callable[[list[Value], int], None], size: int, period: float = 0.0, rate: float | None = None
    ) -> None:
        """Start the consumer's thread.

        Args:
            consume: Called with one or more values, oldest first, and the number of values given so far.
            size: Maximum number of queued values; when the queue is full, a new value replaces the oldest.
            period: Pause between two calls (s).
            rate: Maximum number of values per second; None: no limit. If there are more, an evenly spaced selection is
                used. Unused capacity of the last second carries over, so a late burst of values is not dropped.
        """
        self._consume, self._period, self._rate = consume, period, rate
        self.given = self.taken = self.dropped = 0
        self._queue: deque[Value] = deque(maxlen=size)
        self._size = size
        self._closing = threading.Event()
        self._changed = threading.Condition()
        self._error: BaseException | None = None
        self._was_raised = False
        self._thread = threading.Thread(target=self._run, name="paxisim live view", daemon=True)
        self._thread.start()

    def put(self, value: Value, wait: bool = False) -> None:
        """Queue a value. Does not wait for the consumer unless `wait` is set.

        Args:
            value: The value.
            wait: Wait for room in the queue instead of dropping the oldest value.

        Raises:
            InvalidValueError: The queue is closed, or was closed during the wait.
            Exception: The exception that the consumer raised; it accepts no more values.
        """
        with self._changed:
            if wait:
                self._changed.wait_for(
                    lambda: len(self._queue) < self._size or self._error is not None or self._closing.is_set()
                )
            self._raise_error()
            if self._closing.is_set():
                raise InvalidValueError("the live view was closed and can show nothing more")
            self.given += 1
            self.dropped += len(self._queue) == self._size
            self._queue.append(value)
            self._changed.notify_all()

    def close(self) -> None:
        """Let the consumer finish the queued values, and end its thread. May be called twice.

        Raises:
            Exception: The exception that the consumer raised, unless `put` has raised it already.
        """
        with self._changed:
            self._closing.set()
            self._changed.notify_all()
        self._thread.join()
        if not self._was_raised:
            self._raise_error()

    def _raise_error(self) -> None:
        if self._error is not None:
            self._was_raised = True
            raise self._error

    def _run(self) -> None:
        last, credit = time.monotonic(), self._rate or 0.0
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._queue or self._closing.is_set())
                values, given = list(self._queue), self.given
                self._queue.clear()
                self._changed.notify_all()
            if not values:
                return
            if self._rate is not None:
                now = time.monotonic()
                credit, last = min(credit + self._rate * (now - last), max(self._rate, 1.0)), now
                count = min(len(values), max(1, int(credit)))
                credit -= count
                chosen = np.linspace(len(values) - 1, 0, count).round().astype(int)[::-1]  # includes the newest
                self.dropped += len(values) - count
                values = [values[i] for i in chosen]
            try:
                self._consume(values, given)
            except BaseException as error:
                with self._changed:
                    self._error = error
                    self._changed.notify_all()
                return
            self.taken += len(values)
            self._closing.wait(self._period)
