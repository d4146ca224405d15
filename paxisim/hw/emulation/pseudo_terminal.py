"""PseudoTerminal: the device's end of a virtual serial port."""

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
        name: The terminal's name, which a host opens like any serial port.
    """

    def __init__(self) -> None:
        """Open the pseudo-terminal.

        Raises:
            UnsupportedError: The system has no pseudo-terminals.
        """
        try:
            import tty
        except ImportError as error:
            raise UnsupportedError("the emulator needs pseudo-terminals, which this system does not have") from error
        self._device, host = os.openpty()
        self.name = os.ttyname(host)
        # raw mode: no line buffering, no echo, no special characters
        tty.setraw(host)
        os.set_blocking(self._device, False)
        # only the host keeps this end open, which makes its opening and closing detectable
        os.close(host)

    def reopened(self) -> PseudoTerminal:
        """Return a new pseudo-terminal, after `close`; it may have another name."""
        return PseudoTerminal()

    @property
    def is_open(self) -> bool:
        """Whether a host has it open."""
        poll = select.poll()
        poll.register(self._device, 0)
        return not any(events & select.POLLHUP for _, events in poll.poll(0))

    def wait(self, seconds: float, wake: int, blocked: bool) -> None:
        """Wait until the host sends, accepts bytes again (if `blocked`), `wake` becomes readable, or the time is up."""
        poll = select.poll()
        poll.register(wake, select.POLLIN)
        poll.register(self._device, select.POLLIN | (select.POLLOUT if blocked else 0))
        poll.poll(1e3 * seconds)

    def read(self) -> bytes:
        """Return the bytes that the host has sent, without waiting."""
        try:
            return os.read(self._device, _CHUNK)
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EIO):  # no data, or no host
                return b""
            raise

    def write(self, data: bytes) -> int:
        """Send bytes to the host and return how many of them fitted into its buffer."""
        try:
            return os.write(self._device, data)
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EIO):
                return 0
            raise

    def close(self) -> None:
        """Close the device's end; the host's next access fails."""
        with contextlib.suppress(OSError):
            os.close(self._device)
