"""Emulator: an emulated sensor on a real serial port (a pseudo-terminal)."""

from __future__ import annotations

import contextlib
import math
import os
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from paxisim.errors import DeviceError, InvalidValueError, OutputExistsError
from paxisim.hw.emulation.faults import MERGE_WAIT, Faults, FaultyLine
from paxisim.hw.emulation.pacing import GRAIN, PacedLine
from paxisim.hw.emulation.pads import EmulatedPads, Resultant, Signal
from paxisim.hw.emulation.port import Port
from paxisim.hw.families.emulated_board import EmulatedBoard
from paxisim.hw.families.load import emulated_class, emulated_port
from paxisim.hw.profiles.load import as_profile
from paxisim.hw.profiles.profile import Profile

MAX_SENT = 100_000
"""Number of messages kept in `Emulator.sent`; older ones are discarded."""

HOST_BUFFER = 65536
"""Bytes buffered for a slow host, as its system does for a real port; further bytes are lost."""

_LOOK_FOR_HOST = 2e-3  # seconds between checks for a host that opened the port; one waits only 10 ms for an answer
_LONGEST_WAIT = 1.0


@dataclass(frozen=True)
class Sent:
    """A message that left the emulator.

    Attributes:
        message: The message as the board made it.
        written: The bytes that left, with the faults applied.
    """

    message: bytes
    written: bytes


