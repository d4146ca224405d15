"""Resampling of a recording to another rate, and of values with other times to the times of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.logs import schemas
from paxisim.logs.checks import check_rate, numbers
from paxisim.logs.encoder_steps import with_steps
from paxisim.logs.recording_arrays import Method, RecordingArrays, episode_spans
from paxisim.logs.resample import check_max_gap, methods_by_name, resample
from paxisim.logs.stream import Stream


def at_rate(
    recording: RecordingArrays, rate: float, method: Method | Mapping[str, Method], max_gap: float | None
) -> RecordingArrays:
    """Resample a recording; see `paxisim.Recording.resample`. Its episode numbers must be set."""
    check_rate(rate)
    check_max_gap(max_gap)
    assert recording.episode is not None
    streams: dict[str, NDArray[Any]] = {
        name: getattr(recording, name) for name in schemas.TACTILE_STREAMS if getattr(recording, name) is not None
    }
    streams |= {schemas.COVARIATE + name: values for name, values in recording.covariates.items()}
    methods = methods_by_name(method, list(streams))
    time, episode = [], []
    parts: dict[str, list[NDArray[Any]]] = {name: [] for name in streams}
    for span in episode_spans(recording.episode):
        old = recording.time[span]
        # the tolerance of 1e-6 intervals keeps a last sample that falls exactly on the end
        new = old[0] + np.arange(int((old[-1] - old[0]) * rate + 1e-6) + 1) / rate
        time.append(new)
        episode.append(np.full(len(new), recording.episode[span.start]))
        begin, at = _nanoseconds(old, old[0]), _nanoseconds(new, old[0])
        for name, values in streams.items():
            found = Stream(begin, values[span])
            parts[name].append(resample(found, np.minimum(at, begin[-1]), methods[name], max_gap))
    arrays = {name: np.concatenate(values) for name, values in parts.items()}
    return replace(
        recording,
        time=np.concatenate(time),
        measured=arrays.pop("measured", None),
        simulated=arrays.pop("simulated", None),
        covariates={name.removeprefix(schemas.COVARIATE): values for name, values in arrays.items()},
        episode=np.concatenate(episode),
        metadata=with_steps(recording.metadata, recording.covariates),
    )


def at_times_of(
    recording: RecordingArrays, name: str, values: Any, time: Any, method: Method, max_gap: float | None
) -> NDArray[np.float64]:
    """Return values sampled at other times ``(S,)`` at the recording's times, as ``(T, ...)``.

    Raises:
        InvalidValueError: The recording's own time decreases, the times do not match the values, or nothing overlaps.
    """
    check_max_gap(max_gap)
    own = recording.time
    if np.any(np.diff(own) < 0):
        raise InvalidValueError(
            f"{name!r} has times of its own, but the clock of this recording starts anew in an episode: add the values "
            "to each recording in episodes() and concatenate them"
        )
    at, given = numbers("time", time, np.float64), numbers(f"values of {name!r}", values, np.float64)
    if at.ndim != 1 or given.ndim == 0 or len(at) != len(given) or not len(at):
        raise InvalidValueError(
            f"values of {name!r} must be (S, ...) and their time (S,), with at least one sample, got shapes "
            f"{given.shape} and {at.shape}"
        )
    if not np.all(np.isfinite(at)) or np.any(np.diff(at) < 0):
        raise InvalidValueError(f"the times of {name!r} must be finite and not run back")
    if at[0] > own[-1] or at[-1] < own[0]:
        raise InvalidValueError(
            f"{name!r} does not overlap the recording: it extends from {at[0]:.9g} s to {at[-1]:.9g} s, the recording "
            f"from {own[0]:.9g} s to {own[-1]:.9g} s; subtract metadata['start'] from Unix times"
        )
    (chosen,) = methods_by_name(method, [name]).values()
    return resample(Stream(_nanoseconds(at, own[0]), given), _nanoseconds(own, own[0]), chosen, max_gap)


def _nanoseconds(time: NDArray[np.float64], zero: float) -> NDArray[np.int64]:
    return np.round((time - zero) * 1e9).astype(np.int64)
