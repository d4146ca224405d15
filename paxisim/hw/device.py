"""Sensor on one or several ports, read in the background."""

from __future__ import annotations

import os
import threading
import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import TracebackType

from numpy.typing import ArrayLike

from paxisim.errors import DeviceError, DeviceTimeoutError, InvalidValueError
from paxisim.hw.calibrated import SensorCalibration
from paxisim.hw.families.board import Board
from paxisim.hw.families.load import board_class, open_port
from paxisim.hw.frame import Frame
from paxisim.hw.link.clock import Clock, SystemClock
from paxisim.hw.link.frame_joiner import FrameJoiner
from paxisim.hw.link.frame_queue import FrameQueue
from paxisim.hw.link.reader import Reader
from paxisim.hw.profiles.load import as_profile
from paxisim.hw.profiles.profile import Profile
from paxisim.layout import TaxelLayout


class ZeroInDoubtWarning(UserWarning):
    """A board that zeroed itself may have lost power since, and its zero with it."""


def open_sensor(
    port: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    profile: str | os.PathLike[str] | Profile,
    *,
    queue: int = 256,
    reconnect: float = 10.0,
    calibration: SensorCalibration | None = None,
    covariates: Callable[[], Mapping[str, ArrayLike]] | None = None,
    clock: Clock | None = None,
) -> TactileSensor:
    """Open a sensor and start reading it.

    Example::

        with paxisim.open_sensor("/dev/ttyACM0", profile="gen2-box-120") as pads:
            pads.zero()
            for frame in pads.stream():
                print(frame.time, frame.force.sum(axis=(-2, -1)))

    Args:
        port: A device file, pseudo-terminal or pyserial URL, or a server address, ``ws://HOST:PORT``, depending on the
            profile's family. Several ports form one tensor, with their pads one after another.
        profile: A name, a profile file or a `Profile`.
        queue: Number of frames kept for a slow caller; older frames are dropped and counted.
        reconnect: Time (s) for which the driver tries to reopen a lost port before reading fails; 0: not at all.
        calibration: Converts readings other than force to newtons, e.g. ``paxisim.Calibration.load(path)``. Frames are
            then in newtons, and the resultant of a single pad is the force estimated from all channels together. A
            `paxisim.Background` subtracts the field of the robot and leaves the unit.
        covariates: Function that returns the present values of the covariates of a background, such as
            ``{"opening": 0.04}``. It is called with every frame, from the thread that reads, so it should return the
            latest values that it has and not wait for new ones. If it fails, so does the next `read`.
        clock: Clock; default: the system clock.

    Raises:
        PortNotFoundError: There is no such port.
        PortAccessError: Access to a port is denied; the message says how to get it.
        DeviceTimeoutError: The board does not answer.
        ProtocolError: The board speaks another family's protocol, or has another number of taxels.
        UnknownNameError: There is no such profile.
        InvalidValueError: No port, a duplicate port, a queue of less than one frame, a negative time, a calibration of
            another sensor, or a background without `covariates`.
        MissingExtraError: pyserial is not installed.

    Warns:
        UnverifiedProfileWarning: The profile has never been tried on a device.
    """
    ports = tuple(os.fspath(name) for name in ((port,) if isinstance(port, (str, os.PathLike)) else port))
    if not ports or len(set(ports)) != len(ports):
        raise InvalidValueError(f"port must name one port or several different ones, got {port!r}")
    if not isinstance(queue, int) or queue < 1:
        raise InvalidValueError(f"queue must be a whole number of at least 1 frame, got {queue!r}")
    if not reconnect >= 0:
        raise InvalidValueError(f"reconnect must be 0 s or more, got {reconnect!r}")
    profile = as_profile(profile)
    profile.warn_unverified()
    if calibration is not None:
        if len(ports) > 1:
            raise InvalidValueError(f"a calibration applies to the sensor on one port, got {len(ports)} ports")
        calibration.check((len(profile.slots), *profile.layout.shape), profile.unit)
        if calibration.covariates and covariates is None:
            raise InvalidValueError(
                f"the calibration subtracts a background that depends on {', '.join(calibration.covariates)}: expected "
                "covariates, a function that returns their present values"
            )
    return TactileSensor(ports, profile, queue, reconnect, clock or SystemClock(), calibration, covariates)


