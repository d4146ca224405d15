"""Interface between the driver and a board of any family."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.hw.link.clock import Clock
from paxisim.hw.link.framing import Decoder
from paxisim.hw.link.transport import Transport
from paxisim.hw.profiles.profile import Profile


@dataclass(frozen=True, eq=False)
class Reading:
    """One reading of all pads, as received.

    Attributes:
        counts: ``(pads, N, 3)`` x, y and z of each taxel in the order and with the signs of the wire: int16, or float32
            if the family's counts are not whole numbers.
        resultant: ``(pads, 3)`` int16 counts, the total that the board itself reports; None if it reports none.
        status: One error byte per pad; 0 means no error.
        time: Arrival time of the last byte (s, the host's monotonic clock).
        behind: Number of readings queued in the port behind this one when it was fetched. The reading was measured at
            least as many periods before `time`.
    """

    counts: NDArray[np.int16] | NDArray[np.float32]
    resultant: NDArray[np.int16] | None
    status: tuple[int, ...]
    time: float
    behind: int = 0


class Board(ABC):
    """Conversation with one board on one port, one request at a time. Not thread-safe.

    `paxisim.hw.families.table.FAMILIES` names the class of each family.

    Attributes:
        heard: Decoder factories for what the board may send, keyed by a description that follows a number. They
            identify a board that is connected where another one is expected.
        questions: Requests that a board of this family answers and that change nothing on a board of any family; empty
            if the family sends unasked.
    """

    heard: ClassVar[Mapping[str, Callable[[], Decoder[Any]]]]
    questions: ClassVar[tuple[bytes, ...]] = ()

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Store the arguments; no I/O."""
        self.transport, self.profile, self.clock = transport, profile, clock

    @abstractmethod
    def start(self) -> None:
        """Make the board ready to be read, and check that it is the one the profile describes.

        Raises:
            DeviceTimeoutError: The board does not answer.
            ProtocolError: The board answers in another family's protocol, or reports another number of taxels.
        """

    @abstractmethod
    def read(self, timeout: float) -> Reading:
        """Return the next reading of all pads of the profile.

        Raises:
            DeviceTimeoutError: No complete reading arrived within `timeout` seconds.
            PortNotFoundError: The port went away.
        """

    @abstractmethod
    def zero(self) -> None:
        """Make the present reading of the pads their zero.

        Raises:
            UnsupportedError: The board cannot zero itself.
            DeviceTimeoutError: The board does not answer.
        """

    @abstractmethod
    def version(self) -> str:
        """Return the version that the board reports; empty if its protocol has no such request."""

    def stop(self) -> None:  # noqa: B027  # most boards have nothing to stop
        """Return a streaming board to the state in which it was found. Does not close the transport."""

    @property
    def bad_checksums(self) -> int:
        """Number of frames discarded because of a wrong check byte."""
        return 0

    @property
    def lost(self) -> int:
        """Number of readings that the board numbered, but that never arrived."""
        return 0

    @property
    def skipped(self) -> int:
        """Number of bytes discarded because they belonged to no frame."""
        return 0
