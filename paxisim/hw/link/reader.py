"""Reader: reads one port in the background."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import DeviceError, DeviceTimeoutError, PortNotFoundError, ProtocolError, UnsupportedError
from paxisim.hw.calibrated import SensorCalibration
from paxisim.hw.families.board import Board, Reading
from paxisim.hw.frame import Frame
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.recognise import who_answers
from paxisim.hw.link.sample_time import SampleClock

READ_TIMEOUT = 0.5
"""Maximum time (s) for one reading; a silent board delays commands and `Reader.close` by as much."""

RESTART_AFTER = 1.5
"""Silence (s) after which the board is started again: it may have lost power while its line stayed up."""

STALL = 0.3
"""Pause (s) before a queue of frames beyond which this program is taken to have been suspended."""

FIRST_RETRY, LAST_RETRY = 0.05, 1.0
"""Delays (s) between attempts to reopen a lost port: the first one doubles up to the last one."""

CLOSE_TIMEOUT = 10.0
"""Maximum time (s) that `Reader.close` waits, in case a system call never returns."""

ZERO_TIME = 0.5
"""Duration (s) of the frames whose mean becomes the zero if the board cannot zero itself."""

Result = TypeVar("Result")


class Reader:
    """Reads one board in its own thread, and reconnects when the port goes away.

    Only that thread uses the board while it runs: commands are queued and run between two readings.

    Attributes:
        port: Name of the port.
        timeouts: Number of readings that did not arrive in time.
        reconnects: Number of times the port went away and came back.
        fault: The latest fault, for messages; empty while readings arrive.
        zero_in_doubt: True if the board zeroed itself and has been opened or started again since.
    """

    def __init__(
        self,
        port: str,
        connect: Callable[[], Board],
        deliver: Callable[[Frame], None],
        fail: Callable[[Exception], None],
        reconnect: float,
        clock: Clock,
        calibration: SensorCalibration | None = None,
        covariates: Callable[[], Mapping[str, ArrayLike]] | None = None,
    ) -> None:
        """Store the arguments; no I/O.

        Args:
            port: Name of the port, for messages.
            connect: Opens the port and creates the board on it, not started.
            deliver: Called with every frame, from the thread. The sequence numbers count the readings of this port.
            fail: Called once with the error that ends the thread.
            reconnect: Time (s) for which to try to reopen a lost port.
            clock: Clock.
            calibration: Converts what the board measures.
            covariates: Returns the present values that the calibration needs; called from the thread with every frame.
        """
        self.port = port
        self.timeouts = self.reconnects = 0
        self.fault = ""
        self.zero_in_doubt = False
        self._connect, self._deliver, self._fail = connect, deliver, fail
        self._reconnect, self._clock, self._calibration = reconnect, clock, calibration
        self._covariates = covariates
        self._board: Board | None = None
        self._gone_bad_checksums = self._gone_skipped = self._gone_lost = 0
        self._sample_clock = SampleClock()
        self._sequence = 0
        self._arrived, self._stalled = math.inf, 0.0
        self._zero: Frame | None = None
        self._board_zeroed = False
        self._heard = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"paxisim reader {port}", daemon=True)
        self._lock = threading.Lock()
        self._commands: deque[tuple[Callable[[], object], Future]] = deque()
        self._ended: Exception | None = None

    @property
    def bad_checksums(self) -> int:
        """`Board.bad_checksums`, summed over all connections."""
        board = self._board
        return self._gone_bad_checksums + (board.bad_checksums if board else 0)

    @property
    def skipped(self) -> int:
        """`Board.skipped`, summed over all connections."""
        board = self._board
        return self._gone_skipped + (board.skipped if board else 0)

    @property
    def lost(self) -> int:
        """`Board.lost`, summed over all connections."""
        board = self._board
        return self._gone_lost + (board.lost if board else 0)

    def start(self) -> None:
        """Open the port, start the board, then the thread. If that fails, nothing stays open.

        Raises:
            DeviceError: The port could not be opened or the board not started.
        """
        self._open()
        self._thread.start()

    def stop(self) -> None:
        """Tell the thread to end; returns at once."""
        self._stop.set()

    def close(self) -> None:
        """End the thread and release the port; waits for the current reading. May be called twice."""
        self._stop.set()
        # the reader thread itself may garbage-collect a forgotten sensor
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(CLOSE_TIMEOUT)

    def zero(self, software: bool | None) -> Future[None]:
        """Make the present reading of the pads their zero: see `TactileSensor.zero`."""
        return self._submit(lambda: self._take_zero(software))

    def version(self) -> Future[str]:
        """Ask the board for its version."""
        return self._submit(lambda: self._at_hand().version())

    def _submit(self, command: Callable[[], Result]) -> Future[Result]:
        future: Future[Result] = Future()
        with self._lock:
            if self._ended:
                future.set_exception(self._ended)
            else:
                self._commands.append((command, future))
        return future

    def _run(self) -> None:
        error = None
        try:
            while not self._stop.is_set():
                self._run_commands()
                try:
                    self._read()
                except (DeviceTimeoutError, ProtocolError) as fault:
                    self._be_patient(fault)
                except PortNotFoundError as gone:
                    self._come_back(gone)
        except Exception as fatal:  # whatever it is, it is passed to the caller
            error = fatal
        with self._lock:
            self._ended = error or DeviceError(f"{self.port} is closed")
        self._refuse_commands(self._ended)
        self._let_go()
        if error:
            self._fail(error)

    def _at_hand(self) -> Board:
        if self._board is None:
            raise PortNotFoundError(f"{self.port} is not open")
        return self._board

    def _open(self) -> None:
        board = self._connect()
        try:
            self._start(board)
        except BaseException:
            board.transport.close()
            raise
        self._board = board
        self._heard = self._clock.monotonic()
        self._sample_clock.reset()

    def _start(self, board: Board) -> None:
        """Start the board; if it is silent, check whether a board of another family answers."""
        try:
            board.start()
        except DeviceTimeoutError as silence:
            other = who_answers(board.transport, self._clock, board.profile.family)
            if not other or f"'{board.profile.family}'" in other:
                raise
            raise ProtocolError(
                f"profile {board.profile.name!r} is for the family {board.profile.family!r}, but the board on "
                f"{self.port} sends {other}; choose a profile of that family"
            ) from silence

    def _let_go(self) -> None:
        board, self._board = self._board, None
        if board is None:
            return
        self._gone_bad_checksums += board.bad_checksums
        self._gone_skipped += board.skipped
        self._gone_lost += board.lost
        with suppress(DeviceError):  # a lost board cannot be stopped
            board.stop()
        board.transport.close()

    def _read(self) -> Frame:
        """Take one reading and deliver it; return it without the software zero applied."""
        board = self._at_hand()
        reading = board.read(READ_TIMEOUT)
        self._heard, self.fault = self._clock.monotonic(), ""
        force = board.profile.to_force(reading.counts)
        resultant = None if reading.resultant is None else board.profile.resultant_force(reading.resultant)
        unit = board.profile.unit
        if self._calibration is not None:
            force, resultant = self._converted(self._calibration, force)
            unit = self._calibration.unit
        time = self._sample_clock.estimate(reading.time, reading.behind)
        error = self._time_error(reading)
        raw = Frame(force, time, reading.time, self._sequence, reading.status, resultant, unit, error)
        self._sequence += 1
        zero = self._zero
        if zero is None:
            self._deliver(raw)
        else:
            resultant = _minus(resultant, zero.resultant)
            force = force - zero.force
            self._deliver(Frame(force, time, reading.time, raw.sequence, reading.status, resultant, unit, error))
        return raw

    def _converted(
        self, calibration: SensorCalibration, force: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """Return the calibrated channels and the total force.

        Raises:
            DeviceError: The function that returns the covariates fails, or lacks one.
        """
        if self._covariates is None:
            return calibration.read(force, {})
        try:
            return calibration.read(force, self._covariates())
        except Exception as error:  # the user's function may raise anything
            raise DeviceError(
                f"the covariates for the frames of {self.port} failed with {type(error).__name__}: {error}"
            ) from error

    def _time_error(self, reading: Reading) -> float:
        """Return `Frame.time_error`: from a queue after a pause, until a frame comes alone and in its own time.

        How many frames of a pause were lost is not known: the system's queue may have been full, or the sender late.
        """
        gap, self._arrived = reading.time - self._arrived, reading.time
        if reading.behind and gap > STALL:
            self._stalled = gap
        elif not reading.behind and gap > 0.5 * (self._sample_clock.period or 0.0):
            self._stalled = 0.0
        return self._stalled

    def _miss(self, fault: DeviceError) -> None:
        self.timeouts += 1
        self.fault = str(fault)

    def _be_patient(self, fault: DeviceError) -> None:
        """Count a missed reading; after `RESTART_AFTER` of silence, start the board again."""
        self._miss(fault)
        if self._clock.monotonic() - self._heard < RESTART_AFTER:
            return
        # after a power loss the zero is gone, but zeroing again is unsafe while something may press
        self.zero_in_doubt |= self._board_zeroed
        try:
            self._at_hand().start()
        except PortNotFoundError as gone:
            self._come_back(gone)
        except (DeviceTimeoutError, ProtocolError) as still:
            self.fault = str(still)
        self._heard = self._clock.monotonic()
        self._sample_clock.reset()

    def _come_back(self, gone: DeviceError) -> None:
        """Reopen the port as soon as it is back.

        Raises:
            PortNotFoundError: The port did not come back in time.
        """
        self._let_go()
        why, delay = gone, FIRST_RETRY
        deadline = self._clock.monotonic() + self._reconnect
        while not self._stop.is_set():
            self.fault = str(why)
            self._refuse_commands(why)
            if self._clock.monotonic() >= deadline:
                if why is gone:
                    raise gone
                raise PortNotFoundError(f"{gone}; it did not come back within {self._reconnect:g} s: {why}") from why
            if self._stop.wait(delay):
                return
            delay = min(2 * delay, LAST_RETRY)
            try:
                self._open()
            except DeviceError as error:
                why = error
            else:
                self.reconnects += 1
                self.zero_in_doubt |= self._board_zeroed
                return

    def _run_commands(self) -> None:
        while self._commands and not self._stop.is_set():
            command, future = self._commands.popleft()
            try:
                future.set_result(command())
            except Exception as error:  # belongs to the caller; if the port is gone, the next reading finds out
                future.set_exception(error)

    def _refuse_commands(self, error: Exception) -> None:
        while self._commands:
            self._commands.popleft()[1].set_exception(error)

    def _take_zero(self, software: bool | None) -> None:
        if not software:
            try:
                self._at_hand().zero()
                self._zero, self._board_zeroed, self.zero_in_doubt = None, True, False
                return
            except UnsupportedError:
                if software is False:
                    raise
        end = self._clock.monotonic() + ZERO_TIME
        frames: list[Frame] = []
        while self._clock.monotonic() < end or not frames:
            if self._stop.is_set():
                raise DeviceError(f"{self.port} is closed")
            try:
                frames.append(self._read())
            except (DeviceTimeoutError, ProtocolError) as fault:
                self._miss(fault)
                if self._clock.monotonic() - self._heard >= RESTART_AFTER:
                    raise
        good = [frame for frame in frames if not frame.pads_in_error]
        if not good:
            raise DeviceError(
                f"{self.port} reported an error with each frame, so none can serve as zero: {frames[-1].status}"
            )
        resultants = [frame.resultant for frame in good if frame.resultant is not None]
        self._zero = Frame(
            np.mean([frame.force for frame in good], axis=0, dtype=np.float64).astype(np.float32),
            good[-1].time,
            good[-1].arrival,
            good[-1].sequence,
            good[-1].status,
            np.mean(resultants, axis=0, dtype=np.float64).astype(np.float32) if resultants else None,
        )
        self.zero_in_doubt = False


def _minus(resultant: NDArray[np.float32] | None, zero: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
    return resultant if resultant is None or zero is None else resultant - zero
