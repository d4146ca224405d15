"""The signals that ask a program to end."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def end_signals(handler: Callable[[int, Any], Any]) -> Iterator[None]:
    """Have Ctrl-C, SIGTERM and SIGHUP call `handler` meanwhile; only where this runs in the main thread.

    Args:
        handler: What `signal.signal` takes.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = {}
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        # one that is ignored stays so: nohup and background jobs rely on it
        if number is not None and signal.getsignal(number) not in (signal.SIG_IGN, None):
            previous[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, before in previous.items():
            signal.signal(number, before)
