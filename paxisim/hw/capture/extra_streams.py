"""Extra streams of a recording: numbers from other sources, recorded beside the tactile frames without delaying them.

Each source reads in its own thread and puts its samples into one bounded queue. Samples that find the queue full are
dropped and counted. Unusable input is counted and reported, and never ends a recording.
"""

from __future__ import annotations

import math
import os
import queue
import select
import socket
import sys
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, PortAccessError
from paxisim.hw.link.clock import Clock

POLL_SECONDS = 0.1  # seconds after which a waiting thread checks whether to end
MAX_LINE_BYTES = 1 << 16  # bytes; a longer line is rejected
MAX_NAMES = 500  # streams of one source; a message with every joint of a humanoid has fewer
MAX_CLOCK_OFF = 1.0  # s; a sender's clock that is further off is said to be
DAY = 86400.0
EPISODE_WORD = "episode"
ENTER_KEY = "Enter"


@dataclass(frozen=True, eq=False)
class Sample:
    """One value of one extra stream.

    Attributes:
        source: Source of the sample, which also counts its failures.
        stream: ``covariate/NAME``, or ``episode`` for the beginning of a new episode.
        value: A finite number or array.
        arrival: Arrival time (s, the host's monotonic clock).
        time: Timestamp from the source (seconds since 1970-01-01 UTC); None if the source gives none.
        number: Number of the line, datagram or call that held the sample, which may hold several; None if each sample
            counts on its own.
    """

    source: ExtraStream
    stream: str
    value: NDArray[np.float64]
    arrival: float
    time: float | None = None
    number: int | None = None


class ExtraStream(ABC):
    """A source of samples.

    Attributes:
        label: Name of the source in messages.
        bad: Lines, datagrams, calls or values that could not be used.
        dropped: Samples that found the queue full.
        missed: Function calls skipped because the previous call was still running when they were due.
        problem: Reason for the latest bad item; empty while there is none.
        ended: True once nothing more can arrive.
        clock_off: Largest difference (s) of a sample's own time from this machine's clock at its arrival; negative if
            it is earlier.
    """

    def __init__(self, label: str) -> None:
        """Store the label; `start` begins to read."""
        self.label = label
        self.bad = 0
        self.dropped = 0
        self.missed = 0
        self._sets = 0
        self.clock_off = 0.0
        self._names: set[str] = set()
        self.problem = ""
        self.ended = False
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, inbox: queue.Queue[Sample], clock: Clock) -> None:
        """Begin to read, once; samples go to `inbox` with timestamps from `clock`."""
        self._inbox, self._clock = inbox, clock
        self._thread = threading.Thread(target=self._guarded, name=f"paxisim {self.label}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop reading. May be called twice, or without `start`."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=1.0)  # a thread whose function hangs is abandoned

    def complain(self, problem: str, count: int = 1) -> None:
        """Count unusable items and store the reason."""
        with self._lock:
            self.bad += count
            self.problem = f"{self.label}: {problem}"

    @abstractmethod
    def _run(self) -> None:
        """Read until `_stop` is set or nothing more can arrive."""

    def _guarded(self) -> None:
        try:
            self._run()
        except Exception as error:
            self.complain(f"reading ended: {_reason(error)}")
        finally:
            self.ended = True

    def _take(self, values: Mapping[Any, Any], arrival: float) -> None:
        """Queue the usable ones of a set of named values; a value called ``time`` is the timestamp of the others."""
        self._sets += 1
        time = None
        if "time" in values:
            time = _number(values["time"])
            if time is None or abs(time - self._clock.wall()) > DAY:
                return self.complain(
                    f"time must be Unix seconds within a day of this machine's clock, got {_short(values['time'])}"
                )
            off = time - self._clock.wall()
            self.clock_off = off if abs(off) > abs(self.clock_off) else self.clock_off
        for name, value in values.items():
            if name == "time":
                continue
            array = _array(value)
            if not _is_name(name):
                self.complain(f"expected a printable name of 1 to 100 characters, got {_short(name)}")
            elif array is None:
                self.complain(f"{name} must be finite numbers, got {_short(value)}")
            elif name not in self._names and len(self._names) >= MAX_NAMES:
                self.complain(f"more than {MAX_NAMES} names of streams came; later ones, such as {name}, are left out")
            else:
                self._names.add(name)
                self._put(Sample(self, f"covariate/{name}", array, arrival, time, self._sets))

    def _put(self, sample: Sample) -> None:
        try:
            self._inbox.put_nowait(sample)
        except queue.Full:
            self.dropped += 1


