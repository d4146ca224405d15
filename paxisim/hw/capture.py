"""Capture: a sensor's frames, and what extra streams bring, into a file as they come."""

from __future__ import annotations

import math
import queue
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from paxisim.errors import DeviceError, DeviceTimeoutError, InvalidValueError
from paxisim.hw.clock import Clock, SystemClock
from paxisim.hw.end_signals import end_signals
from paxisim.hw.extra_streams import EPISODE, ExtraStream, Sample
from paxisim.hw.frame import Frame
from paxisim.logs.schemas import RESULTANT

if TYPE_CHECKING:
    from paxisim.hw.device import TactileSensor
    from paxisim.logs.mcap_writer import LogWriter

WAIT = 0.1  # seconds without a frame after which the rest of the loop has its turn
FLUSH = 0.5  # seconds; with a loop that comes round late, still less than the second a crash may cost
STATUS = 0.5  # seconds
GAP = 0.5  # seconds without a frame that count as a gap; boards are slower than 10 Hz only when something is wrong
INBOX = 8192  # samples of all extra streams that wait to be written

End = Literal["", "seconds", "stopped", "sensor", "disk", "file"]
"""Why a recording ended: not yet, the time asked for is over, a signal, the sensor is gone, the file takes no more, the
file is no longer at its path."""


@dataclass(frozen=True)
class ExtraSummary:
    """What came from one extra stream.

    Attributes:
        label: The source.
        samples: Lines, datagrams or calls of which something is in the file.
        bad: Lines, datagrams, calls or values that could not be used.
        dropped: Samples that came faster than they could be written.
        missed: Calls of a function that were left out, as it was still busy when they were due.
        problem: Why the latest bad one was bad; empty where none was.
        ended: True if nothing more could come from it.
    """

    label: str
    samples: int
    bad: int
    dropped: int
    missed: int
    problem: str
    ended: bool


@dataclass(frozen=True)
class CaptureSummary:
    """What a recording holds, while it grows or in the end.

    Attributes:
        path: The file.
        frames: Frames in it.
        dropped: Frames that came and were not fetched in time, by the gaps in the sensor's count. What never came whole
            has no number: see `bad_checksums`, `timeouts` and `reconnects`.
        gaps: How often no frame was measured for more than half a second, before the first and, in the end, after the
            last too. Frames that only came late, as where the system stopped this program, leave none.
        longest_gap: The longest of these times (s), be it a gap or not.
        seconds: How long the recording lasted (s).
        rate: Frames a second (Hz): while it grows of the last half second, in the end one over the median interval, as
            ``paxisim info`` gives it.
        size: Bytes of the file.
        episodes: How many episodes began.
        extra: One entry for each extra stream.
        ended: Why it ended; empty while it grows.
        error: What ended it, where nobody asked for the end.
        bad_checksums: Frames thrown away meanwhile because their check byte did not fit.
        timeouts: Readings that did not come in time meanwhile.
        reconnects: How often a port went away and came back meanwhile.
        zero_in_doubt: See `paxisim.hw.device.TactileSensor`.
    """

    path: Path
    frames: int
    dropped: int
    gaps: int
    longest_gap: float
    seconds: float
    rate: float
    size: int
    episodes: int
    extra: tuple[ExtraSummary, ...] = ()
    ended: End = ""
    error: OSError | None = None
    bad_checksums: int = 0
    timeouts: int = 0
    reconnects: int = 0
    zero_in_doubt: bool = False


