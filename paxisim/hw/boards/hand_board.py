"""The older GEN1 hand board: streams, takes no requests, and is only listened to."""

from __future__ import annotations

from collections import deque
from typing import ClassVar

import numpy as np

from paxisim.errors import DeviceTimeoutError, InvalidValueError, ProtocolError, UnsupportedError
from paxisim.hw import taxels
from paxisim.hw.board import Board, Reading
from paxisim.hw.boards.line import Line, count_behind
from paxisim.hw.clock import Clock
from paxisim.hw.frames.hand_board import BLOCKS, TAXELS, VALID, Round, RoundDecoder
from paxisim.hw.profile import Profile
from paxisim.hw.transport import Transport

START_TIMEOUT = 2.0
"""Seconds in which the first round must come; no source states the board's rate."""


class HandBoard(Board):
    """A board whose slots are blocks of its rounds: 0 to 3, in the order of the tags.

    A block whose state is not 01 is passed on with that state as its status, or 255 if the state is 00. Settings:
    ``signed_normal``, true for firmware that sends the normal force as a signed byte.
    """

    heard: ClassVar = {"rounds of the family 'hand-board', an older GEN1 hand board": RoundDecoder}

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Remember; no I/O.

        Raises:
            InvalidValueError: A slot is no block, or the part has not the 15 taxels of a block.
        """
        super().__init__(transport, profile, clock)
        blocks = [slot.index for slot in profile.slots]
        if not set(blocks) <= set(range(BLOCKS)):
            raise InvalidValueError(f"a hand board's slots must have an index from 0 to {BLOCKS - 1}, got {blocks}")
        if profile.wire_layout.taxels != TAXELS:
            raise InvalidValueError(
                f"a block of the hand board has {TAXELS} taxels, but profile {profile.name!r} describes "
                f"{profile.wire_layout.taxels}"
            )
        self._blocks = blocks
        self._signed = bool(profile.settings.get("signed_normal", False))
        self._line = Line(transport, clock, RoundDecoder())
        self._rounds: deque[tuple[float, int, Round]] = deque()

    @property
    def skipped(self) -> int:
        """See `Board.skipped`."""
        return self._line.skipped

    def start(self) -> None:
        """See `Board.start`. Waits for the first round, which `read` then returns."""
        self._line.empty()
        self._line.recent = b""
        self._rounds.clear()
        self._listen(START_TIMEOUT)
        if self._rounds:
            return
        if not self._line.recent:
            raise DeviceTimeoutError(
                f"nothing came within {START_TIMEOUT:g} s: is it a GEN1 hand board, which sends without being asked, "
                f"powered, at {self.profile.baud} baud?"
            )
        from paxisim.hw.recognise import describe

        raise ProtocolError(
            f"profile {self.profile.name!r} expects the rounds of a GEN1 hand board at {self.profile.baud} baud, but "
            f"what came is no such round: {describe(self._line.recent)}"
        )

    def read(self, timeout: float) -> Reading:
        """See `Board.read`. Every round once, in the order they came."""
        if not self._rounds:
            self._listen(timeout)
        if not self._rounds:
            raise DeviceTimeoutError(f"no whole round came within {timeout:g} s")
        time, behind, found = self._rounds.popleft()
        blocks = [found.blocks[i] for i in self._blocks]
        counts = [taxels.to_counts(block.taxels, self._signed) for block in blocks]
        status = tuple(0 if block.state == VALID else block.state or 0xFF for block in blocks)
        return Reading(np.stack(counts), None, status, time, behind)

    def zero(self) -> None:
        """Not possible.

        Raises:
            UnsupportedError: Always: the board takes no commands.
        """
        raise UnsupportedError("a GEN1 hand board takes no commands, so it cannot be zeroed; zero it in software")

    def version(self) -> str:
        """Empty: the board does not say."""
        return ""

    def _listen(self, timeout: float) -> None:
        """Wait until a round has come."""
        heard = self._line.collect(lambda _: True, timeout)
        behind = count_behind([time for time, _ in heard])
        self._rounds.extend((time, count, found) for count, (time, found) in zip(behind, heard, strict=True))
