"""EmulatedBoard: the board's side of a conversation as a state machine on bytes and time. No I/O."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from paxisim.hw.emulation.pads import EmulatedPads


class EmulatedBoard(ABC):
    """One board just after power-on. Times are seconds since the emulator started and never run back.

    Attributes:
        pads: What hangs on it.
        due: When `tick` has the next message (s); infinite: not before the host asks for something.
        stream_rate: Messages a second (Hz) of a board that streams where the profile says nothing; its class then takes
            ``rate``. None: it answers requests.
        gate: Components of a taxel below so many counts read 0 on real boards of the family.
    """

    stream_rate: ClassVar[float | None] = None
    gate: ClassVar[int] = 0
    due: float = math.inf

    def __init__(self, pads: EmulatedPads, *, wrong_status: Callable[[], bool] = lambda: False) -> None:
        """Power on.

        Args:
            pads: What hangs on it.
            wrong_status: Asked for each message; True: it is to carry an error byte.
        """
        self.pads = pads
        self._wrong_status = wrong_status

    @property
    def bytes_per_second(self) -> float:
        """What its line carries: a start bit, 8 bits and a stop bit for each byte, where the baud rate is real."""
        return self.pads.profile.baud / 10

    def receive(self, data: bytes, now: float) -> bytes:
        """What the board answers to bytes from the host, which may come in any pieces."""
        return b"".join(self.answers(data, now))

    @abstractmethod
    def answers(self, data: bytes, now: float) -> list[bytes]:
        """As `receive`, one item a message."""

    def tick(self, now: float) -> bytes:
        """The one message that is due by now, unasked or late; empty if none is."""
        return b""
