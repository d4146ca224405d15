"""add_streams: streams that another file recorded during the same motion, resampled as covariates of a recording.

The added file determines how the two time axes are matched:

- If it numbers its **episodes** (a column ``episode_index`` as in LeRobot, or the demonstrations of an HDF5 file),
  episodes with the same number are matched. Its ``timestamp`` starts anew with each episode; a ``time`` is the
  recording's, or Unix time.
- Otherwise its times are on the **recording's clock**: Unix time if the recording knows when it started.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.logs.encoder_steps import with_steps
from paxisim.logs.mcap_save import log_times
from paxisim.logs.recording_arrays import Method, RecordingArrays, episode_spans
from paxisim.logs.resample import resample
from paxisim.logs.stream import Stream


class Streams(dict[str, dict["int | None", Stream]]):
    """Samples of each stream by episode number, or under None for the whole file.

    Attributes:
        restarts: Whether time counts from the first sample of each episode.
    """

    restarts = False


def streams_of_table(path: Path, table: RecordingArrays, restarts: bool) -> Streams:
    """Return the covariates of a table as streams.

    Args:
        path: File of the table, for messages.
        table: The table.
        restarts: Whether time counts anew in numbered episodes.

    Raises:
        InvalidValueError: A row has no time, time decreases, the rows of an episode are apart, or there is no stream.
    """
    time = table.time
    if not np.all(np.isfinite(time)):
        raise InvalidValueError(f"{path}: every row must have a time; row {int(np.argmin(np.isfinite(time)))} has none")
    spans: dict[int | None, slice] = {None: slice(None)}
    if table.episode is not None:
        found = [(table.episode[span.start], span) for span in episode_spans(table.episode)]
        spans = {int(number): span for number, span in found}
        if len(spans) < len(found):
            raise InvalidValueError(f"{path}: the rows of an episode must be adjacent")
    streams = Streams({name: {} for name in table.covariates})
    streams.restarts = restarts and table.episode is not None
    for number, span in spans.items():
        own = time[span]
        if np.any(np.diff(own) < 0):
            raise InvalidValueError(
                f"{path}: time must not decrease, but does after {own[:-1][np.diff(own) < 0][0]:.9g} s"
            )
        at = np.round((own - own[0] if streams.restarts else own) * 1e9).astype(np.int64)
        for name, values in table.covariates.items():
            streams[name][number] = Stream(at, np.asarray(values[span], dtype=np.float64))
    if not streams:
        raise InvalidValueError(f"{path} has no numeric stream besides its times")
    return streams


def add_streams(
    recording: RecordingArrays, path: Path, streams: Streams, methods: Mapping[str, Method], max_gap: float | None
) -> RecordingArrays:
    """Return the recording, whose fields must have been checked, with the streams of `path` added as covariates.

    Values are NaN where a stream is unknown.

    Raises:
        InvalidValueError: A name is already in use, or the file shares no time or no episode with the recording.
    """
    taken = [name for name in streams if name in recording.covariates]
    if taken:
        raise InvalidValueError(f"{path}: the recording already has a covariate {taken[0]!r}")
    episode = recording.episode
    assert episode is not None
    counts_episodes = None not in next(iter(streams.values()))
    if counts_episodes:
        _check_episodes(path, streams, episode)
        spans = [(int(episode[span.start]), span) for span in episode_spans(episode)]
        at = _times(path, recording, streams, spans)
    else:
        if np.any(np.diff(recording.time) < 0):
            raise InvalidValueError(
                f"{path} has one clock, but that of the recording starts anew in an episode: number the episodes in a "
                "column episode_index, or load the streams with each recording before concatenating them"
            )
        spans = [(None, slice(None))]
        at = log_times(recording)[0]
        _check_overlap(path, streams, at, has_start="start" in recording.metadata)
    covariates = dict(recording.covariates)
    for name, parts in streams.items():
        shape = next(iter(parts.values())).values.shape[1:]
        values = np.full((len(at), *shape), np.nan)
        for number, span in spans:
            if number in parts:
                values[span] = resample(parts[number], at[span], methods[name], max_gap)
        covariates[name] = values
    readings = {name: np.concatenate([part.values for part in parts.values()]) for name, parts in streams.items()}
    metadata = with_steps(recording.metadata, readings)
    return RecordingArrays(**{**vars(recording), "covariates": covariates, "metadata": metadata})


def _times(
    path: Path, recording: RecordingArrays, streams: Streams, spans: list[tuple[int, slice]]
) -> NDArray[np.int64]:
    """Return the recording's times (ns) on the clock of streams that number their episodes.

    Raises:
        InvalidValueError: No episode overlaps in time.
    """
    time, start = recording.time, recording.metadata.get("start")
    if streams.restarts:
        time = time - np.concatenate([np.full(span.stop - span.start, time[span.start]) for _, span in spans])
        return np.round(time * 1e9).astype(np.int64)
    for zero in (0.0, start if isinstance(start, (int, float)) else 0.0):
        at, apart, common = np.round((time + zero) * 1e9).astype(np.int64), [], 0
        for number, span in spans:
            own = [parts[number].nanoseconds for parts in streams.values() if number in parts]
            if any(one[0] <= at[span][-1] and one[-1] >= at[span][0] for one in own):
                common += 1
            elif own:
                apart.append(number)
        if common:
            if apart:
                text = (
                    f"{path}: episode {_listed(apart)} shares no time with the recording's; its streams are NaN there"
                )
                warnings.warn(text, stacklevel=5)
            return at
    raise InvalidValueError(
        f"{path}: the times of its episodes do not overlap those of the recording: column 'time' must be the "
        "recording's time or Unix time; name it 'timestamp' if it counts from the start of each episode"
    )


def _check_episodes(path: Path, streams: Streams, episode: NDArray[np.int64]) -> None:
    there = sorted(number for number in next(iter(streams.values())) if number is not None)
    wanted = sorted(set(episode.tolist()))
    missing = [number for number in wanted if number not in there]
    if len(missing) == len(wanted):
        raise InvalidValueError(
            f"{path} has none of the recording's episodes: it has episodes {_listed(there)}, the recording has "
            f"{_listed(wanted)}"
        )
    if missing:
        warnings.warn(f"{path} has no episode {_listed(missing)}; its streams are NaN there", stacklevel=5)


def _check_overlap(path: Path, streams: Streams, at: NDArray[np.int64], has_start: bool) -> None:
    begin = min(int(stream.nanoseconds[0]) for parts in streams.values() for stream in parts.values())
    end = max(int(stream.nanoseconds[-1]) for parts in streams.values() for stream in parts.values())
    if begin > at[-1] or end < at[0]:
        raise InvalidValueError(
            f"{path} does not overlap the recording: it spans {begin * 1e-9:.3f} s to {end * 1e-9:.3f} s, the "
            f"recording {at[0] * 1e-9:.3f} s to {at[-1] * 1e-9:.3f} s; both must use the same clock, Unix time "
            "(s since 1970) for a live recording"
            + ("" if has_start else "; state when the recording began with start (paxisim convert --start)")
        )


def _listed(numbers: list[int]) -> str:
    return ", ".join(map(str, numbers[:10])) + (" ..." if len(numbers) > 10 else "")
