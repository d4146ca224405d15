"""Transport: bytes over a serial port, and nothing that knows what they mean."""

from __future__ import annotations

from typing import Protocol


class Transport(Protocol):
    """A line of bytes to a board."""

    def read(self, timeout: float) -> bytes:
        """What has arrived, at once if there is something; else what arrives within `timeout` seconds, or ``b""``.

        Raises:
            PortNotFoundError: The port went away.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send all of `data`.

        Raises:
            PortNotFoundError: The port went away.
        """
        ...

    def discard_input(self) -> None:
        """Throw away what has arrived and was not read."""
        ...

    def close(self) -> None:
        """Give the port back. May be called twice."""
        ...


def open_transport(port: str, baud: int) -> Transport:
    """Open a port: a device file, a pseudo-terminal, or any URL that pyserial knows (``socket://``, ``loop://``).

    Args:
        port: Its name or URL.
        baud: Bits a second.

    Raises:
        PortNotFoundError: There is no such port.
        PortAccessError: It may not be opened; on Linux the message says how to be let in.
        MissingExtraError: pyserial is not installed.
    """
    raise NotImplementedError
