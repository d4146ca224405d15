"""Writing of a recording in memory to an MCAP file."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.files import whole_file
from paxisim.logs import schemas
from paxisim.logs.mcap_writer import LogWriter
from paxisim.logs.recording_arrays import RecordingArrays, episode_starts


def write_mcap(path: Path, recording: RecordingArrays) -> None:
    """Write every stream at the recording's times.

    Log time is ``metadata["start"]`` (Unix seconds, default 0) plus the recording's time. An episode that does not
    begin after the end of the previous one, as with a clock that restarts, is shifted to one second after it. The file
    describes the clock of each episode before the first sample, so loading restores the original times even if the file
    is cut off.

    Raises:
        InvalidValueError: The file cannot hold a value or the metadata.
    """
    at, starts, zeros = log_times(recording)
    numbers = [0] * len(starts) if recording.episode is None else recording.episode[starts].tolist()
    begins = dict(zip(starts, numbers, strict=True))
    clocks = [list(clock) for clock in zip(at[starts].tolist(), zeros, numbers, strict=True)]
    metadata = {**recording.metadata, "layout": recording.layout, "pads": recording.pads, "episode_clocks": clocks}
    tensors = {name: getattr(recording, name) for name in schemas.TACTILE_STREAMS}
    with whole_file(path) as temporary, LogWriter(temporary, metadata, flush_interval=math.inf) as log:
        for i, now in enumerate(at.tolist()):
            if i in begins:
                log.write_at("episode", now, begins[i])
            for name, tensor in tensors.items():
                if tensor is not None:
                    log.write_at(name, now, tensor[i])
            for name, values in recording.covariates.items():
                log.write_at(schemas.COVARIATE + name, now, values[i])


def log_times(recording: RecordingArrays) -> tuple[NDArray[np.int64], list[int], list[int]]:
    """Return log times (ns) of the samples, indices of the episodes' first samples, and log times of their time 0.

    Raises:
        InvalidValueError: A time exceeds the range of int64 nanoseconds since 1970.
    """
    _check_reach(float(np.abs(recording.time).max()))
    episode = recording.episode
    if episode is None:
        episode = np.zeros(len(recording.time), dtype=np.int64)
    offset = np.round(recording.time * 1e9).astype(np.int64)
    starts = episode_starts(episode)
    zeros = _zeros(offset, starts, recording.metadata.get("start"))
    _check_reach(max(zeros[-1], zeros[-1] + int(offset[-1])) / 1e9)
    return offset + np.repeat(zeros, np.diff([*starts, len(offset)])), starts.tolist(), zeros


def _check_reach(seconds: float) -> None:
    if not seconds * 1e9 < schemas.LATEST:
        raise InvalidValueError(
            "the samples' times must be in seconds and, counted from metadata['start'] (s since 1970-01-01) if given, "
            f"must end before 2262-04-11; they reach {seconds:.9g} s"
        )


def _zeros(offset: np.ndarray, starts: np.ndarray, start: object) -> list[int]:
    """Return the log time (ns) at which the time of each episode is 0."""
    zero = round(start * 1e9) if isinstance(start, (int, float)) and math.isfinite(start) else 0
    # log times cannot be negative
    zero = max(zero, -int(offset[starts[0]]))
    zeros = [zero]
    for first in starts[1:].tolist():
        if offset[first] <= offset[first - 1] or zeros[-1] + offset[first] < 0:
            zero = zeros[-1] + int(offset[first - 1]) - int(offset[first]) + 10**9
            zeros.append(zero)
        else:
            zeros.append(zeros[-1])
    return zeros