class CsvLines(ExtraStream):
    """Lines of comma-separated numbers from a file descriptor, standard input by default.

    The first line names the columns. A column called ``time`` holds Unix seconds; without it, the time of a line is its
    arrival time. A last line without a line end may have lost digits and is not used.
    """

    def __init__(self, descriptor: int = 0, label: str = "stdin") -> None:
        """Store the arguments; closing the descriptor is up to the caller."""
        super().__init__(label)
        self._descriptor = descriptor

    def _run(self) -> None:
        names: list[str] = []
        for number, raw in enumerate(_lines(self._descriptor, self._stop), start=1):
            arrival = self._clock.monotonic()
            text = raw.decode("utf-8-sig" if number == 1 else "utf-8", "replace").strip()
            if not text:
                continue
            if len(raw) > MAX_LINE_BYTES or not raw.endswith(b"\n"):
                self.complain(f"line {number} has no end: {_short(text)}")
                continue
            cells = [cell.strip().strip('"') for cell in text.split(",")]
            if not names:
                names = self._header(cells, number)
            elif len(cells) != len(names):
                self.complain(f"line {number} must have {len(names)} numbers ({', '.join(names)}), got {_short(text)}")
            elif None in (numbers := [_parsed(cell) for cell in cells]):
                self.complain(f"line {number} must hold finite numbers, got {_short(text)}")
            else:
                self._take(dict(zip(names, numbers, strict=True)), arrival)

    def _header(self, cells: list[str], number: int) -> list[str]:
        """Return the column names; empty if this line is not a header, and the next line is tried."""
        usable = all(_is_name(cell) and _parsed(cell) is None for cell in cells) and len(set(cells)) == len(cells)
        if usable and cells != ["time"]:
            return cells
        self.complain(f"line {number} must name the columns, each once, got {_short(','.join(cells))}")
        return []


class UdpJson(ExtraStream):
    """Datagrams to a local port (127.0.0.1 only), each a flat JSON object of numbers.

    Each key becomes a stream. ``time`` (Unix seconds) is the time of the other values; without it, the arrival time is.

    Attributes:
        port: Port number; the one chosen by the system if 0 was requested.
    """

    def __init__(self, port: int) -> None:
        """Open the port and listen from now on.

        Raises:
            InvalidValueError: There is no such port number.
            PortAccessError: The port is in use or not permitted.
        """
        if not 0 <= port <= 65535:
            raise InvalidValueError(f"udp must be a port number from 0 to 65535, got {port}")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", port))
        except OSError as error:
            self._socket.close()
            raise PortAccessError(f"cannot listen to UDP port {port} on this machine: {error.strerror}") from error
        self._socket.settimeout(POLL_SECONDS)
        self.port: int = self._socket.getsockname()[1]
        super().__init__(f"UDP {self.port}")

    def close(self) -> None:
        """See `ExtraStream.close`."""
        super().close()
        self._socket.close()

    def _run(self) -> None:
        import orjson

        while not self._stop.is_set():
            try:
                data = self._socket.recv(1 << 16)
            except TimeoutError:
                continue
            arrival = self._clock.monotonic()
            try:
                values = orjson.loads(data)
            except orjson.JSONDecodeError:
                values = None
            if not isinstance(values, dict):
                self.complain(
                    f"a datagram must be a JSON object of numbers, got {_short(data.decode(errors='replace'))}"
                )
                continue
            plain = {name: value for name, value in values.items() if not isinstance(value, (list, dict))}
            for name in values.keys() - plain.keys():
                self.complain(f"{_short(name)} must be a number, got {_short(values[name])}")
            self._take(plain, arrival)


class PolledFunction(ExtraStream):
    """A function called at a steady rate; it returns a number, an array, or a dict of these by name.

    The time of the returned values is the middle of the call, or the ``time`` (Unix seconds) in the dict. Calls that
    are due while a slow function still runs are skipped and counted.
    """

    def __init__(self, function: Callable[[], Any], rate: float, name: str) -> None:
        """Store the arguments; `start` begins to call.

        Args:
            function: Function without arguments, called in a thread.
            rate: Calls per second, up to 1000.
            name: Name of the stream if the function does not return a dict.

        Raises:
            InvalidValueError: The rate or the name cannot be used.
        """
        super().__init__(name)
        if not 0 < rate <= 1000:
            raise InvalidValueError(f"the rate of {name} must lie above 0 and up to 1000 Hz, got {rate:g}")
        if not _is_name(name):
            raise InvalidValueError(f"the name of a stream must be printable, of 1 to 100 characters, got {name!r}")
        self._function, self._rate, self._name = function, rate, name

    def _run(self) -> None:
        start, call = self._clock.monotonic(), 0
        while not self._stop.wait(max(0.0, start + call / self._rate - self._clock.monotonic())):
            before = self._clock.monotonic()
            try:
                value = self._function()
                middle = (before + self._clock.monotonic()) / 2
                self._take(value if isinstance(value, Mapping) else {self._name: value}, middle)
            except Exception as error:  # also raised for a value whose repr fails
                self.complain(f"the call failed: {_reason(error)}")
            due = max(call + 1, math.ceil((self._clock.monotonic() - start) * self._rate))
            self.missed += due - (call + 1)
            call = due


