"""The other end of a serial line: a pseudo-terminal that can be unplugged and plugged in again."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("pty", reason="no pseudo-terminals here")

import tty

PATIENCE = 20.0
"""Timeout of the tests (s), generous for slow machines."""


def wait_for(condition: Callable[[], object]) -> None:
    """Wait until `condition` is true."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "the condition did not become true in time"
        time.sleep(0.005)


class PluggedPort:
    """A pseudo-terminal behind a symbolic link, as udev creates for real ports.

    Attributes:
        path: Path of the link; open it as the port.
    """

    def __init__(self, folder: Path, name: str = "ttySensor") -> None:
        self.path = str(folder / name)
        self._master = self._slave = -1
        self.plug_in()

    def plug_in(self) -> None:
        """Create a new pseudo-terminal and point the link to it."""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        temporary = self.path + ".new"
        os.symlink(os.ttyname(self._slave), temporary)
        os.replace(temporary, self.path)

    def unplug(self) -> None:
        """Remove the port: open handles fail and the path no longer exists."""
        if self._master >= 0:
            os.unlink(self.path)
            os.close(self._master)
            os.close(self._slave)
            self._master = self._slave = -1

    def send(self, data: bytes) -> None:
        """Send bytes to the program that has the port open."""
        while data:
            data = data[os.write(self._master, data) :]

    def receive(self, count: int) -> bytes:
        """Return the next `count` bytes written to the port."""
        got = b""
        deadline = time.monotonic() + PATIENCE
        while len(got) < count:
            assert select.select([self._master], [], [], max(0.0, deadline - time.monotonic()))[0], got
            got += os.read(self._master, count - len(got))
        return got


@contextmanager
def plugged_port(folder: Path, name: str = "ttySensor") -> Iterator[PluggedPort]:
    """Context manager: a `PluggedPort` that is unplugged on exit."""
    port = PluggedPort(folder, name)
    try:
        yield port
    finally:
        port.unplug()


def reader_threads() -> list[str]:
    """Names of the running reader threads."""
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("paxisim reader")]
