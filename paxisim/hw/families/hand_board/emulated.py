"""Emulated older GEN1 hand board, which streams whether or not a host listens. See `wire`."""

from __future__ import annotations

from collections.abc import Callable

from paxisim.hw.emulation.pads import EmulatedPads
from paxisim.hw.families import taxels
from paxisim.hw.families.hand_board import wire as wire
from paxisim.hw.families.streaming import StreamingBoard

DEFAULT_RATE = 100.0
"""Default rate of rounds (Hz) if the profile states none; no source states the board's rate."""
_INVALID = 0


class HandBoard(StreamingBoard):
    """Sends rounds of four blocks at a fixed rate and accepts no requests.

    Blocks without a pad are valid and read zero. A wrong status marks the block of the first pad as invalid.
    """

    stream_rate = DEFAULT_RATE

    def __init__(
        self, pads: EmulatedPads, *, rate: float | None = DEFAULT_RATE, wrong_status: Callable[[], bool] = lambda: False
    ) -> None:
        """Power on.

        Args:
            pads: The pads connected to the board; a slot's index is its block.
            rate: Rate of rounds (Hz); None: one round whenever `tick` is called.
            wrong_status: See `EmulatedBoard`.
        """
        super().__init__(pads, rate=rate, wrong_status=wrong_status)
        self._blocks = [slot.index for slot in pads.profile.slots]
        self._signed = bool(pads.profile.settings.get("signed_normal", False))

    def _message(self, now: float) -> bytes:
        counts = self.pads.counts(now)
        if self._signed:
            counts = counts.clip(max=127)
        blocks = [bytes(3 * wire.TAXELS_PER_BLOCK)] * wire.BLOCKS_PER_ROUND
        for pad, block in enumerate(self._blocks):
            blocks[block] = taxels.to_bytes(counts[pad])
        states = [wire.VALID] * wire.BLOCKS_PER_ROUND
        if self._wrong_status():
            states[self._blocks[0]] = _INVALID
        first, second, third, fourth = (wire.Block(t, s) for t, s in zip(blocks, states, strict=True))
        return wire.Round((first, second, third, fourth)).encode()
