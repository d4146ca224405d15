"""Text description of the contents of a log."""

from __future__ import annotations

import numpy as np

from paxisim.logs import schemas
from paxisim.logs.mcap_save import log_times
from paxisim.logs.recording_arrays import RecordingArrays
from paxisim.logs.resample import GAP_INTERVALS, usual_interval
from paxisim.logs.stream import Log, Stream

# follows the stream's name
HEADER = "  samples       s      Hz  gaps  longest s  lost  errors"
_EPISODES = 20  # at most this many are listed individually


def describe_stream(name: str, stream: Stream, width: int) -> str:
    """Return a row of the table below `HEADER`.

    A gap is an interval of more than five times the usual one. Lost readings were counted by the device but are missing
    from the file. Errors are samples with a pad in an error status, whose forces are treated as unknown.
    """
    time = stream.nanoseconds
    short = name if len(name) <= width else name[: width - 3] + "..."
    rate = count = longest = lost = errors = ""
    intervals = np.diff(time) * 1e-9
    usual = usual_interval(stream) * 1e-9
    if usual > 0:
        gaps = intervals[intervals > GAP_INTERVALS * usual]
        rate, count = f"{1 / usual:.1f}", f"{len(gaps)}"
        longest = f"{gaps.max():.3f}" if len(gaps) else "-"
        if stream.sequence is not None:
            lost = f"{np.sum(np.maximum(np.diff(stream.sequence) - 1, 0))}"
    if stream.errors is not None:
        errors = f"{stream.errors}"
    row = f"{short:{width}}  {len(time):7d}  {(time[-1] - time[0]) * 1e-9:6.1f}  {rate:>6}  {count:>4}  {longest:>9}"
    return f"{row}  {lost:>4}  {errors:>6}".rstrip()


def describe_episodes(log: Log, first: int) -> list[str]:
    """Return a line for each episode with its start, relative to `first` (ns), and its number of tactile samples."""
    marks = log.streams["episode"]
    name = next((name for name in schemas.TACTILE_STREAMS if name in log.streams), None)
    begins = np.append(marks.nanoseconds[1:], np.iinfo(np.int64).max)
    counts = np.zeros(len(begins), dtype=np.int64)
    if name:
        # samples before the first mark belong to its episode
        ends = np.searchsorted(log.streams[name].nanoseconds, begins, side="left")
        counts = np.diff(ends, prepend=0)
    lines = [f"{len(counts)} episode{'s' * (len(counts) != 1)}"]
    for number, at, count in list(zip(marks.values, marks.nanoseconds, counts, strict=True))[:_EPISODES]:
        lines.append(f"  {number}: from {(at - first) * 1e-9:.3f} s, {count} sample{'s' if count != 1 else ''}")
    if len(counts) > _EPISODES:
        lines.append(f"  and {len(counts) - _EPISODES} more")
    return lines


def log_of(recording: RecordingArrays) -> Log:
    """Convert a recording read from a table to a log, to describe it."""
    time, starts, _ = log_times(recording)
    streams = {name: getattr(recording, name) for name in schemas.TACTILE_STREAMS}
    streams |= {schemas.COVARIATE + name: values for name, values in recording.covariates.items()}
    metadata = dict(recording.metadata)
    if recording.layout is not None:
        metadata |= {"layout": recording.layout.to_dict(), "pads": recording.pads}
    found = {name: Stream(time, values) for name, values in streams.items() if values is not None}
    if recording.episode is not None:
        found["episode"] = Stream(time[starts], recording.episode[starts])
    return Log(found, metadata)
