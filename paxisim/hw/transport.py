"""Transport: bytes over a serial port, and nothing that knows what they mean."""

from __future__ import annotations

import difflib
import errno
import os
import select
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Protocol

from paxisim.errors import (
    DeviceError,
    DeviceTimeoutError,
    InvalidValueError,
    MissingExtraError,
    PortAccessError,
    PortNotFoundError,
    UnsupportedError,
)

if TYPE_CHECKING:
    from serial import Serial

# a line that takes nothing for so long is stuck: requests have 20 bytes
WRITE_TIMEOUT = 1.0
CHUNK = 65536

_GONE = (errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO)
_FORBIDDEN = (errno.EACCES, errno.EPERM)
_BUSY = (errno.EBUSY, errno.EAGAIN)


class Transport(Protocol):
    """A line of bytes to a board."""

    def read(self, timeout: float) -> bytes:
        """What has arrived, at once if there is something; else what arrives within `timeout` seconds, or ``b""``.

        Raises:
            PortNotFoundError: The port went away.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send all of `data`.

        Raises:
            PortNotFoundError: The port went away.
            DeviceTimeoutError: The line takes nothing.
        """
        ...

    def discard_input(self) -> None:
        """Throw away what has arrived and was not read.

        Raises:
            PortNotFoundError: The port went away.
        """
        ...

    def close(self) -> None:
        """Give the port back. May be called twice."""
        ...


