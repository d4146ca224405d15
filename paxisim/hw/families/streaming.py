"""StreamingBoard: an emulated board that sends messages at a fixed rate."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

from paxisim.hw.emulation.pads import EmulatedPads
from paxisim.hw.families.emulated_board import EmulatedBoard


class StreamingBoard(EmulatedBoard):
    """Sends messages at a fixed rate from power-on and accepts no requests, unless a subclass overrides this."""

    due = 0.0

    def __init__(
        self, pads: EmulatedPads, *, rate: float | None, wrong_status: Callable[[], bool] = lambda: False
    ) -> None:
        """Power on.

        Args:
            pads: The pads connected to the board.
            rate: Message rate (Hz); None: one message whenever `tick` is called.
            wrong_status: See `EmulatedBoard`.
        """
        super().__init__(pads, wrong_status=wrong_status)
        self._period = 1 / rate if rate else 0.0

    def answers(self, data: bytes, now: float) -> list[bytes]:
        """Return an empty list: the board does not listen."""
        return []

    def tick(self, now: float) -> bytes:
        """See `EmulatedBoard.tick`."""
        if now < self.due:
            return b""
        # messages that could not be sent in time are dropped
        self.due = max(self.due + self._period, now) if self._period else now
        return self._message(now)

    @abstractmethod
    def _message(self, now: float) -> bytes:
        """Return the message that is due."""
