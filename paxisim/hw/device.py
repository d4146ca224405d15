"""A sensor on one or several ports: frames of newtons, read in the background."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from types import TracebackType

from paxisim.hw.clock import Clock
from paxisim.hw.frame import Frame
from paxisim.hw.profile import Profile
from paxisim.layout import TaxelLayout


def open_sensor(
    port: str | Sequence[str],
    profile: str | Profile,
    *,
    queue: int = 256,
    reconnect: float = 10.0,
    clock: Clock | None = None,
) -> TactileSensor:
    """Open a sensor and start reading it.

    Args:
        port: A device file, pseudo-terminal or pyserial URL; several make one tensor, their pads one after another.
        profile: A name, a profile file or a `Profile`.
        queue: Frames kept for a reader that is late; older ones are dropped and counted.
        reconnect: Seconds for which a port that went away is tried again before reading fails; 0: not at all.
        clock: Time; default: the machine's.
    """
    raise NotImplementedError


class TactileSensor:
    """An open sensor; a context manager."""

    profile: Profile
    layout: TaxelLayout
    pads: tuple[str, ...]
    dropped: int
    """Frames that nobody read in time."""
    reconnects: int
    bad_checksums: int
    skipped: int

    def read(self, timeout: float = 1.0) -> Frame:
        """The oldest frame not yet read; waits for one.

        Raises:
            DeviceTimeoutError: None came within `timeout` seconds.
            PortNotFoundError: The port went away and did not come back in time.
        """
        raise NotImplementedError

    def latest(self, timeout: float = 1.0) -> Frame:
        """The newest frame, throwing away older ones (they are not counted as dropped)."""
        raise NotImplementedError

    def stream(self, timeout: float = 1.0) -> Iterator[Frame]:
        """Frames one after another, for ever."""
        raise NotImplementedError

    def zero(self) -> None:
        """Take what the pads read now as zero."""
        raise NotImplementedError

    def version(self) -> str:
        """What the board says of itself."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop reading and give the ports back. May be called twice."""
        raise NotImplementedError

    def __enter__(self) -> TactileSensor:
        """The sensor itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()