class TactileSensor:
    """An open sensor, created by `open_sensor`; a context manager.

    A separate thread reads each port from the moment it is open. Frames wait in a queue until `read`, `latest` or
    `stream` takes them; frames that are not taken in time are dropped, oldest first, and counted. If a board falls
    silent, the driver waits and starts it again; if a port goes away, the driver reopens it when it comes back. An
    error that ends reading is raised by the next `read`, once the frames before it have been read.

    A board that zeroed itself may lose its zero when it loses power. No source states what boards keep, and zeroing
    again while something presses would be worse. Therefore `read` warns once (`ZeroInDoubtWarning`), and
    `zero_in_doubt` stays true until the next `zero`.

    A sensor without references is closed with a ResourceWarning, as a file is. Do not rely on this: a traceback or the
    output of a notebook may still hold a reference, and with it the port.

    Several ports form one tensor: see `paxisim.hw.link.frame_joiner.FrameJoiner` for how frames are matched.

    Attributes:
        profile: Profile that says which part it is and how its bytes become the tensor.
        calibration: Calibration or background of a sensor that does not measure force; None without one.
        ports: Names of the ports.
        pads: Names of the pads, in the order of the tensor's first axis: those of the profile's slots. With several
            ports, the number of the port is appended: ``left0, right0, left1, right1``.
    """

    def __init__(
        self,
        ports: tuple[str, ...],
        profile: Profile,
        queue: int,
        reconnect: float,
        clock: Clock,
        calibration: SensorCalibration | None = None,
        covariates: Callable[[], Mapping[str, ArrayLike]] | None = None,
    ) -> None:
        """Open the ports and start reading; use `open_sensor`, which checks its arguments."""
        self.ports, self.profile, self.calibration = ports, profile, calibration
        names = [slot.name for slot in profile.slots]
        self.pads = tuple(names if len(ports) == 1 else (f"{name}{i}" for i in range(len(ports)) for name in names))
        self._queue = FrameQueue(queue)
        self._joiner = FrameJoiner(len(ports))
        self._joining = threading.Lock()
        self._closed = False
        self._has_warned = False
        self._readers = [
            Reader(
                port,
                _connector(port, profile, clock),
                self._sink(i),
                self._queue.fail,
                reconnect,
                clock,
                calibration,
                covariates,
            )
            for i, port in enumerate(ports)
        ]
        # the threads reference the readers and the queue, never the sensor, or it would never be collected
        self._finalizer = weakref.finalize(self, _close_forgotten, self._where, self._readers)
        self._finalizer.atexit = False
        try:
            # read each port as soon as it is open, so no port holds old frames when the last one opens
            for reader in self._readers:
                reader.start()
        except BaseException:
            self.close()
            raise

    @property
    def unit(self) -> str:
        """Unit of the frames: the profile's, or the calibration's."""
        return self.profile.unit if self.calibration is None else self.calibration.unit

    @property
    def layout(self) -> TaxelLayout:
        """Taxel layout of one pad."""
        return self.profile.layout

    @property
    def dropped(self) -> int:
        """Number of frames that were not read in time."""
        return self._queue.dropped

    @property
    def reconnects(self) -> int:
        """Number of times a port went away and came back."""
        return sum(reader.reconnects for reader in self._readers)

    @property
    def zero_in_doubt(self) -> bool:
        """True if a board zeroed itself and has been away or silent since: its zero may have changed."""
        return any(reader.zero_in_doubt for reader in self._readers)

    @property
    def timeouts(self) -> int:
        """Number of readings that did not arrive, or not in time."""
        return sum(reader.timeouts + reader.lost for reader in self._readers)

    @property
    def bad_checksums(self) -> int:
        """Number of frames discarded because of a wrong check byte."""
        return sum(reader.bad_checksums for reader in self._readers)

    @property
    def skipped(self) -> int:
        """Number of bytes discarded because they belonged to no frame."""
        return sum(reader.skipped for reader in self._readers)

    def read(self, timeout: float = 1.0) -> Frame:
        """Return the oldest unread frame; waits for one.

        Raises:
            DeviceTimeoutError: No frame arrived within `timeout` seconds.
            PortNotFoundError: The port went away and did not come back in time.
        """
        return self._take(timeout, newest=False)

    def latest(self, timeout: float = 1.0) -> Frame:
        """Return the newest unread frame; waits for one. Older frames are discarded and not counted as dropped.

        Raises:
            DeviceTimeoutError: No frame arrived within `timeout` seconds.
            PortNotFoundError: The port went away and did not come back in time.
        """
        return self._take(timeout, newest=True)

    def stream(self, timeout: float = 1.0) -> Iterator[Frame]:
        """Yield frames one after another without end, each as returned by `read`."""
        while True:
            yield self.read(timeout)

    def zero(self, software: bool | None = None) -> None:
        """Make the present reading of the pads their zero. Leave the pads untouched meanwhile. Discards unread frames.

        Args:
            software: False: the board zeroes itself. True: the mean of the next 0.5 s is subtracted from every frame
                (force and resultant), until the sensor is closed or the board zeroes itself. None: the board zeroes
                itself if it can, else as with True.

        Raises:
            UnsupportedError: `software` is False and the board cannot zero itself.
            DeviceTimeoutError: The board does not answer.
            PortNotFoundError: The port is away.
        """
        self._check_open()
        for done in [reader.zero(software) for reader in self._readers]:
            done.result()
        with self._joining:
            self._joiner.clear()
            self._queue.clear()
        self._has_warned = False

    def version(self) -> str:
        """Return the version that the board reports, empty if its protocol has no such request; one line per port.

        Raises:
            DeviceTimeoutError: The board does not answer.
            PortNotFoundError: The port is away.
        """
        self._check_open()
        return "\n".join(answer.result() for answer in [reader.version() for reader in self._readers])

    def close(self) -> None:
        """Stop reading and release the ports. May be called twice."""
        self._closed = True
        self._finalizer.detach()
        _close_readers(self._readers)
        self._queue.fail(DeviceError(f"{self._where} is closed"))
        self._queue.clear()

    def __enter__(self) -> TactileSensor:
        """Return the sensor itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the sensor."""
        self.close()

    def __repr__(self) -> str:
        """Return profile, ports, pads and counters."""
        state = "closed" if self._closed else "open"
        pads = f"{len(self.pads)} pad{'s' * (len(self.pads) != 1)} of {self.layout.rows}x{self.layout.cols}"
        counters = f"{self.dropped} dropped, {self.reconnects} reconnects, {self.bad_checksums} bad checksums"
        return f"<TactileSensor {self.profile.name} on {self._where}: {state}, {pads}, {counters}>"

    @property
    def _where(self) -> str:
        return ", ".join(self.ports)

    def _check_open(self) -> None:
        if self._closed:
            raise DeviceError(f"{self._where} is closed")

    def _take(self, timeout: float, newest: bool) -> Frame:
        self._check_open()
        if self.zero_in_doubt and not self._has_warned:
            self._has_warned = True
            warnings.warn(
                f"{self._where} was zeroed, then away or silent, so its zero may have changed: "
                "call zero() again once nothing touches the pads",
                ZeroInDoubtWarning,
                stacklevel=3,
            )
        frame = self._queue.get(timeout, newest)
        if frame is None:
            faults = "".join(f"; {reader.fault}" for reader in self._readers if reader.fault)
            raise DeviceTimeoutError(f"no frame from {self._where} within {timeout:g} s{faults}")
        return frame

    def _sink(self, port: int) -> Callable[[Frame], None]:
        """Return the function that takes the frames of `port`."""
        queue, joiner, joining = self._queue, self._joiner, self._joining
        if len(self.ports) == 1:
            return queue.put

        def put(frame: Frame) -> None:
            with joining:
                for joined in joiner.push(port, frame):
                    queue.put(joined)

        return put


def _close_readers(readers: list[Reader]) -> None:
    for reader in readers:
        reader.stop()
    for reader in readers:
        reader.close()


def _close_forgotten(where: str, readers: list[Reader]) -> None:
    _close_readers(readers)
    warnings.warn(
        f"the sensor on {where} was not closed: use close() or a with statement", ResourceWarning, stacklevel=2
    )


def _connector(port: str, profile: Profile, clock: Clock) -> Callable[[], Board]:
    """Return a function that opens `port` and creates the board of the profile's family on it, not started."""

    def connect() -> Board:
        board = board_class(profile.family)
        transport = open_port(profile.family)(port, profile.baud)
        try:
            return board(transport, profile, clock)
        except BaseException:
            transport.close()
            raise

    return connect
