"""What the driver needs of a board, whatever its family."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.hw.clock import Clock
from paxisim.hw.framing import Decoder
from paxisim.hw.profile import Profile
from paxisim.hw.transport import Transport


@dataclass(frozen=True, eq=False)
class Reading:
    """One reading of all pads, as it came.

    Attributes:
        counts: ``(pads, N, 3)`` x y z of each taxel in the order and with the signs of the wire: int16, or float32
            where the family's counts are no whole numbers.
        resultant: ``(pads, 3)`` int16 counts, the total that the board itself reports; None where it reports none.
        status: One error byte a pad; 0 is good.
        time: When its last byte arrived (s, the host's monotonic clock).
        behind: Readings that lay in the port behind it when it was fetched: it is so many periods older, or more.
    """

    counts: NDArray[np.int16] | NDArray[np.float32]
    resultant: NDArray[np.int16] | None
    status: tuple[int, ...]
    time: float
    behind: int = 0


class Board(ABC):
    """The conversation with one board on one port, one request at a time. Not safe for several threads.

    A family's class is named in `paxisim.hw.families.FAMILIES`.

    Attributes:
        heard: What may be heard on its line, in words that follow a number, and a decoder of it: by these a board is
            recognised that hangs where another is expected.
        questions: Requests that change nothing on a board of any family, and make one of this family answer; none
            where it sends unasked.
    """

    heard: ClassVar[Mapping[str, Callable[[], Decoder[Any]]]]
    questions: ClassVar[tuple[bytes, ...]] = ()

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Remember; no I/O."""
        self.transport, self.profile, self.clock = transport, profile, clock

    @abstractmethod
    def start(self) -> None:
        """Bring the board to where it can be read, and check that it is the one the profile describes.

        Raises:
            DeviceTimeoutError: It does not answer.
            ProtocolError: It answers in another family's language, or reports another number of taxels.
        """

    @abstractmethod
    def read(self, timeout: float) -> Reading:
        """The next reading of all pads of the profile.

        Raises:
            DeviceTimeoutError: None came whole within `timeout` seconds.
            PortNotFoundError: The port went away.
        """

    @abstractmethod
    def zero(self) -> None:
        """Take what the pads read now as zero.

        Raises:
            UnsupportedError: This board cannot.
            DeviceTimeoutError: It does not answer.
        """

    @abstractmethod
    def version(self) -> str:
        """What the board says of itself; empty where its protocol has no such request."""

    def stop(self) -> None:  # noqa: B027  # most boards have nothing to stop
        """Leave the board as it was found, where it streams. Does not close the transport."""

    @property
    def bad_checksums(self) -> int:
        """Frames thrown away because their check byte did not fit."""
        return 0

    @property
    def skipped(self) -> int:
        """Bytes thrown away because they belonged to no frame."""
        return 0
