"""Capture: write a sensor's frames and extra streams to a file as they arrive."""

from __future__ import annotations

import math
import queue
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from paxisim.errors import DeviceError, DeviceTimeoutError, InvalidValueError
from paxisim.hw.capture.end_signals import end_signals
from paxisim.hw.capture.extra_streams import EPISODE_WORD, ExtraStream, Sample
from paxisim.hw.frame import Frame
from paxisim.hw.link.clock import Clock, SystemClock
from paxisim.logs.schemas import RESULTANT

if TYPE_CHECKING:
    from paxisim.hw.device import TactileSensor
    from paxisim.logs.mcap_writer import LogWriter

FRAME_WAIT = 0.1  # seconds to wait for a frame before the rest of the loop runs
FLUSH_SECONDS = 0.5  # seconds; even if an iteration runs late, a crash costs less than one second
STATUS_SECONDS = 0.5  # seconds between status calls
GAP_SECONDS = 0.5  # seconds without a frame that count as a gap; boards run below 10 Hz only when something is wrong
INBOX_SIZE = 8192  # samples of all extra streams that may wait to be written

End = Literal["", "seconds", "stopped", "sensor", "disk", "file"]
"""Why a recording ended: not yet ended, requested duration reached, stopped by a signal, sensor lost, file cannot be
written any more, file no longer at its path."""


@dataclass(frozen=True)
class ExtraSummary:
    """Summary of one extra stream.

    Attributes:
        label: Name of the source.
        samples: Lines, datagrams or calls with at least one value in the file.
        bad: Lines, datagrams, calls or values that could not be used.
        dropped: Samples that arrived faster than they could be written.
        missed: Function calls skipped because the previous call was still running when they were due.
        problem: Reason for the latest bad item; empty if there was none.
        ended: True if the source could deliver nothing more.
        clock_off: Largest difference (s) of a sample's own time from this machine's clock at its arrival.
    """

    label: str
    samples: int
    bad: int
    dropped: int
    missed: int
    problem: str
    ended: bool
    clock_off: float = 0.0


@dataclass(frozen=True)
class CaptureSummary:
    """Contents and state of a recording, in progress or finished.

    Attributes:
        path: Path of the file.
        frames: Number of frames in the file.
        dropped: Frames that arrived but were not fetched in time, counted from gaps in the sensor's sequence numbers.
            Incomplete frames have no number: see `bad_checksums`, `timeouts` and `reconnects`.
        uncertain: Frames that waited while the system suspended this program, so that their times may be wrong by up to
            `longest_stall`.
        longest_stall: Longest such time (s).
        gaps: Number of intervals of more than half a second in which no frame was measured, including the time before
            the first frame and, once finished, after the last. Frames that only arrived late, for example because the
            system suspended this program, leave no gap.
        longest_gap: Longest interval without a frame (s), whether or not it counts as a gap.
        seconds: Duration of the recording (s).
        rate: Frame rate (Hz): over the last half second while in progress, and one over the median interval once
            finished, as shown by ``paxisim info``.
        size: File size in bytes.
        episodes: Number of episodes begun.
        extra: One entry per extra stream.
        ended: Why the recording ended; empty while in progress.
        error: The error that ended the recording; None if the end was requested.
        bad_checksums: Frames discarded during the recording because of a wrong check byte.
        timeouts: Readings that did not arrive in time during the recording.
        reconnects: Number of times a port went away and came back during the recording.
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
    uncertain: int = 0
    longest_stall: float = 0.0


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
    """Record a sensor to an MCAP file until `seconds` have passed, a signal arrives, or recording becomes impossible.

    Frames and samples are written as they arrive; those that arrived before the call are left out. Each carries its own
    time: the host's monotonic clock plus an offset to UTC that is determined once, so setting the system clock during a
    recording does no harm. The file is flushed twice a second. If the process is killed, the file lacks what arrived
    after the last flush; in every other case it is complete and valid. In the main thread, Ctrl-C, SIGTERM and SIGHUP
    end the recording cleanly.

    Args:
        sensor: An open sensor that nothing else reads during the recording; it stays open.
        path: Output file.
        extra: Sources recorded beside the sensor, not yet started; closed at the end.
        seconds: Duration (s); default: until a signal arrives.
        overwrite: Whether to replace an existing file.
        on_status: Called twice a second, between frames.
        clock: The clock of `sensor`; default: the system clock.

    Returns:
        What the file holds and why the recording ended. A lost sensor, a full disk and a file that was deleted or moved
        raise no exception; they are reported in `CaptureSummary.ended` and `error`.

    Raises:
        InvalidValueError: `seconds` is not positive.
        OutputExistsError: The file exists and `overwrite` is off.
        OSError: The file cannot be created.
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
        **_calibrated(sensor),
        "ports": sensor.ports,
    }
    writer = LogWriter(path, metadata, flush_interval=FLUSH_SECONDS, overwrite=overwrite)
    recorder = _Recorder(sensor, writer, Path(path), tuple(extra), clock)
    stop = threading.Event()
    try:
        # a signal raised as an exception in the middle of a write would corrupt the file
        with end_signals(lambda *_: stop.set()):
            return recorder.run(seconds, stop, on_status)
    finally:
        recorder.close()


