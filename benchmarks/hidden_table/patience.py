"""Patience: the processor time that a diagnosis may take."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager

PATIENCE = 600.0  # s of processor time


@contextmanager
def patience() -> Iterator[None]:
    """End what takes more than `PATIENCE`: a search that does not end must not hold up the other cases.

    Raises:
        TimeoutError: It was ended.
    """

    def give_up(number: int, frame: object) -> None:
        raise TimeoutError(f"no answer after {PATIENCE:.0f} s of processor time")

    signal.signal(signal.SIGVTALRM, give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