class SerialTransport:
    """A `Transport` over pyserial; made by `open_transport`. Not safe for several threads.

    Attributes:
        port: Its name or URL.
    """

    def __init__(self, port: str, serial: Serial) -> None:
        """Take over a port of pyserial that is open and has a read timeout of 0."""
        self.port = port
        self._serial = serial
        try:
            self._fd: int | None = serial.fileno()
        except (OSError, AttributeError):
            self._fd = None  # Windows, and URLs that are no file

    def read(self, timeout: float) -> bytes:
        """See `Transport.read`; the operating system wakes it, nothing is polled."""
        self._check_open()
        try:
            if self._fd is not None:
                ready, _, _ = select.select([self._fd], [], [], max(0.0, timeout))
                # pyserial would ask the system a second time whether there is something
                return self._read_now(self._fd) if ready else b""
            self._serial.timeout = max(0.0, timeout)
            first = self._serial.read(1)
            return first + self._serial.read(self._serial.in_waiting) if first else b""
        except ValueError as error:
            raise self._too_many_files(error) from error
        except _line_errors() as error:
            raise self._gone(error) from error

    def _read_now(self, fd: int) -> bytes:
        try:
            data = os.read(fd, CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError("it reports bytes but has none: it was unplugged, or another program reads it")
        return data

    def write(self, data: bytes) -> None:
        """See `Transport.write`."""
        from serial import SerialTimeoutException

        self._check_open()
        try:
            self._serial.write(data)
        except SerialTimeoutException as error:
            raise DeviceTimeoutError(
                f"{self.port} did not take {len(data)} bytes within {WRITE_TIMEOUT:g} s"
            ) from error
        except ValueError as error:
            raise self._too_many_files(error) from error
        except _line_errors() as error:
            raise self._gone(error) from error

    def discard_input(self) -> None:
        """See `Transport.discard_input`."""
        self._check_open()
        try:
            self._serial.reset_input_buffer()
        except _line_errors() as error:
            raise self._gone(error) from error

    def close(self) -> None:
        """See `Transport.close`."""
        # a port that went away may not even be closed without an error
        with suppress(*_line_errors()):
            self._serial.close()

    def _check_open(self) -> None:
        if not self._serial.is_open:
            raise PortNotFoundError(f"{self.port} is closed")

    def _gone(self, error: Exception) -> PortNotFoundError:
        return PortNotFoundError(f"{self.port} went away: {error}")

    def _too_many_files(self, error: ValueError) -> UnsupportedError:
        """What select says of the descriptor of a port that was opened after about a thousand other files."""
        return UnsupportedError(
            f"{self.port} cannot be waited for ({error}): this program has about 1024 files open, or more; close some "
            "before the sensor is opened, or open the sensor first"
        )

    def __repr__(self) -> str:
        """The port, and whether it is open."""
        return f"<SerialTransport {self.port}, {'open' if self._serial.is_open else 'closed'}>"


def open_transport(port: str, baud: int) -> SerialTransport:
    """Open a port: a device file, a pseudo-terminal, or any URL that pyserial knows (``socket://``, ``loop://``).

    Device files are opened for this program alone where the system can do that.

    Args:
        port: Its name or URL.
        baud: Bits a second.

    Raises:
        PortNotFoundError: There is no such port, or it is no serial port.
        PortAccessError: It may not be opened, or another program has it; the message says what to do.
        InvalidValueError: A URL of a kind that pyserial does not know, or a baud rate that is no positive integer.
        UnsupportedError: The port cannot run at that baud rate.
        MissingExtraError: pyserial is not installed.
    """
    try:
        import serial
    except ImportError as error:
        raise MissingExtraError("serial", "hw", "opening a sensor") from error
    if not isinstance(baud, int) or isinstance(baud, bool) or baud <= 0:
        raise InvalidValueError(f"baud must be a positive whole number of bits a second, got {baud!r}")
    # Windows always opens a port for one program alone, and pyserial has no such option there
    options: dict[str, Any] = {"exclusive": True} if os.name == "posix" else {}
    try:
        # with a timeout of 0 a read fetches what is there; waiting for it is up to SerialTransport.read
        line = serial.serial_for_url(port, do_not_open=True, timeout=0, write_timeout=WRITE_TIMEOUT, **options)
    except ValueError as error:
        raise InvalidValueError(f"port {port!r} is no serial port: {error}") from error
    except _line_errors() as error:
        raise _why_not_open(port, error) from error
    try:
        line.baudrate = baud
        line.open()
    except (ValueError, OverflowError) as error:
        raise UnsupportedError(f"{port} cannot run at {baud} baud: {error}") from error
    except _line_errors() as error:
        raise _why_not_open(port, error) from error
    return SerialTransport(port, line)


def _line_errors() -> tuple[type[Exception], ...]:
    """What pyserial raises where a line fails; its exceptions are OSErrors, those of termios are not."""
    try:
        import termios
    except ImportError:  # Windows
        return (OSError,)
    return (OSError, termios.error)


def _why_not_open(port: str, error: Exception) -> DeviceError:
    number = error.errno if isinstance(error, OSError) else None
    if number in _FORBIDDEN:
        return PortAccessError(
            f"no permission to open {port}; on Linux: sudo usermod -a -G dialout $USER (the group that "
            f"`ls -l {port}` shows), then log out and in again; or give the device a udev rule with MODE=0666"
        )
    if number in _BUSY:
        return PortAccessError(
            f"{port} is in use: close() the sensor that this program opened on it before, as in a notebook's cell that "
            f"is run again, or close the other program that has it (`fuser {port}` names it)"
        )
    if number in _GONE:
        return PortNotFoundError(f"no port {port!r}; {_ports_there_are(port)}")
    if "://" not in port and os.path.exists(port):
        return PortNotFoundError(f"{port!r} is not a serial port; {_ports_there_are(port)}")
    return PortNotFoundError(f"cannot open {port!r}: {error}")


def _ports_there_are(port: str) -> str:
    from serial.tools.list_ports import comports

    known = {found.device: found.description for found in comports()}
    texts = {name: name if what in (None, "", "n/a") else f"{name} ({what})" for name, what in known.items()}
    if not known:
        return "this machine has no serial port: is the sensor plugged in?"
    near = difflib.get_close_matches(port, known, n=3, cutoff=0.6)
    names = ", ".join(texts[name] for name in near or sorted(known))
    return f"did you mean {names}?" if near else f"there are: {names}"
