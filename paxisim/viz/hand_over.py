"""HandOver: how a reader hands values to a slower thread without ever waiting for it."""

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
    """A bounded queue between a producer that must not wait and a consumer that may be slow; the newest values win.

    The consumer, in a thread of its own, is called with all that has come since its last call. It is cheaper to do
    several at a time, so it is not called more often than every `period`.

    Attributes:
        given: Values put in.
        taken: Values that the consumer has done with.
        dropped: Values left out: overtaken in the queue, or beyond the rate.
    """

    def __init__(
        self, consume: Callable[[list[Value], int], None], size: int, period: float = 0.0, rate: float | None = None
    ) -> None:
        """Start the consumer's thread.

        Args:
            consume: Called with one or more values, oldest first, and how many had been given by then.
            size: Values that wait at most; a newer one takes the place of the oldest.
            period: Seconds between two calls.
            rate: Values a second, at most, evenly chosen where there are more; None: all. What was spared in the last
                second can be made up for, so that values that come late and together are not left out.
        """
        self._consume, self._period, self._rate = consume, period, rate
        self.given = self.taken = self.dropped = 0
        self._queue: deque[Value] = deque(maxlen=size)
        self._size = size
        self._closing = threading.Event()
        self._changed = threading.Condition()
        self._error: BaseException | None = None
        self._told = False
        self._thread = threading.Thread(target=self._run, name="paxisim live view", daemon=True)
        self._thread.start()

    def put(self, value: Value, wait: bool = False) -> None:
        """Hand over a value. Never waits for the consumer, unless asked to.

        Args:
            value: The value.
            wait: Wait for room in the queue, so that none is overtaken.

        Raises:
            InvalidValueError: It was closed, also while this waited.
            Exception: What the consumer raised; it takes no more.
        """
        with self._changed:
            if wait:
                self._changed.wait_for(
                    lambda: len(self._queue) < self._size or self._error is not None or self._closing.is_set()
                )
            self._raise_error()
            if self._closing.is_set():
                raise InvalidValueError("the live view was closed, nothing more can be shown in it")
            self.given += 1
            self.dropped += len(self._queue) == self._size
            self._queue.append(value)
            self._changed.notify_all()

    def close(self) -> None:
        """Let the consumer finish what waits, and end its thread. May be called twice.

        Raises:
            Exception: What the consumer raised, unless `put` has raised it already.
        """
        with self._changed:
            self._closing.set()
            self._changed.notify_all()
        self._thread.join()
        if not self._told:
            self._raise_error()

    def _raise_error(self) -> None:
        if self._error is not None:
            self._told = True
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
                chosen = np.linspace(len(values) - 1, 0, count).round().astype(int)[::-1]  # the newest among them
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
