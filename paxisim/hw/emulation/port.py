"""Port: where hosts find an emulated board, seen from the board's end."""

from __future__ import annotations

from typing import Protocol


class Port(Protocol):
    """One port, open until `close`: a pseudo-terminal or a server's address."""

    @property
    def name(self) -> str:
        """What a host opens."""
        ...

    @property
    def is_open(self) -> bool:
        """Whether a host has it open."""
        ...

    def wait(self, seconds: float, wake: int, blocked: bool) -> None:
        """Until the host sends, or takes bytes again if `blocked`, or `wake` becomes readable, or the time is over."""
        ...

    def read(self) -> bytes:
        """What the host has sent, at once."""
        ...

    def write(self, data: bytes) -> int:
        """Hand bytes to the host; how many of them it took."""
        ...

    def close(self) -> None:
        """Take it away; the host's next access fails."""
        ...

    def reopened(self) -> Port:
        """The port that is there when the board is plugged in again, after `close`."""
        ...