def capture(
    sensor: TactileSensor,
    path: str | Path,
    *,
    extra: Sequence[ExtraStream] = (),
    seconds: float | None = None,
    overwrite: bool = False,
    on_status: Callable[[CaptureSummary], None] | None = None,
    clock: Clock | None = None,
) -> CaptureSummary:
    """Record a sensor into an MCAP file until `seconds` are over, a signal comes, or it cannot go on.

    Each frame and sample is written when it comes, none that came before the call, with its own time: the host's
    monotonic clock plus an offset to UTC that is taken once, so a clock that is set meanwhile does no harm. The file is
    flushed twice a second; killed, it lacks what came after the last flush. In any other case it is finished and valid.
    Ctrl-C, SIGTERM and SIGHUP are asked ends where this runs in the main thread.

    Args:
        sensor: An open sensor, nobody else's to read meanwhile; stays open.
        path: The file to make.
        extra: Sources beside it, not yet started; closed in the end.
        seconds: How long; default: until a signal.
        overwrite: Take the place of a file that is there.
        on_status: Called twice a second, between frames.
        clock: The clock of `sensor`; default: the machine's.

    Returns:
        What the file holds and why the recording ended. A sensor that is gone and a disk that is full are no
        exceptions but `CaptureSummary.ended` and `error`, nor is a file that was deleted or moved.

    Raises:
        InvalidValueError: `seconds` is not positive.
        OutputExistsError: The file exists and `overwrite` is off.
        OSError: The file cannot be made.
    """
    from paxisim.logs.mcap_writer import LogWriter

    if seconds is not None and not (seconds > 0 and math.isfinite(seconds)):
        raise InvalidValueError(f"seconds must be a positive number, got {seconds!r}")
    clock = clock or SystemClock()
    metadata = {
        "layout": sensor.layout,
        "pads": sensor.pads,
        "profile": sensor.profile.name,
        "profile_verified": sensor.profile.verified,
        "unit": sensor.unit,
        **({} if sensor.calibration is None else {"calibrated_from": sensor.profile.unit}),
        "ports": sensor.ports,
    }
    writer = LogWriter(path, metadata, flush_interval=FLUSH, overwrite=overwrite)
    recorder = _Recorder(sensor, writer, Path(path), tuple(extra), clock)
    stop = threading.Event()
    try:
        # an exception in the middle of a write would break the file
        with end_signals(lambda *_: stop.set()):
            return recorder.run(seconds, stop, on_status)
    finally:
        recorder.close()