def _calibrated(sensor: TactileSensor) -> dict[str, Any]:
    """Return the metadata of a sensor that is calibrated or whose background is subtracted."""
    if sensor.calibration is None:
        return {}
    found: dict[str, Any] = {}
    if sensor.unit != sensor.profile.unit:
        found["calibrated_from"] = sensor.profile.unit
    if sensor.calibration.covariates:
        found["background"] = list(sensor.calibration.covariates)
    return found


class _Recorder:
    """A recording in progress."""

    def __init__(
        self, sensor: TactileSensor, writer: LogWriter, path: Path, extra: tuple[ExtraStream, ...], clock: Clock
    ) -> None:
        self.sensor, self.writer, self.path, self.extra, self.clock = sensor, writer, path, extra, clock
        self.inbox: queue.Queue[Sample] = queue.Queue(INBOX_SIZE)
        self.samples = dict.fromkeys(extra, 0)
        self.numbers: dict[ExtraStream, int | None] = dict.fromkeys(extra)
        self.intervals: Counter[int] = Counter()  # microseconds; distinct values stay few however many frames arrive
        # the first source of each stream and its shape: a stream holds one quantity
        self.owners: dict[str, tuple[ExtraStream, tuple[int, ...]]] = {}
        self.start = clock.monotonic()
        self.offset = round(clock.wall() * 1e9) - round(self.start * 1e9)
        self.last: Frame | None = None
        self.heard = self.start
        # faults counted before the start are not part of this recording
        self.before = _damage(sensor)
        self.frames = self.dropped = self.gaps = self.episode = self.uncertain = 0
        self.longest_stall = 0.0
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
        """Stop all threads and finish the file as far as possible, whatever happened."""
        for source in self.extra:
            source.close()
        self.writer.close()

    def _record(
        self, seconds: float | None, stop: threading.Event, on_status: Callable[[CaptureSummary], None] | None
    ) -> tuple[End, OSError | None]:
        """Write until the end and return its reason and error."""
        flushed = said = self.start
        said_frames = 0
        deadline = math.inf if seconds is None else self.start + seconds
        while True:
            now = self.clock.monotonic()
            if self.end is None and (stop.is_set() or now >= deadline):
                self.end = min(now, deadline)  # what arrived until then is still written
            try:
                frame = self.sensor.read(0.0 if self.end is not None else min(FRAME_WAIT, deadline - now))
            except DeviceTimeoutError:
                frame = None
            except DeviceError as error:
                if self.end is None:
                    return "sensor", error
                frame = None
            if self.end is not None and (frame is None or frame.arrival > self.end):
                return ("seconds" if self.end == deadline else "stopped"), None
            try:
                # frames queued before the recording began are not part of it
                if frame is not None and frame.arrival >= self.start:
                    self._write_frame(frame)
                self._write_samples()
                now = self.clock.monotonic()
                if now - flushed >= FLUSH_SECONDS:
                    self.writer.flush()
                    flushed = now
                    if not self.writer.is_in_place:
                        return "file", None
            except OSError as error:
                return "disk", error
            if on_status and now - said >= STATUS_SECONDS:
                on_status(self._summary(rate=(self.frames - said_frames) / (now - said)))
                said, said_frames = now, self.frames

    def _write_frame(self, frame: Frame) -> None:
        time = self._utc(frame.time)
        if self.last is None:
            self.writer.write_at(EPISODE_WORD, time, self.episode)
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
            time_error=frame.time_error or None,
        )
        self.uncertain += frame.time_error > 0
        self.longest_stall = max(self.longest_stall, frame.time_error)
        self.last = frame
        self.frames += 1

    def _hear(self, time: float) -> None:
        """End an interval without frames. Frames that only arrived late, as after a stall, leave no gap."""
        gap = time - self.heard
        self.gaps += gap > GAP_SECONDS
        self.longest_gap = max(self.longest_gap, gap)
        self.heard = time

    def _write_samples(self) -> None:
        """Write the samples waiting now; later ones wait for the next iteration, after a frame."""
        for _ in range(self.inbox.qsize()):
            sample = self.inbox.get_nowait()
            time = self._utc(sample.arrival) if sample.time is None else round(sample.time * 1e9)
            if sample.stream == EPISODE_WORD:
                if not self.frames:
                    continue  # the first episode has not begun
                self.episode += 1
                self.writer.write_at(EPISODE_WORD, time, self.episode)
            elif self._is_welcome(sample):
                self.writer.write_at(sample.stream, time, sample.value)
            else:
                continue
            if sample.number is None or sample.number != self.numbers[sample.source]:
                self.samples[sample.source] += 1
            self.numbers[sample.source] = sample.number

    def _count_what_is_held(self) -> None:
        """Correct the counts for a full disk: the file holds nothing after the last complete chunk."""
        held = self.writer.held
        self.frames = held.get("measured", 0)
        self.episode = max(0, held.get(EPISODE_WORD, 0) - 1)
        for source in self.samples:
            own = [held.get(stream, 0) for stream, (owner, _) in self.owners.items() if owner is source]
            self.samples[source] = min(self.samples[source], max(own, default=self.episode))

    def _usual_rate(self) -> float:
        """Return one over the median interval between frames (Hz); 0 if there is none."""
        passed, count = 0, sum(self.intervals.values())
        for interval, times in sorted(self.intervals.items()):
            passed += times
            if 2 * passed >= count:
                return 1e6 / interval if interval > 0 else 0.0
        return 0.0

    def _is_welcome(self, sample: Sample) -> bool:
        shape = sample.value.shape
        if sample.stream == RESULTANT:
            sample.source.complain("the name resultant is reserved for the total force that the sensor reports")
            return False
        owner, first = self.owners.setdefault(sample.stream, (sample.source, shape))
        if owner is not sample.source:
            sample.source.complain(f"{sample.stream} already comes from {owner.label}")
        elif shape != first:
            sample.source.complain(f"{sample.stream} must keep its shape {first}, got {shape}")
        return owner is sample.source and shape == first

    def _utc(self, monotonic: float) -> int:
        """Convert monotonic seconds to nanoseconds since 1970-01-01 UTC."""
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
                ExtraSummary(s.label, self.samples[s], s.bad, s.dropped, s.missed, s.problem, s.ended, s.clock_off)
                for s in self.extra
            ),
            ended=ended,
            error=error,
            zero_in_doubt=self.sensor.zero_in_doubt,
            uncertain=self.uncertain,
            longest_stall=self.longest_stall,
            **{name: count - self.before[name] for name, count in _damage(self.sensor).items()},
        )


def _damage(sensor: TactileSensor) -> dict[str, int]:
    """Return the sensor's counts of frames that never arrived intact, keyed by their names in `CaptureSummary`."""
    return {name: getattr(sensor, name) for name in ("bad_checksums", "timeouts", "reconnects")}
