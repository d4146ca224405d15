"""Driver for the older GEN1 hand board, which streams and accepts no requests."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.hw.families import taxels
from paxisim.hw.families.board import Reading
from paxisim.hw.families.hand_board.wire import BLOCKS_PER_ROUND, TAXELS_PER_BLOCK, VALID, Round, RoundDecoder
from paxisim.hw.families.listened import ListenedBoard
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.transport import Transport
from paxisim.hw.profiles.profile import Profile


class HandBoard(ListenedBoard[Round]):
    """A hand board; each slot is a block of its rounds, 0 to 3 in the order of the tags.

    If the state of a block is not 01, the pad's status is that state, or 255 if the state is 00. Optional setting:
    ``signed_normal``, true for firmware that sends the normal force as a signed byte.
    """

    kind = "GEN1 hand board"
    heard: ClassVar = {"rounds of the family 'hand-board', an older GEN1 hand board": RoundDecoder}

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Store the arguments; no I/O.

        Raises:
            InvalidValueError: A slot is not a block, or the profile's part does not have the 15 taxels of a block.
        """
        super().__init__(
            transport,
            profile,
            clock,
            RoundDecoder(),
            whole="round",
            silent=f"is it a GEN1 hand board, which sends unprompted, is it powered, and is {profile.baud} baud right?",
            foreign=f"expects the rounds of a GEN1 hand board at {profile.baud} baud, but received something else",
        )
        blocks = [slot.index for slot in profile.slots]
        if not set(blocks) <= set(range(BLOCKS_PER_ROUND)):
            raise InvalidValueError(
                f"slots of a hand board must have an index from 0 to {BLOCKS_PER_ROUND - 1}, got {blocks}"
            )
        if profile.wire_layout.taxels != TAXELS_PER_BLOCK:
            raise InvalidValueError(
                f"a block of the hand board has {TAXELS_PER_BLOCK} taxels, but profile {profile.name!r} describes "
                f"{profile.wire_layout.taxels}"
            )
        self._blocks = blocks
        self._signed = bool(profile.settings.get("signed_normal", False))

    def _reading(self, time: float, behind: int, message: Round) -> Reading:
        blocks = [message.blocks[i] for i in self._blocks]
        counts = [taxels.to_counts(block.taxels, self._signed) for block in blocks]
        status = tuple(0 if block.state == VALID else block.state or 0xFF for block in blocks)
        return Reading(np.stack(counts), None, status, time, behind)