class _Recorder:
    """One recording in progress."""

    def __init__(
        self, sensor: TactileSensor, writer: LogWriter, path: Path, extra: tuple[ExtraStream, ...], clock: Clock
    ) -> None:
        self.sensor, self.writer, self.path, self.extra, self.clock = sensor, writer, path, extra, clock
        self.inbox: queue.Queue[Sample] = queue.Queue(INBOX)
        self.samples = dict.fromkeys(extra, 0)
        self.numbers: dict[ExtraStream, int | None] = dict.fromkeys(extra)
        self.intervals: Counter[int] = Counter()  # us; their number is bounded, that of the frames is not
        # who brought a stream first, and of which shape; one stream is one quantity
        self.owners: dict[str, tuple[ExtraStream, tuple[int, ...]]] = {}
        self.start = clock.monotonic()
        self.offset = round(clock.wall() * 1e9) - round(self.start * 1e9)
        self.last: Frame | None = None
        self.heard = self.start
        # what the sensor counted before is not this recording's
        self.before = _damage(sensor)
        self.frames = self.dropped = self.gaps = self.episode = 0
        self.longest_gap = 0.0
        self.end: float | None = None

    def run(
        self, seconds: float | None, stop: threading.Event, on_status: Callable[[CaptureSummary], None] | None
    ) -> CaptureSummary:
        for source in self.extra:
            source.start(self.inbox, self.clock)
        ended, error = self._record(seconds, stop, on_status)
        self.end = self.clock.monotonic() if self.end is None else self.end
        self._hear(self.end)
        for source in self.extra:
            source.close()
        if ended not in ("disk", "file"):
            try:
                self._write_samples()
                self.writer.close()
            except OSError as full:
                ended, error = "disk", full
        if ended != "disk" and not self.writer.is_in_place:
            ended, error = "file", FileNotFoundError("it was deleted, moved or replaced meanwhile")
        if ended == "disk":
            self._count_what_is_held()
        return self._summary(ended=ended, error=error)

    def close(self) -> None:
        """Whatever happened: no thread is left, and the file is finished as far as it can be."""
        for source in self.extra:
            source.close()
        self.writer.close()

    def _record(
        self, seconds: float | None, stop: threading.Event, on_status: Callable[[CaptureSummary], None] | None
    ) -> tuple[End, OSError | None]:
        """Write until the end; why it is the end."""
        flushed = said = self.start
        said_frames = 0
        deadline = math.inf if seconds is None else self.start + seconds
        while True:
            now = self.clock.monotonic()
            if self.end is None and (stop.is_set() or now >= deadline):
                self.end = min(now, deadline)  # what came until then is still to be written
            try:
                frame = self.sensor.read(0.0 if self.end is not None else min(WAIT, deadline - now))
            except DeviceTimeoutError:
                frame = None
            except DeviceError as error:
                if self.end is None:
                    return "sensor", error
                frame = None
            if self.end is not None and (frame is None or frame.arrival > self.end):
                return ("seconds" if self.end == deadline else "stopped"), None
            try:
                # what waited in the queue when the recording began is no part of it
                if frame is not None and frame.arrival >= self.start:
                    self._write_frame(frame)
                self._write_samples()
                now = self.clock.monotonic()
                if now - flushed >= FLUSH:
                    self.writer.flush()
                    flushed = now
                    if not self.writer.is_in_place:
                        return "file", None
            except OSError as error:
                return "disk", error
            if on_status and now - said >= STATUS:
                on_status(self._summary(rate=(self.frames - said_frames) / (now - said)))
                said, said_frames = now, self.frames

    def _write_frame(self, frame: Frame) -> None:
        time = self._utc(frame.time)
        if self.last is None:
            self.writer.write_at(EPISODE, time, self.episode)
        else:
            self.dropped += max(0, frame.sequence - self.last.sequence - 1)
            self.intervals[round((frame.time - self.last.time) * 1e6)] += 1
        self._hear(frame.time)
        self.writer.write_at(
            "measured",
            time,
            frame.force,
            sequence=frame.sequence,
            status=frame.status,
            resultant=frame.resultant,
            arrival=self._utc(frame.arrival) * 1e-9,
        )
        self.last = frame
        self.frames += 1

    def _hear(self, time: float) -> None:
        """End a time without frames. Ones that only arrived late, as after a stall of this machine, leave no gap."""
        gap = time - self.heard
        self.gaps += gap > GAP
        self.longest_gap = max(self.longest_gap, gap)
        self.heard = time

    def _write_samples(self) -> None:
        """Write the samples that wait now; those that come meanwhile have the next turn, after a frame."""
        for _ in range(self.inbox.qsize()):
            sample = self.inbox.get_nowait()
            time = self._utc(sample.arrival) if sample.time is None else round(sample.time * 1e9)
            if sample.stream == EPISODE:
                if not self.frames:
                    continue  # the first episode has not begun
                self.episode += 1
                self.writer.write_at(EPISODE, time, self.episode)
            elif self._is_welcome(sample):
                self.writer.write_at(sample.stream, time, sample.value)
            else:
                continue
            if sample.number is None or sample.number != self.numbers[sample.source]:
                self.samples[sample.source] += 1
            self.numbers[sample.source] = sample.number

    def _count_what_is_held(self) -> None:
        """What came after the last whole chunk is not in the file of a disk that takes no more."""
        held = self.writer.held
        self.frames = held.get("measured", 0)
        self.episode = max(0, held.get(EPISODE, 0) - 1)
        for source in self.samples:
            own = [held.get(stream, 0) for stream, (owner, _) in self.owners.items() if owner is source]
            self.samples[source] = min(self.samples[source], max(own, default=self.episode))

    def _usual_rate(self) -> float:
        """One over the median interval of the frames (Hz); 0 without one."""
        passed, count = 0, sum(self.intervals.values())
        for interval, times in sorted(self.intervals.items()):
            passed += times
            if 2 * passed >= count:
                return 1e6 / interval if interval > 0 else 0.0
        return 0.0

    def _is_welcome(self, sample: Sample) -> bool:
        shape = sample.value.shape
        if sample.stream == RESULTANT:
            sample.source.complain("the name resultant is kept for the total force that the sensor reports")
            return False
        owner, first = self.owners.setdefault(sample.stream, (sample.source, shape))
        if owner is not sample.source:
            sample.source.complain(f"{sample.stream} comes from {owner.label} already")
        elif shape != first:
            sample.source.complain(f"{sample.stream} must keep its shape {first}, got {shape}")
        return owner is sample.source and shape == first

    def _utc(self, monotonic: float) -> int:
        """Nanoseconds since 1970-01-01."""
        return round(monotonic * 1e9) + self.offset

    def _summary(self, rate: float | None = None, ended: End = "", error: OSError | None = None) -> CaptureSummary:
        seconds = (self.clock.monotonic() if self.end is None else self.end) - self.start
        return CaptureSummary(
            path=self.path,
            frames=self.frames,
            dropped=self.dropped,
            gaps=self.gaps,
            longest_gap=self.longest_gap,
            seconds=seconds,
            rate=self._usual_rate() if rate is None else rate,
            size=self.writer.size,
            episodes=self.episode + bool(self.frames),
            extra=tuple(
                ExtraSummary(s.label, self.samples[s], s.bad, s.dropped, s.missed, s.problem, s.ended)
                for s in self.extra
            ),
            ended=ended,
            error=error,
            zero_in_doubt=self.sensor.zero_in_doubt,
            **{name: count - self.before[name] for name, count in _damage(self.sensor).items()},
        )


def _damage(sensor: TactileSensor) -> dict[str, int]:
    """What the sensor counts of frames that never came whole, by the names in `CaptureSummary`."""
    return {name: getattr(sensor, name) for name in ("bad_checksums", "timeouts", "reconnects")}
