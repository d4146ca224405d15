"""The older GEN1 hand board's side of the line: it streams, whoever listens. See `paxisim.hw.frames.hand_board`."""

from __future__ import annotations

from collections.abc import Callable

from paxisim.hw import taxels
from paxisim.hw.emulation.pads import EmulatedPads
from paxisim.hw.emulation.streaming import StreamingBoard
from paxisim.hw.frames import hand_board as wire

RATE = 100.0
"""Rounds a second (Hz) where the profile says nothing; no source states the board's rate."""
_INVALID = 0


class HandBoard(StreamingBoard):
    """Sends a round of four blocks at its rate, and takes no requests.

    Blocks without a pad are valid and read zero. A wrong status is a round whose first block is not valid.
    """

    stream_rate = RATE

    def __init__(
        self, pads: EmulatedPads, *, rate: float | None = RATE, wrong_status: Callable[[], bool] = lambda: False
    ) -> None:
        """Power on.

        Args:
            pads: What hangs on it; a slot's index is its block.
            rate: Rounds a second (Hz); None: one whenever `tick` is called.
            wrong_status: See `EmulatedBoard`.
        """
        super().__init__(pads, rate=rate, wrong_status=wrong_status)
        self._blocks = [slot.index for slot in pads.profile.slots]
        self._signed = bool(pads.profile.settings.get("signed_normal", False))

    def _message(self, now: float) -> bytes:
        counts = self.pads.counts(now)
        if self._signed:
            counts = counts.clip(max=127)
        blocks = [bytes(3 * wire.TAXELS)] * wire.BLOCKS
        for pad, block in enumerate(self._blocks):
            blocks[block] = taxels.to_bytes(counts[pad])
        states = [wire.VALID] * wire.BLOCKS
        if self._wrong_status():
            states[self._blocks[0]] = _INVALID
        first, second, third, fourth = (wire.Block(t, s) for t, s in zip(blocks, states, strict=True))
        return wire.Round((first, second, third, fourth)).encode()
