"""The signals that ask a program to end."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def end_signals(handler: Callable[[int, Any], Any]) -> Iterator[None]:
    """Call `handler` on Ctrl-C, SIGTERM and SIGHUP within the context; has no effect outside the main thread.

    Args:
        handler: Handler as for `signal.signal`.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = {}
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        # an ignored signal stays ignored: nohup and background jobs rely on it
        if number is not None and signal.getsignal(number) not in (signal.SIG_IGN, None):
            previous[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, before in previous.items():
            signal.signal(number, before)
