"""Patience: a limit on the processor time of a diagnosis."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

PATIENCE = 600.0  # s of processor time


@contextmanager
def patience() -> Iterator[None]:
    """Interrupt the body after `PATIENCE`, so that an endless search does not block the other cases.

    Raises:
        TimeoutError: The body exceeded the limit.
    """

    def give_up(number: int, frame: object) -> None:
        raise TimeoutError(f"no answer after {PATIENCE:.0f} s of processor time")

    signal.signal(signal.SIGVTALRM, give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
