"""PseudoTerminal: a serial port without a wire, seen from the device's end."""

from __future__ import annotations

import contextlib
import errno
import os
import select

from paxisim.errors import UnsupportedError

_CHUNK = 4096


class PseudoTerminal:
    """One pseudo-terminal, open until `close`.

    Attributes:
        name: Its name, to be opened as any serial port.
    """

    def __init__(self) -> None:
        """Open it.

        Raises:
            UnsupportedError: This system has none.
        """
        try:
            import tty
        except ImportError as error:
            raise UnsupportedError("the emulator needs pseudo-terminals, which this system does not have") from error
        self._device, host = os.openpty()
        self.name = os.ttyname(host)
        # no line of text, no echo, no characters with a meaning
        tty.setraw(host)
        os.set_blocking(self._device, False)
        # held by the host alone, so that its opening and closing show
        os.close(host)

    def reopened(self) -> PseudoTerminal:
        """Another one, after `close`: it has another name."""
        return PseudoTerminal()

    @property
    def is_open(self) -> bool:
        """Whether a host has it open."""
        poll = select.poll()
        poll.register(self._device, 0)
        return not any(events & select.POLLHUP for _, events in poll.poll(0))

    def wait(self, seconds: float, wake: int, blocked: bool) -> None:
        """Until the host sends, or takes bytes again if `blocked`, or `wake` becomes readable, or the time is over."""
        poll = select.poll()
        poll.register(wake, select.POLLIN)
        poll.register(self._device, select.POLLIN | (select.POLLOUT if blocked else 0))
        poll.poll(1e3 * seconds)

    def read(self) -> bytes:
        """What the host has sent, at once."""
        try:
            return os.read(self._device, _CHUNK)
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EIO):  # nothing there, no host there
                return b""
            raise

    def write(self, data: bytes) -> int:
        """Hand bytes to the host; how many of them fitted into its buffer."""
        try:
            return os.write(self._device, data)
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EIO):
                return 0
            raise

    def close(self) -> None:
        """Take it away; the host's next access fails."""
        with contextlib.suppress(OSError):
            os.close(self._device)
