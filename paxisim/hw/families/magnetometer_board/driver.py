"""Driver for the magnetometer board of AnySkin, ReSkin and eFlesh, which streams and accepts no requests."""

from __future__ import annotations

from functools import partial
from typing import ClassVar

from paxisim.errors import InvalidValueError
from paxisim.hw.families.board import Reading
from paxisim.hw.families.listened import ListenedBoard
from paxisim.hw.families.magnetometer_board.wire import (
    BYTES_PER_CHIP,
    LINE_END,
    MAX_CHIPS,
    Burst,
    BurstDecoder,
    TextDecoder,
)
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.transport import Transport
from paxisim.hw.profiles.profile import Profile


class MagnetometerBoard(ListenedBoard[Burst]):
    """A board with one pad whose taxels are its magnetometer chips. The tensor is in microtesla.

    Temperatures are discarded. Optional setting: ``text``, true for the sketch that prints its numbers as text.
    """

    kind = "magnetometer board"
    heard: ClassVar = {
        **{
            f"bursts of {chips} chips of the family 'magnetometer-board', e.g. AnySkin": partial(BurstDecoder, chips)
            for chips in range(1, MAX_CHIPS + 1)
        },
        **{
            f"lines of text of {chips} chips of the family 'magnetometer-board' (setting text = true)": partial(
                TextDecoder, chips
            )
            for chips in range(1, MAX_CHIPS + 1)
        },
    }

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Store the arguments; no I/O.

        Raises:
            InvalidValueError: The profile has more than one slot.
        """
        if len(profile.slots) != 1:
            raise InvalidValueError(f"slots must list one pad: a magnetometer board has only one, got {profile.slots}")
        chips, text = profile.wire_layout.taxels, bool(profile.settings.get("text", False))
        what = "lines of text" if text else f"bursts of {BYTES_PER_CHIP * chips + len(LINE_END)} bytes"
        super().__init__(
            transport,
            profile,
            clock,
            TextDecoder(chips) if text else BurstDecoder(chips),
            whole=f"burst of {chips} chips",
            silent="is it a magnetometer board, which sends unprompted once its port is open, and is its sketch "
            "running?",
            foreign=f"expects {what} from {chips} chips, but received something else",
        )

    def _reading(self, time: float, behind: int, message: Burst) -> Reading:
        return Reading(message.values[None, :, 1:], None, (0,), time, behind)
