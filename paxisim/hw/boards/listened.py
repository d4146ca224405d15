"""Listened board: one that streams unasked and takes no commands."""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from typing import ClassVar, Generic

from paxisim.errors import DeviceTimeoutError, ProtocolError, UnsupportedError
from paxisim.hw.board import Board, Reading
from paxisim.hw.boards.line import Line, Message, with_behind
from paxisim.hw.clock import Clock
from paxisim.hw.framing import Decoder
from paxisim.hw.profile import Profile
from paxisim.hw.transport import Transport

START_TIMEOUT = 2.0
"""Seconds in which the first message must come; no source states how soon it does."""


class ListenedBoard(Board, Generic[Message]):
    """A board of which every message is a reading.

    Attributes:
        kind: What the board is, in an error.
    """

    kind: ClassVar[str]

    def __init__(
        self, transport: Transport, profile: Profile, clock: Clock, decoder: Decoder[Message],
        *, whole: str, silent: str, foreign: str,
    ) -> None:  # fmt: skip
        """Remember; no I/O.

        Args:
            transport: The port.
            profile: Of the sensor.
            clock: The host's.
            decoder: Of the messages.
            whole: A message in words.
            silent: What to check where nothing comes.
            foreign: What the profile expects, and that what came is none of it.
        """
        super().__init__(transport, profile, clock)
        self._whole, self._silent, self._foreign = whole, silent, foreign
        self._line = Line(transport, clock, decoder)
        self._waiting: deque[tuple[float, int, Message]] = deque()

    @abstractmethod
    def _reading(self, time: float, behind: int, message: Message) -> Reading:
        """What a message says; the times are those of `Reading`."""

    @property
    def skipped(self) -> int:
        """See `Board.skipped`."""
        return self._line.skipped

    def start(self) -> None:
        """See `Board.start`. Waits for the first message, which `read` then returns."""
        self._line.empty()
        self._line.recent = b""
        self._waiting.clear()
        self._listen(START_TIMEOUT)
        if self._waiting:
            return
        if self._is_silence(self._line.recent):
            raise DeviceTimeoutError(f"nothing came within {START_TIMEOUT:g} s: {self._silent}")
        from paxisim.hw.recognise import describe

        raise ProtocolError(f"profile {self.profile.name!r} {self._foreign}: {describe(self._line.recent)}")

    def read(self, timeout: float) -> Reading:
        """See `Board.read`. Every message once, in the order they came."""
        if not self._waiting:
            self._listen(timeout)
        if not self._waiting:
            raise DeviceTimeoutError(f"no whole {self._whole} came within {timeout:g} s")
        return self._reading(*self._waiting.popleft())

    def zero(self) -> None:
        """Not possible.

        Raises:
            UnsupportedError: Always: the board takes no commands.
        """
        raise UnsupportedError(f"a {self.kind} takes no commands, so it cannot be zeroed; zero it in software")

    def version(self) -> str:
        """Empty: the board does not say."""
        return ""

    def _is_silence(self, heard: bytes) -> bool:
        """Whether what came says nothing, not even what speaks there."""
        return not heard

    def _listen(self, timeout: float) -> None:
        """Wait until a message has come."""
        self._waiting.extend(with_behind(self._line.collect(lambda _: True, timeout)))