class EnterKey(ExtraStream):
    """Begins a new episode whenever Enter is pressed on the terminal."""

    def __init__(self, descriptor: int = 0) -> None:
        """Store the descriptor; closing it is up to the caller."""
        super().__init__(ENTER_KEY)
        self._descriptor = descriptor

    def _run(self) -> None:
        for _ in _lines(self._descriptor, self._stop):
            self._put(Sample(self, EPISODE_WORD, np.zeros(()), self._clock.monotonic()))


def load_function(text: str) -> PolledFunction:
    """Return the source named by ``module:function@HZ``; imports the module.

    Raises:
        InvalidValueError: The text has another form, there is no such function, or the module cannot be imported.
    """
    place, _, rate = text.rpartition("@")
    module, _, name = place.partition(":")
    hertz = _parsed(rate)
    if not (module and name and hertz is not None):
        raise InvalidValueError(f"a stream must be given as module:function@HZ, e.g. robot:opening@50, got {text!r}")
    return PolledFunction(import_function(module, name, f"--stream {text}"), hertz, name)


def import_function(module: str, name: str, option: str) -> Callable[[], Any]:
    """Import a user's function, also from a module in the current folder.

    Args:
        module: Name of the module.
        name: Name of the function.
        option: Option of the command line that names it, for messages.

    Raises:
        InvalidValueError: There is no such function, or the module cannot be imported.
    """
    import importlib

    if "" not in sys.path:
        sys.path.insert(0, "")  # the installed command does not look in the current folder
    try:
        function = getattr(importlib.import_module(module), name, None)
    except Exception as error:  # the user's module may raise anything
        raise InvalidValueError(f"cannot import {module!r} of {option}: {_reason(error)}") from error
    if not callable(function):
        raise InvalidValueError(f"module {module!r} has no function {name!r}, as requested by {option}")
    return function


def _lines(descriptor: int, stop: threading.Event) -> Iterator[bytes]:
    """Yield lines with their ends until the end of the file or `stop`; a line that is too long is cut and has no end.

    Reads the descriptor itself: the lock of a buffered file, held by a waiting thread, would abort Python's exit.
    """
    rest, skipping = b"", False
    while not stop.is_set():
        if not _readable(descriptor):
            continue
        data = os.read(descriptor, 1 << 16)
        if not data:
            if rest:
                yield rest
            return
        *whole, rest = (rest + data).split(b"\n")
        for line in whole:
            if not skipping:
                yield line + b"\n"
            skipping = False
        if len(rest) > MAX_LINE_BYTES:
            if not skipping:
                yield rest[: MAX_LINE_BYTES + 1]
            rest, skipping = b"", True


def _readable(descriptor: int) -> bool:
    """Return True if a read returns at once or this cannot be checked; waits up to `POLL_SECONDS`."""
    if sys.platform == "win32":
        return True
    if not select.select([descriptor], [], [], POLL_SECONDS)[0]:
        return False
    if _in_background(descriptor):  # of a shell: reading the terminal would stop the whole process
        threading.Event().wait(POLL_SECONDS)
        return False
    return True


def _in_background(descriptor: int) -> bool:
    try:
        return os.tcgetpgrp(descriptor) != os.getpgrp()
    except OSError:  # not a terminal, or not this process's controlling terminal
        return False


def _is_name(name: Any) -> bool:
    return isinstance(name, str) and bool(name.strip()) and len(name) <= 100 and name.isprintable()


def _parsed(text: str) -> float | None:
    try:
        return _number(float(text))
    except ValueError:
        return None


def _number(value: Any) -> float | None:
    """Convert to a finite number; None if that fails or the value is True or False."""
    array = _array(value)
    return float(array) if array is not None and array.ndim == 0 else None


def _array(value: Any) -> NDArray[np.float64] | None:
    """Convert to an array of at least one number, all finite; None if that fails."""
    try:
        array = np.asarray(value)
    except Exception:  # conversion may raise anything, e.g. for a torch tensor that requires a gradient
        return None
    if array.dtype.kind not in "iuf" or not array.size or not np.all(np.isfinite(array)):
        return None
    return array.astype(np.float64)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _reason(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
