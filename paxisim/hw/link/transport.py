"""Transport: bytes over a serial port, without knowledge of their meaning."""

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

# s; requests are about 20 bytes, so a line that blocks this long is stuck
WRITE_TIMEOUT = 1.0
CHUNK = 65536

_GONE = (errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO)
_FORBIDDEN = (errno.EACCES, errno.EPERM)
_BUSY = (errno.EBUSY, errno.EAGAIN)


class Transport(Protocol):
    """Byte stream to and from a board."""

    def read(self, timeout: float) -> bytes:
        """Return the bytes that have arrived, or wait up to `timeout` seconds for some; ``b""`` if none arrive.

        Raises:
            PortNotFoundError: The port went away.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send all of `data`.

        Raises:
            PortNotFoundError: The port went away.
            DeviceTimeoutError: The line does not accept the data.
        """
        ...

    def discard_input(self) -> None:
        """Discard all bytes that have arrived and were not read.

        Raises:
            PortNotFoundError: The port went away.
        """
        ...

    def close(self) -> None:
        """Release the port. May be called twice."""
        ...


class SerialTransport:
    """A `Transport` over pyserial, created by `open_transport`. Not thread-safe.

    Attributes:
        port: Name or URL of the port.
    """

    def __init__(self, port: str, serial: Serial) -> None:
        """Take over an open pyserial port with a read timeout of 0."""
        self.port = port
        self._serial = serial
        try:
            self._fd: int | None = serial.fileno()
        except (OSError, AttributeError):
            self._fd = None  # Windows, and URLs without a file descriptor

    def read(self, timeout: float) -> bytes:
        """See `Transport.read`; the operating system wakes the thread, without polling."""
        self._check_open()
        try:
            if self._fd is not None:
                ready, _, _ = select.select([self._fd], [], [], max(0.0, timeout))
                # pyserial would ask the system again whether data is there
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
            raise OSError("it reports bytes but has none: it was unplugged, or another program reads from it")
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
        # even closing a lost port may raise
        with suppress(*_line_errors()):
            self._serial.close()

    def _check_open(self) -> None:
        if not self._serial.is_open:
            raise PortNotFoundError(f"{self.port} is closed")

    def _gone(self, error: Exception) -> PortNotFoundError:
        return PortNotFoundError(f"{self.port} went away: {error}")

    def _too_many_files(self, error: ValueError) -> UnsupportedError:
        """Return the error for a file descriptor beyond the limit of `select`, about a thousand."""
        return UnsupportedError(
            f"cannot wait for {self.port} ({error}): this program has about 1024 files open, or more; close some "
            "before opening the sensor, or open the sensor first"
        )

    def __repr__(self) -> str:
        """Return the port and whether it is open."""
        return f"<SerialTransport {self.port}, {'open' if self._serial.is_open else 'closed'}>"


def open_transport(port: str, baud: int) -> SerialTransport:
    """Open a port: a device file, a pseudo-terminal, or any URL that pyserial knows (``socket://``, ``loop://``).

    Device files are opened exclusively if the system supports that.

    Args:
        port: Name or URL of the port.
        baud: Baud rate (bits per second).

    Raises:
        PortNotFoundError: There is no such port, or it is not a serial port.
        PortAccessError: Access is denied, or the port is in use; the message says what to do.
        InvalidValueError: pyserial does not know this kind of URL, or the baud rate is not a positive integer.
        UnsupportedError: The port cannot run at that baud rate.
        MissingExtraError: pyserial is not installed.
    """
    try:
        import serial
    except ImportError as error:
        raise MissingExtraError("serial", "hw", "opening a sensor") from error
    if not isinstance(baud, int) or isinstance(baud, bool) or baud <= 0:
        raise InvalidValueError(f"baud must be a positive whole number of bits per second, got {baud!r}")
    # Windows always opens ports exclusively, and pyserial has no such option there
    options: dict[str, Any] = {"exclusive": True} if os.name == "posix" else {}
    try:
        # with a timeout of 0, a read fetches what is there; SerialTransport.read does the waiting
        line = serial.serial_for_url(port, do_not_open=True, timeout=0, write_timeout=WRITE_TIMEOUT, **options)
    except ValueError as error:
        raise InvalidValueError(f"port {port!r} is not a serial port: {error}") from error
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
    """Return the errors that pyserial raises when a line fails; its own are OSErrors, those of termios are not."""
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
            f"{port} is in use: close() the sensor that this program opened on it before, for example in a notebook "
            f"cell that is run again, or close the other program that uses it (`fuser {port}` names it)"
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
