"""Emulator: a sensor made of bytes, on a real serial port (a pseudo-terminal)."""

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
from paxisim.hw.emulation.board import EmulatedBoard
from paxisim.hw.emulation.pacing import GRAIN, PacedLine
from paxisim.hw.emulation.pads import EmulatedPads, Resultant, Signal
from paxisim.hw.emulation.port import Port
from paxisim.hw.families import emulated_class, emulated_port
from paxisim.hw.faults import MERGE_WAIT, Faults, FaultyLine
from paxisim.hw.profile import Profile, as_profile

REMEMBERED = 100_000
"""Messages that `Emulator.sent` keeps; older ones are forgotten."""

HOST_BUFFER = 65536
"""Bytes kept for a host that is late, as its system keeps them for a real port; what comes then is lost."""

_LOOK_FOR_HOST = 2e-3  # seconds between two looks whether a host has opened the port; one waits 10 ms for an answer
_LONGEST_WAIT = 1.0


@dataclass(frozen=True)
class Sent:
    """A message that left the emulator.

    Attributes:
        message: As the board made it.
        written: Its bytes as they left, after the faults.
    """

    message: bytes
    written: bytes


class Emulator:
    """Speaks a profile's protocol byte for byte on a pseudo-terminal, in a thread of its own; a context manager.

    Made for Linux; on macOS, which has pseudo-terminals as well, it was not tried.

    Example::

        with Emulator("gen3-highspeed", press("gen3-highspeed")) as sensor:
            pads = open_sensor(sensor.port, "gen3-highspeed")

    What it does like a real board: the forces are measured at the board's rate, become whole counts, are gated and
    clipped; bytes leave no faster than the line carries them, and what the host does not fetch in time is lost;
    plugging in is a power-on, with nothing zeroed and nothing configured. What the boards do is in
    `paxisim.hw.emulation`, one module a family.

    Attributes:
        port: The name of the pseudo-terminal, to be opened as any serial port; the link where there is one.
        profile: What it speaks.
        messages: Messages sent so far.
        overruns: Bytes lost because the host did not fetch them.
        sent: What was sent, if `record_sent`: the last `REMEMBERED` messages.
    """

    def __init__(
        self,
        profile: str | os.PathLike[str] | Profile,
        signal: Signal,
        *,
        rate: float | None = None,
        gate: int | None = None,
        faults: Faults | None = None,
        link: str | os.PathLike[str] | None = None,
        seed: int = 0,
        pace: bool = True,
        resultant: Resultant | None = None,
        record_sent: bool = False,
    ) -> None:
        """Make it; `start` or ``with`` opens the port.

        Args:
            profile: A name, a profile file or a `Profile`.
            signal: The forces on the pads, ``(pads, 3, rows, cols)`` newtons of the profile's wire layout, as a
                function of the seconds since the start. Called in the emulator's thread.
            rate: Measurements, and where the board streams messages, a second (Hz). Default: the profile's; if it has
                none, a board that streams has a rate of its own family, and one that is asked measures whenever asked.
            gate: Components below so many counts read 0. Default: 2 on GEN3 boards, where real parts were seen to do
                so; 0 on the others, of which nobody says.
            faults: What goes wrong; default: nothing.
            link: A symbolic link to the port, which keeps its name when the port changes: a port that is plugged in
                again is another pseudo-terminal. While unplugged it is away.
            seed: Of the faults.
            pace: Whether rate and line speed count. If not, a stream goes as fast as the host takes it, and nothing is
                ever lost.
            resultant: What the board reports as a pad's total, see `EmulatedPads`.
            record_sent: Whether to fill `sent`.

        Raises:
            InvalidValueError: The signal does not fit the profile, or a number that cannot be.
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
        self._signal, self._gate, self._resultant, self._pace = signal, gate, resultant, pace
        self._faults = Faults() if faults is None else faults
        self._faulty = FaultyLine(self._faults, seed)
        self._link = None if link is None else Path(link)
        self.messages = self.overruns = 0
        self.sent: deque[Sent] | None = deque(maxlen=REMEMBERED) if record_sent else None
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
        """See the class.

        Raises:
            DeviceError: It is unplugged or not started.
        """
        if self._terminal is None:
            raise DeviceError("the emulator has no port: it is unplugged or not started")
        return self._terminal.name if self._link is None else str(self._link)

    @property
    def plugged(self) -> bool:
        """Whether there is a port."""
        return self._terminal is not None

    def start(self) -> Emulator:
        """Open the port and answer.

        Raises:
            OutputExistsError: Something else than a link has the link's name.
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
            InvalidValueError: The signal failed, which ended it before.
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
        """Let it run for so long (s).

        Raises:
            InvalidValueError: The signal failed, which ended it.
        """
        if self._thread is not None:
            self._thread.join(seconds)
            self._raise_error()

    def unplug(self) -> None:
        """Take the port away, as when the cable is pulled."""
        with self._lock:
            self._unplug()
        # a port that the thread waits for stays open until it looks up
        self._wake()

    def plug(self) -> None:
        """Bring a port back, after power-on: another pseudo-terminal, under the same link if there is one.

        Raises:
            OutputExistsError: Something else than a link has the link's name.
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
        """Start."""
        return self.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop."""
        self.stop()

    def _power_on(self) -> EmulatedBoard:
        # a stream's rate is that of its messages, each of which is measured anew
        rate = self._rate if emulated_class(self.profile.family).stream_rate is None else None
        pads = EmulatedPads(self.profile, self._signal, rate=rate, gate=self._gate, resultant=self._resultant)
        return make_board(pads, self._rate, self._pace, self._faulty)

    def _serve(self) -> None:
        """The thread: answer, stream, wait."""
        try:
            while not self._stopping:
                with self._lock:
                    until = self._step(time.monotonic() - self._start)
                    terminal = self._terminal
                seconds = min(max(until - (time.monotonic() - self._start), 0.0), _LONGEST_WAIT)
                if terminal is None or not self._was_open:
                    # a closed port is always ready, so it is looked at now and then instead
                    time.sleep(min(seconds, _LOOK_FOR_HOST))
                else:
                    terminal.wait(seconds, self._wake_read, blocked=bool(self._unsent))
                    with contextlib.suppress(BlockingIOError):
                        os.read(self._wake_read, 64)
        except Exception as error:
            self._error = error
            self.unplug()

    def _step(self, now: float) -> float:
        """Do what is due and say until when nothing else is (s)."""
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
        # a paced stream is fed just in time, so that the line is never idle and nothing grows old in it
        while self._terminal is not None and board.due <= now and self._room_at(now) <= now:
            self._send(board.tick(now), now)
        if self._faulty.held and now >= self._release_at:
            self._line.put([(0.0, self._faulty.release())], now)
        self._hand_over(now)
        release_at = self._release_at if self._faulty.held else math.inf
        passed_at = self._line.next if self._pace or not self._unsent else math.inf
        return min(max(board.due, self._room_at(now)), release_at, passed_at)

    def _room_at(self, now: float) -> float:
        """When the line takes the next message of a stream (s)."""
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
            # a line does not wait for its reader
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
                f"a link is made to the file of a serial port, but profile {self.profile.name!r} has an address, "
                f"{target}: open that"
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
    """The board of the profile's family, just after power-on.

    Args:
        pads: What hangs on it; its profile names the family.
        rate: Messages a second of a stream (Hz); None: the family's own.
        pace: Whether a stream keeps to a rate at all.
        faulty: Where its error bytes come from.
    """
    board = emulated_class(pads.profile.family)
    streams: dict[str, Any] = {}
    if board.stream_rate is not None:
        streams["rate"] = (rate or board.stream_rate) if pace else None
    return board(pads, wrong_status=faulty.wrong_status, **streams)
