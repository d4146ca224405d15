"""Base class for boards that stream unprompted and accept no commands."""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from typing import ClassVar, Generic

from paxisim.errors import DeviceTimeoutError, ProtocolError, UnsupportedError
from paxisim.hw.families.board import Reading
from paxisim.hw.families.line import Line, LineBoard, Message, with_behind
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.framing import Decoder
from paxisim.hw.link.transport import Transport
from paxisim.hw.profiles.profile import Profile

START_TIMEOUT = 2.0
"""Seconds within which the first message must arrive; no source states how long a board takes."""


class ListenedBoard(LineBoard, Generic[Message]):
    """A board whose every message is a reading.

    Attributes:
        kind: Name of the kind of board, for error messages.
    """

    kind: ClassVar[str]

    def __init__(
        self, transport: Transport, profile: Profile, clock: Clock, decoder: Decoder[Message],
        *, whole: str, silent: str, foreign: str,
    ) -> None:  # fmt: skip
        """Store the arguments; no I/O.

        Args:
            transport: The port.
            profile: Profile of the sensor.
            clock: The host's clock.
            decoder: Decoder of the board's messages.
            whole: Name of a message, for error messages.
            silent: What to check if nothing arrives, for error messages.
            foreign: What the profile expects and that something else arrived, for error messages.
        """
        super().__init__(transport, profile, clock)
        self._whole, self._silent, self._foreign = whole, silent, foreign
        self._line = Line(transport, clock, decoder)
        self._waiting: deque[tuple[float, int, Message]] = deque()

    @abstractmethod
    def _reading(self, time: float, behind: int, message: Message) -> Reading:
        """Convert a message to a reading; `time` and `behind` are those of `Reading`."""

    def start(self) -> None:
        """See `Board.start`. Waits for the first message, which the next `read` returns."""
        self._line.empty()
        self._line.recent = b""
        self._waiting.clear()
        self._listen(START_TIMEOUT)
        if self._waiting:
            return
        if self._is_silence(self._line.recent):
            raise DeviceTimeoutError(f"nothing came within {START_TIMEOUT:g} s: {self._silent}")
        from paxisim.hw.link.recognise import describe

        raise ProtocolError(f"profile {self.profile.name!r} {self._foreign}: {describe(self._line.recent)}")

    def read(self, timeout: float) -> Reading:
        """See `Board.read`. Returns every message once, in order of arrival."""
        if not self._waiting:
            self._listen(timeout)
        if not self._waiting:
            raise DeviceTimeoutError(f"no complete {self._whole} came within {timeout:g} s")
        return self._reading(*self._waiting.popleft())

    def zero(self) -> None:
        """Raise an error, since the board takes no commands.

        Raises:
            UnsupportedError: Always.
        """
        raise UnsupportedError(f"a {self.kind} takes no commands, so it cannot be zeroed; zero it in software")

    def version(self) -> str:
        """Return an empty string: the board does not report a version."""
        return ""

    def _is_silence(self, heard: bytes) -> bool:
        """Whether `heard` gives no hint of what is connected."""
        return not heard

    def _listen(self, timeout: float) -> None:
        """Wait until a message has arrived, and queue what came."""
        self._waiting.extend(with_behind(self._line.collect(lambda _: True, timeout)))
