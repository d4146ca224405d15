"""Streaming board: an emulated one that sends messages at a rate."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

from paxisim.hw.emulation.board import EmulatedBoard
from paxisim.hw.emulation.pads import EmulatedPads


class StreamingBoard(EmulatedBoard):
    """Sends a message at its rate from power-on, and takes no requests, unless a subclass says otherwise."""

    due = 0.0

    def __init__(
        self, pads: EmulatedPads, *, rate: float | None, wrong_status: Callable[[], bool] = lambda: False
    ) -> None:
        """Power on.

        Args:
            pads: What hangs on it.
            rate: Messages a second (Hz); None: one whenever `tick` is called.
            wrong_status: See `EmulatedBoard`.
        """
        super().__init__(pads, wrong_status=wrong_status)
        self._period = 1 / rate if rate else 0.0

    def answers(self, data: bytes, now: float) -> list[bytes]:
        """Nothing: the board does not listen."""
        return []

    def tick(self, now: float) -> bytes:
        """See `EmulatedBoard.tick`."""
        if now < self.due:
            return b""
        # what could not be sent in time is not sent later
        self.due = max(self.due + self._period, now) if self._period else now
        return self._message(now)

    @abstractmethod
    def _message(self, now: float) -> bytes:
        """The message that is due."""
