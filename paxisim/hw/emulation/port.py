"""Port: the board's end of the port through which hosts reach an emulated board."""

from __future__ import annotations

from typing import Protocol


class Port(Protocol):
    """One port, open until `close`: a pseudo-terminal or a server's address."""

    @property
    def name(self) -> str:
        """Name or address that a host opens."""
        ...

    @property
    def is_open(self) -> bool:
        """Whether a host has it open."""
        ...

    def wait(self, seconds: float, wake: int, blocked: bool) -> None:
        """Wait until the host sends, accepts bytes again (if `blocked`), `wake` becomes readable, or the time is up."""
        ...

    def read(self) -> bytes:
        """Return the bytes that the host has sent, without waiting."""
        ...

    def write(self, data: bytes) -> int:
        """Send bytes to the host and return how many of them were accepted."""
        ...

    def close(self) -> None:
        """Close the port; the host's next access fails."""
        ...

    def reopened(self) -> Port:
        """Return the port that exists once the board is plugged in again, after `close`."""
        ...
