"""The magnetometer board of AnySkin, ReSkin and eFlesh: streams, takes no requests, and is only listened to."""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import ClassVar

from paxisim.errors import DeviceTimeoutError, InvalidValueError, ProtocolError, UnsupportedError
from paxisim.hw.board import Board, Reading
from paxisim.hw.boards.line import Line, count_behind
from paxisim.hw.clock import Clock
from paxisim.hw.frames.magnetometer_board import BYTES_PER_CHIP, END, MOST_CHIPS, Burst, BurstDecoder, TextDecoder
from paxisim.hw.profile import Profile
from paxisim.hw.transport import Transport

START_TIMEOUT = 2.0
"""Seconds in which the first burst must come; the sketch begins once the port is open."""


class MagnetometerBoard(Board):
    """A board with one pad, whose taxels are its chips. Its tensor is in microtesla.

    Temperatures are not passed on. Setting, optional: ``text``, true for the sketch that prints its numbers.
    """

    heard: ClassVar = {
        **{
            f"bursts of {chips} chips of the family 'magnetometer-board', as AnySkin has": partial(BurstDecoder, chips)
            for chips in range(1, MOST_CHIPS + 1)
        },
        **{
            f"lines of text of {chips} chips of the family 'magnetometer-board' (setting text = true)": partial(
                TextDecoder, chips
            )
            for chips in range(1, MOST_CHIPS + 1)
        },
    }

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Remember; no I/O.

        Raises:
            InvalidValueError: The profile has more than one slot.
        """
        super().__init__(transport, profile, clock)
        if len(profile.slots) != 1:
            raise InvalidValueError(f"slots must list one pad: a magnetometer board has no more, got {profile.slots}")
        self._chips = profile.wire_layout.taxels
        self._text = bool(profile.settings.get("text", False))
        self._line: Line[Burst] = Line(
            transport, clock, TextDecoder(self._chips) if self._text else BurstDecoder(self._chips)
        )
        self._bursts: deque[tuple[float, int, Burst]] = deque()

    @property
    def skipped(self) -> int:
        """See `Board.skipped`."""
        return self._line.skipped

    def start(self) -> None:
        """See `Board.start`. Waits for the first burst, which `read` then returns."""
        self._line.empty()
        self._line.recent = b""
        self._bursts.clear()
        self._listen(START_TIMEOUT)
        if self._bursts:
            return
        if not self._line.recent:
            raise DeviceTimeoutError(
                f"nothing came within {START_TIMEOUT:g} s: is it a magnetometer board, which sends without being asked "
                "once its port is open, and does its sketch run?"
            )
        from paxisim.hw.recognise import describe

        size = BYTES_PER_CHIP * self._chips + len(END)
        what = "lines of text" if self._text else f"bursts of {size} bytes"
        raise ProtocolError(
            f"profile {self.profile.name!r} expects {what} from {self._chips} chips, but what came is none: "
            f"{describe(self._line.recent)}"
        )

    def read(self, timeout: float) -> Reading:
        """See `Board.read`. Every burst once, in the order they came."""
        if not self._bursts:
            self._listen(timeout)
        if not self._bursts:
            raise DeviceTimeoutError(f"no whole burst of {self._chips} chips came within {timeout:g} s")
        time, behind, burst = self._bursts.popleft()
        return Reading(burst.values[None, :, 1:], None, (0,), time, behind)

    def zero(self) -> None:
        """Not possible.

        Raises:
            UnsupportedError: Always: the board takes no commands.
        """
        raise UnsupportedError("a magnetometer board takes no commands, so it cannot be zeroed; zero it in software")

    def version(self) -> str:
        """Empty: the board does not say."""
        return ""

    def _listen(self, timeout: float) -> None:
        """Wait until a burst has come."""
        heard = self._line.collect(lambda _: True, timeout)
        behind = count_behind([time for time, _ in heard])
        self._bursts.extend((time, count, burst) for count, (time, burst) in zip(behind, heard, strict=True))
