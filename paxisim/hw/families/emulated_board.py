"""EmulatedBoard: the board's end of the line as a state machine driven by bytes and time. No I/O."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from paxisim.hw.emulation.pads import EmulatedPads


class EmulatedBoard(ABC):
    """One board, in its state after power-on. Times are in seconds since the emulator started and never decrease.

    Attributes:
        pads: The pads connected to the board.
        due: Time of the next message from `tick` (s); infinite: none before the host sends a request.
        stream_rate: Default message rate (Hz) of a board that streams, if the profile states none; the class then takes
            a ``rate`` argument. None: the board answers requests.
        gate: Threshold in counts below which a taxel's components read 0 on real boards of the family.
    """

    stream_rate: ClassVar[float | None] = None
    gate: ClassVar[int] = 0
    due: float = math.inf

    def __init__(self, pads: EmulatedPads, *, wrong_status: Callable[[], bool] = lambda: False) -> None:
        """Power on.

        Args:
            pads: The pads connected to the board.
            wrong_status: Called for each message; True makes the message carry an error byte.
        """
        self.pads = pads
        self._wrong_status = wrong_status

    @property
    def bytes_per_second(self) -> float:
        """Capacity of the line, with a start bit, 8 data bits and a stop bit per byte, if the baud rate is real."""
        return self.pads.profile.baud / 10

    def receive(self, data: bytes, now: float) -> bytes:
        """Return the board's answer to bytes from the host, which may arrive in any pieces."""
        return b"".join(self.answers(data, now))

    @abstractmethod
    def answers(self, data: bytes, now: float) -> list[bytes]:
        """As `receive`, with one item per message."""

    def tick(self, now: float) -> bytes:
        """Return the next message due by now, unprompted or delayed; empty if none is due."""
        return b""
