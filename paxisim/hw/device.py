"""A sensor on one or several ports: frames of newtons, read in the background."""

from __future__ import annotations

import os
import threading
import warnings
import weakref
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType

from paxisim.errors import DeviceError, DeviceTimeoutError, InvalidValueError
from paxisim.hw.board import Board
from paxisim.hw.calibrated import SensorCalibration
from paxisim.hw.clock import Clock, SystemClock
from paxisim.hw.families import board_class, open_port
from paxisim.hw.frame import Frame
from paxisim.hw.frame_joiner import FrameJoiner
from paxisim.hw.frame_queue import FrameQueue
from paxisim.hw.profile import Profile, as_profile
from paxisim.hw.reader import Reader
from paxisim.layout import TaxelLayout


class ZeroInDoubtWarning(UserWarning):
    """A board that zeroed itself may have lost its power since, and its zero with it."""


def open_sensor(
    port: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    profile: str | os.PathLike[str] | Profile,
    *,
    queue: int = 256,
    reconnect: float = 10.0,
    calibration: SensorCalibration | None = None,
    clock: Clock | None = None,
) -> TactileSensor:
    """Open a sensor and start reading it.

    Example::

        with paxisim.open_sensor("/dev/ttyACM0", profile="gen2-box-120") as pads:
            pads.zero()
            for frame in pads.stream():
                print(frame.time, frame.force.sum(axis=(-2, -1)))

    Args:
        port: A device file, pseudo-terminal or pyserial URL, or the address of a server, ``ws://HOST:PORT``, as the
            profile's family wants; several make one tensor, their pads one after another.
        profile: A name, a profile file or a `Profile`.
        queue: Frames kept for a reader that is late; older ones are dropped and counted.
        reconnect: Seconds for which a port that went away is tried again before reading fails; 0: not at all.
        calibration: Makes newtons of a sensor that measures something else, e.g. ``paxisim.Calibration.load(path)``.
            Frames are then in newtons, and of a single pad the resultant is the force that all channels together say.
        clock: Time; default: the machine's.

    Raises:
        PortNotFoundError: There is no such port.
        PortAccessError: A port may not be opened; the message says how to be let in.
        DeviceTimeoutError: The board does not answer.
        ProtocolError: The board speaks another family's language, or has another number of taxels.
        UnknownNameError: There is no such profile.
        InvalidValueError: No port, one port twice, a queue of less than one frame, a negative time, or a calibration
            of another sensor.
        MissingExtraError: pyserial is not installed.

    Warns:
        UnverifiedProfileWarning: Nobody has tried the profile on a device.
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
            raise InvalidValueError(f"a calibration is of the sensor on one port, got {len(ports)} ports")
        calibration.check((len(profile.slots), *profile.layout.shape), profile.unit)
    return TactileSensor(ports, profile, queue, reconnect, clock or SystemClock(), calibration)


class TactileSensor:
    """An open sensor, made by `open_sensor`; a context manager.

    Each port is read in a thread of its own from the moment it is open. Frames wait in a queue until `read`, `latest`
    or `stream` takes them; what nobody takes in time is dropped, oldest first, and counted. A board that falls silent
    is waited for and started again; a port that goes away is opened again when it comes back. What ends the reading is
    raised by the next `read`, once the frames before it are read.

    A board that zeroed itself may lose its zero with its power. No source says what boards keep, and to zero again
    while something presses would be worse: `read` warns once (`ZeroInDoubtWarning`), and `zero_in_doubt` stays true
    until the next `zero`.

    One that nobody holds any more is closed as a file is, with a ResourceWarning. Do not rely on it: a traceback or the
    output of a notebook may hold it still, and with it the port.

    Several ports make one tensor: see `paxisim.hw.frame_joiner.FrameJoiner` for which frames go together.

    Attributes:
        profile: Which part it is, and how its bytes become the tensor.
        calibration: What makes newtons of it, where it measures something else.
        ports: Where it hangs.
        pads: The pads' names, in the order of the tensor's first axis: those of the profile's slots; of several ports
            with the number of the port, ``left0, right0, left1, right1``.
    """

    def __init__(
        self,
        ports: tuple[str, ...],
        profile: Profile,
        queue: int,
        reconnect: float,
        clock: Clock,
        calibration: SensorCalibration | None = None,
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
                port, _connector(port, profile, clock), self._sink(i), self._queue.fail, reconnect, clock, calibration
            )
            for i, port in enumerate(ports)
        ]
        # the threads hold readers and queue, never the sensor
        self._finalizer = weakref.finalize(self, _close_forgotten, self._where, self._readers)
        self._finalizer.atexit = False
        try:
            # each is read as soon as it is open, so that none has old frames when the last one is
            for reader in self._readers:
                reader.start()
        except BaseException:
            self.close()
            raise

    @property
    def unit(self) -> str:
        """Unit of its frames: the profile's, or newtons where it is calibrated."""
        return self.profile.unit if self.calibration is None else "N"

    @property
    def layout(self) -> TaxelLayout:
        """The taxels of one pad."""
        return self.profile.layout

    @property
    def dropped(self) -> int:
        """Frames that nobody read in time."""
        return self._queue.dropped

    @property
    def reconnects(self) -> int:
        """How often a port went away and came back."""
        return sum(reader.reconnects for reader in self._readers)

    @property
    def zero_in_doubt(self) -> bool:
        """Whether a board zeroed itself and was away, or silent, since: it may have another zero now."""
        return any(reader.zero_in_doubt for reader in self._readers)

    @property
    def timeouts(self) -> int:
        """Readings that did not come in time."""
        return sum(reader.timeouts for reader in self._readers)

    @property
    def bad_checksums(self) -> int:
        """Frames thrown away because their check byte did not fit."""
        return sum(reader.bad_checksums for reader in self._readers)

    @property
    def skipped(self) -> int:
        """Bytes thrown away because they belonged to no frame."""
        return sum(reader.skipped for reader in self._readers)

    def read(self, timeout: float = 1.0) -> Frame:
        """The oldest frame not yet read; waits for one.

        Raises:
            DeviceTimeoutError: None came within `timeout` seconds.
            PortNotFoundError: The port went away and did not come back in time.
        """
        return self._take(timeout, newest=False)

    def latest(self, timeout: float = 1.0) -> Frame:
        """The newest frame not yet read; older ones are thrown away, and not counted as dropped. Waits for one.

        Raises:
            DeviceTimeoutError: None came within `timeout` seconds.
            PortNotFoundError: The port went away and did not come back in time.
        """
        return self._take(timeout, newest=True)

    def stream(self, timeout: float = 1.0) -> Iterator[Frame]:
        """Frames one after another, for ever; each as `read` gives it."""
        while True:
            yield self.read(timeout)

    def zero(self, software: bool | None = None) -> None:
        """Take what the pads read now as zero. Leave them untouched meanwhile. Frames not yet read are thrown away.

        Args:
            software: False: the board zeroes itself. True: the mean of the next 0.5 s is subtracted from every frame
                (force and resultant), until the sensor is closed or the board zeroes itself. None: the board where it
                can, else software.

        Raises:
            UnsupportedError: `software` is False and the board cannot.
            DeviceTimeoutError: It does not answer.
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
        """What the board says of itself, empty where its protocol has no such request; of several, one a line.

        Raises:
            DeviceTimeoutError: It does not answer.
            PortNotFoundError: The port is away.
        """
        self._check_open()
        return "\n".join(answer.result() for answer in [reader.version() for reader in self._readers])

    def close(self) -> None:
        """Stop reading and give the ports back. May be called twice."""
        self._closed = True
        self._finalizer.detach()
        _close_readers(self._readers)
        self._queue.fail(DeviceError(f"{self._where} is closed"))
        self._queue.clear()

    def __enter__(self) -> TactileSensor:
        """The sensor itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    def __repr__(self) -> str:
        """Profile, ports, pads and counters."""
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
                f"{self._where} was zeroed, then away or silent, and may have another zero now: "
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
        """Where the frames of that port go."""
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
    """What opens `port` and makes the board of the profile's family on it, not started."""

    def connect() -> Board:
        board = board_class(profile.family)
        transport = open_port(profile.family)(port, profile.baud)
        try:
            return board(transport, profile, clock)
        except BaseException:
            transport.close()
            raise

    return connect