class Emulator:
    """Speaks a profile's protocol byte for byte on a pseudo-terminal, in its own thread; a context manager.

    Built for Linux; untested on macOS, which also has pseudo-terminals.

    Example::

        with Emulator("gen3-highspeed", press("gen3-highspeed")) as sensor:
            pads = open_sensor(sensor.port, "gen3-highspeed")

    It behaves like a real board. Forces are sampled at the board's rate, rounded to whole counts, gated and clipped.
    Bytes leave no faster than the line carries them, and bytes that the host does not fetch in time are lost. Plugging
    in is a power-on: nothing is zeroed or configured. The boards' behaviour is in `paxisim.hw.emulation`, one module
    per family.

    Attributes:
        port: Name of the pseudo-terminal, which can be opened like any serial port; the link if there is one.
        profile: Profile whose protocol is spoken.
        messages: Number of messages sent so far.
        overruns: Number of bytes lost because the host did not fetch them.
        sent: The last `MAX_SENT` messages sent; None unless `record_sent` is set.
    """

    def __init__(
        self,
        profile: str | os.PathLike[str] | Profile,
        signal: Signal,
        *,
        rate: float | None = None,
        gate: int | None = None,
        shear_floor: int = 0,
        faults: Faults | None = None,
        link: str | os.PathLike[str] | None = None,
        seed: int = 0,
        pace: bool = True,
        resultant: Resultant | None = None,
        record_sent: bool = False,
    ) -> None:
        """Create the emulator; `start` or ``with`` opens the port.

        Args:
            profile: A name, a profile file or a `Profile`.
            signal: Forces on the pads, ``(pads, 3, rows, cols)`` newtons in the profile's wire layout, as a function of
                the time since the start (s). Called in the emulator's thread.
            rate: Measurement rate (Hz), and the message rate of a board that streams. Default: the profile's rate. If
                the profile has none, a board that streams uses the rate of its family, and a board that is polled
                measures on each request.
            gate: Components below this number of counts read 0. Default: 2 on GEN3 boards, as observed on real parts;
                0 on the others, for which no source states one.
            shear_floor: Smallest magnitude of x and y on a taxel that is on, in counts, as of 2 on a real S1813E; 0 for
                none.
            faults: Faults of the line; default: none.
            link: Path of a symbolic link to the port. The link keeps its name when the port changes: after replugging,
                the port is another pseudo-terminal. There is no link while the emulator is unplugged.
            seed: Random seed of the faults.
            pace: Whether to keep to the rate and the line speed. If False, a stream runs as fast as the host reads, and
                nothing is ever lost.
            resultant: The total that the board reports for a pad, see `EmulatedPads`.
            record_sent: Whether to fill `sent`.

        Raises:
            InvalidValueError: The signal does not fit the profile, or a number is out of range.
            UnknownNameError: There is no such profile.
        """
        self.profile = as_profile(profile)
        if rate is not None and not 0 < rate < math.inf:
            raise InvalidValueError(f"rate must be a positive number of Hz, got {rate!r}")
        if seed < 0:
            raise InvalidValueError(f"seed must be 0 or more, got {seed!r}")
        self._rate = (rate or self.profile.rate) if pace else None
        if gate is None:
            gate = emulated_class(self.profile.family).gate
        self._signal, self._gate, self._shear_floor = signal, gate, shear_floor
        self._resultant, self._pace = resultant, pace
        self._faults = Faults() if faults is None else faults
        self._faulty = FaultyLine(self._faults, seed)
        self._link = None if link is None else Path(link)
        self.messages = self.overruns = 0
        self.sent: deque[Sent] | None = deque(maxlen=MAX_SENT) if record_sent else None
        self._terminal: Port | None = None
        self._last: Port | None = None
        self._board = self._power_on()
        self._line = PacedLine(self._board.bytes_per_second if pace else math.inf)
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._stopping = False
        self._error: BaseException | None = None

    @property
    def port(self) -> str:
        """Name of the port, see the class.

        Raises:
            DeviceError: The emulator is unplugged or not started.
        """
        if self._terminal is None:
            raise DeviceError("the emulator has no port: it is unplugged or not started")
        return self._terminal.name if self._link is None else str(self._link)

    @property
    def plugged(self) -> bool:
        """Whether the emulator has a port."""
        return self._terminal is not None

    def start(self) -> Emulator:
        """Open the port and start to answer.

        Raises:
            OutputExistsError: The link's path exists and is not a link to a port.
            UnsupportedError: This system has no pseudo-terminals.
        """
        if self._thread is not None:
            return self
        self._start = time.monotonic()
        self._stopping = False
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        try:
            self.plug()
        except BaseException:
            self._close_pipe()
            raise
        self._thread = threading.Thread(target=self._serve, name="emulator", daemon=True)
        self._thread.start()
        return self

    def stop(self) -> None:
        """Close the port. May be called twice.

        Raises:
            InvalidValueError: The signal failed and ended the emulator earlier.
        """
        if self._thread is None:
            return
        self._stopping = True
        self._wake()
        self._thread.join()
        self._thread = None
        self.unplug()
        self._close_pipe()
        self._raise_error()

    def wait(self, seconds: float) -> None:
        """Wait for `seconds` while the emulator runs.

        Raises:
            InvalidValueError: The signal failed and ended the emulator.
        """
        if self._thread is not None:
            self._thread.join(seconds)
            self._raise_error()

    def unplug(self) -> None:
        """Remove the port, as if the cable were pulled."""
        with self._lock:
            self._unplug()
        # the port stays open while the thread waits for it, so wake the thread
        self._wake()

    def plug(self) -> None:
        """Bring the port back after a power-on: another pseudo-terminal, under the same link if there is one.

        Raises:
            OutputExistsError: The link's path exists and is not a link to a port.
        """
        with self._lock:
            if self._terminal is not None:
                return
            terminal = emulated_port(self.profile.family) if self._last is None else self._last.reopened()
            try:
                self._point_link(terminal.name)
            except BaseException:
                terminal.close()
                raise
            self._board = self._power_on()
            self._line.clear()
            self._unsent = b""
            self._noise = self._faulty.noise()
            self._was_open = False
            self._terminal = terminal

    def __enter__(self) -> Emulator:
        """Start the emulator."""
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the emulator."""
        self.stop()

    def _power_on(self) -> EmulatedBoard:
        # a stream has the rate of its messages, each of which holds a new measurement
        rate = self._rate if emulated_class(self.profile.family).stream_rate is None else None
        pads = EmulatedPads(
            self.profile,
            self._signal,
            rate=rate,
            gate=self._gate,
            shear_floor=self._shear_floor,
            resultant=self._resultant,
        )
        return make_board(pads, self._rate, self._pace, self._faulty)

    def _serve(self) -> None:
        """Answer, stream and wait; runs in the thread."""
        try:
            while not self._stopping:
                with self._lock:
                    until = self._step(time.monotonic() - self._start)
                    terminal = self._terminal
                seconds = min(max(until - (time.monotonic() - self._start), 0.0), _LONGEST_WAIT)
                if terminal is None or not self._was_open:
                    # a closed port always reports ready, so poll it instead
                    time.sleep(min(seconds, _LOOK_FOR_HOST))
                else:
                    terminal.wait(seconds, self._wake_read, blocked=bool(self._unsent))
                    with contextlib.suppress(BlockingIOError):
                        os.read(self._wake_read, 64)
        except Exception as error:
            self._error = error
            self.unplug()

    def _step(self, now: float) -> float:
        """Do what is due and return the time (s) at which the next step is due."""
        terminal, board = self._terminal, self._board
        if terminal is None:
            return now + _LOOK_FOR_HOST
        was_open, self._was_open = self._was_open, terminal.is_open
        if not self._was_open:
            board.answers(terminal.read(), now)
            board.tick(now)
            return now + _LOOK_FOR_HOST
        if not was_open:
            self._line.clear()
            self._unsent = b""
            self._line.put([(0.0, self._noise)], now)
            self._noise = b""
        for message in board.answers(terminal.read(), now):
            self._send(message, now)
        # feed a paced stream just in time: the line never idles and no message ages in it
        while self._terminal is not None and board.due <= now and self._room_at(now) <= now:
            self._send(board.tick(now), now)
        if self._faulty.held and now >= self._release_at:
            self._line.put([(0.0, self._faulty.release())], now)
        self._hand_over(now)
        release_at = self._release_at if self._faulty.held else math.inf
        passed_at = self._line.next if self._pace or not self._unsent else math.inf
        return min(max(board.due, self._room_at(now)), release_at, passed_at)

    def _room_at(self, now: float) -> float:
        """Return the time (s) at which the line takes the next message of a stream."""
        if self._pace:
            return self._line.free_at - GRAIN
        return math.inf if self._unsent or self._line.next < math.inf else now

    def _send(self, message: bytes, now: float) -> None:
        if self._terminal is None:
            return
        written, pieces = self._faulty.send(message)
        self._release_at = now + MERGE_WAIT
        self._line.put(pieces, now)
        self.messages += 1
        if self.sent is not None:
            self.sent.append(Sent(message, written))
        if self.messages == self._faults.unplug_after:
            self._hand_over(math.inf)
            self._unplug()

    def _hand_over(self, now: float) -> None:
        terminal = self._terminal
        if terminal is None:
            return
        data = self._unsent + self._line.take(now)
        if data:
            self._unsent = data[terminal.write(data) :]
        if self._pace:
            # a serial line does not wait for its reader
            self.overruns += max(len(self._unsent) - HOST_BUFFER, 0)
            self._unsent = self._unsent[:HOST_BUFFER]

    def _unplug(self) -> None:
        if self._terminal is None:
            return
        terminal, self._terminal = self._terminal, None
        self._last = terminal
        if self._link is not None:
            with contextlib.suppress(OSError):
                if os.readlink(self._link) == terminal.name:
                    self._link.unlink()
        terminal.close()

    def _point_link(self, target: str) -> None:
        if self._link is None:
            return
        if "://" in target:
            raise InvalidValueError(
                f"a link is made to the file of a serial port, but profile {self.profile.name!r} has the address "
                f"{target}: open that instead"
            )
        to_port = self._link.is_symlink() and os.readlink(self._link).startswith("/dev/")
        if self._link.exists() and not to_port:
            raise OutputExistsError(f"{self._link} exists and is no link to a port: remove it or choose another name")
        new = self._link.with_name(f".{self._link.name}.{os.getpid()}")
        new.unlink(missing_ok=True)
        new.symlink_to(target)
        os.replace(new, self._link)

    def _wake(self) -> None:
        if self._thread is not None:
            os.write(self._wake_write, b"\0")

    def _close_pipe(self) -> None:
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _raise_error(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error


def make_board(pads: EmulatedPads, rate: float | None, pace: bool, faulty: FaultyLine) -> EmulatedBoard:
    """Return an emulated board of the profile's family, just after power-on.

    Args:
        pads: Pads on the board; their profile names the family.
        rate: Message rate of a stream (Hz); None: the family's own.
        pace: Whether a stream keeps to a rate at all.
        faulty: Source of the error bytes.
    """
    board = emulated_class(pads.profile.family)
    streams: dict[str, Any] = {}
    if board.stream_rate is not None:
        streams["rate"] = (rate or board.stream_rate) if pace else None
    return board(pads, wrong_status=faulty.wrong_status, **streams)
