"""Resampling of the streams of a log onto one time axis."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.logs import schemas
from paxisim.logs.encoder_steps import with_steps
from paxisim.logs.recording_arrays import Method, RecordingArrays
from paxisim.logs.stream import Log, Stream

# a pause longer than this many usual intervals is a gap, in which the stream is unknown
GAP_INTERVALS = 5
# ns; samples closer than this may have been sent together in a burst
_AT_ONCE = 1_000_000
_MOST_WARNINGS = 4  # of one kind; more become one
_BLOCK = 4096  # samples interpolated per block, to limit memory


def resample_log(
    log: Log, method: Method | Mapping[str, Method] = "linear", max_gap: float | None = None
) -> RecordingArrays:
    """Return the streams of `log` at the times of its measured tensors, or of the simulated ones if none was measured.

    Args:
        log: Contents of a file.
        method: See `resample`. One method for all streams, or a mapping by name (``"simulated"`` or a covariate's
            name); unnamed streams are interpolated linearly.
        max_gap: See `resample`.

    Returns:
        The arrays. Time counts from the first sample, whose Unix time becomes ``metadata["start"]``, unless the file
        describes its clock. ``episode_clocks`` has, for each episode, the log times of its first sample and of its
        time 0, and its number; ``time_zero_ns`` of older files has only the second.

    Raises:
        InvalidValueError: The log has no tensors, or the two tensors do not overlap in time.
        UnknownNameError: `method` names a stream that does not exist.
    """
    streams = dict(log.streams)
    reference = next((name for name in schemas.TACTILE_STREAMS if name in streams), None)
    if reference is None:
        found = ", ".join(streams) or "nothing at all"
        raise InvalidValueError(f"the file holds no tactile sample, neither measured nor simulated, only {found}")
    at = streams[reference].nanoseconds
    marks = streams.pop("episode", None)
    methods = methods_by_name(method, [name for name in streams if name != reference])
    arrays: dict[str, NDArray[Any]] = {reference: streams.pop(reference).values}
    unknown, bursts, readings = [], [], {}
    for name, stream in streams.items():
        arrays[name] = resample(stream, at, methods[name], max_gap)
        if arrays[name] is stream.values:
            continue
        if name.startswith(schemas.COVARIATE):
            readings[name.removeprefix(schemas.COVARIATE)] = stream.values
        if np.isnan(arrays[name]).all() and not np.isnan(stream.values).all():
            unknown.append(_nothing_known(name, stream, reference, at, max_gap))
        if said := describe_bursts(name, stream):
            bursts.append(said)
    for said in (unknown, bursts):
        for text in (
            said if len(said) <= _MOST_WARNINGS else (f"{said[0]}; the same holds for {len(said) - 1} more streams",)
        ):
            warnings.warn(text, stacklevel=2)
    metadata = with_steps(log.metadata, readings)
    layout, pads = metadata.pop("layout", None), metadata.pop("pads", ())
    zeros, clocks = metadata.pop("time_zero_ns", None), metadata.pop("episode_clocks", None)
    if clocks:
        begins, zeros, numbers = np.asarray(clocks, dtype=np.int64).T
        marks = Stream(begins, numbers)
    episode, mark = _episodes(at, marks)
    if zeros is None or marks is None or len(zeros) != len(marks.values):
        metadata["start"] = float(at[0] * 1e-9)
        zero: Any = at[0]
    else:
        zero = np.asarray(zeros, dtype=np.int64)[mark]
    return RecordingArrays(
        time=(at - zero) / 1e9,
        measured=arrays.pop("measured", None),
        simulated=arrays.pop("simulated", None),
        covariates={name.removeprefix(schemas.COVARIATE): value for name, value in arrays.items()},
        episode=episode,
        layout=None if layout is None else TaxelLayout.from_dict(layout),
        pads=tuple(pads or ()),
        metadata=metadata,
    )


def resample(stream: Stream, at: NDArray[np.int64], method: Method, max_gap: float | None) -> NDArray[Any]:
    """Return the values of a stream at other times.

    Args:
        stream: ``(T, ...)`` samples.
        at: ``(S,)`` times in nanoseconds, not decreasing.
        method: ``"linear"`` interpolation between the two neighbours, the ``"nearest"`` of the two, or the
            ``"previous"`` one.
        max_gap: Neighbours further apart than this (s) give NaN. Default: five times the stream's `usual_interval`.

    Returns:
        ``(S, ...)`` array with the values' dtype. NaN before the first sample, after the last and in gaps. At a time
        that coincides with a sample, the value is that sample.
    """
    time, values = stream.nanoseconds, stream.values
    if np.array_equal(time, at):
        return values
    limit = _greatest_gap(stream, max_gap)
    result = np.full((len(at), *values.shape[1:]), np.nan, dtype=values.dtype)
    for start in range(0, len(at), _BLOCK):
        now = at[start : start + _BLOCK]
        before = np.searchsorted(time, now, side="right") - 1
        exact = (before >= 0) & (time[np.maximum(before, 0)] == now)
        after = np.where(exact, before, before + 1)
        known = (before >= 0) & (after < len(time))
        now, before, after = now[known], before[known], after[known]
        interval = (time[after] - time[before]).astype(np.float64)
        near = interval <= limit
        now, before, after, interval = now[near], before[near], after[near], interval[near]
        weight = (now - time[before]) / np.where(interval > 0, interval, 1.0)
        if method == "linear":
            weight = weight.reshape(-1, *[1] * (values.ndim - 1)).astype(values.dtype)
            chosen = values[before] * (1 - weight) + values[after] * weight
        else:
            chosen = values[np.where((weight > 0.5) & (method == "nearest"), after, before)]
        result[start + np.flatnonzero(known)[near]] = chosen
    return result


def usual_interval(stream: Stream) -> float:
    """Return the typical interval (ns) between samples: the median, or 0 for a single sample.

    If a program buffers its output, samples arrive in bursts with long pauses in between, and the median is
    meaningless. So if the median is below 1 ms and intervals of up to five times the median cover less than a tenth of
    the stream's duration, the function returns the interval at which the sorted, accumulated intervals reach a tenth of
    it. This is the interval between bursts.
    """
    intervals = np.sort(np.diff(stream.nanoseconds))
    if not len(intervals):
        return 0.0
    median = float(np.median(intervals))
    covered = np.cumsum(intervals)
    tenth = float(intervals[np.searchsorted(covered, 0.1 * covered[-1])])
    return tenth if median < _AT_ONCE and tenth > GAP_INTERVALS * median else median


def methods_by_name(method: Method | Mapping[str, Method], streams: list[str]) -> dict[str, Method]:
    """Return the method of each stream; streams that a mapping does not name are interpolated linearly.

    Args:
        method: One method for all streams, or a mapping by name, in which covariate names have no prefix.
        streams: Names as in `Log.streams`.

    Raises:
        InvalidValueError: A method does not exist.
        UnknownNameError: A stream does not exist.
    """
    names = {name.removeprefix(schemas.COVARIATE): name for name in streams}
    given: dict[str, Method] = dict.fromkeys(names, method) if isinstance(method, str) else dict(method)
    chosen: dict[str, Method] = dict.fromkeys(streams, "linear")
    for name, one in given.items():
        if name not in names:
            raise UnknownNameError("stream to align", name, names)
        chosen[names[name]] = one
    for one in (*given.values(), *([method] if isinstance(method, str) else [])):
        if one not in get_args(Method):
            raise InvalidValueError(f"align must be one of {', '.join(get_args(Method))}, got {one!r}")
    return chosen


def check_max_gap(max_gap: float | None) -> None:
    """Check that `max_gap` is None or more than 0 s.

    Raises:
        InvalidValueError: It is neither.
    """
    if max_gap is not None and not max_gap > 0:
        raise InvalidValueError(f"max_gap must be a positive time in s, got {max_gap!r}")


def describe_bursts(name: str, stream: Stream) -> str:
    """Return a description of the timing error of a stream that came in bursts; empty if it did not."""
    usual = usual_interval(stream)
    if len(stream.values) < 2 or usual <= GAP_INTERVALS * np.median(np.diff(stream.nanoseconds)):
        return ""
    return (
        f"{name} came in bursts, {usual * 1e-9:.2g} s apart, so its times are up to that much late: the program that "
        "sends it buffers its output; let it flush each line, or send a timestamp with each sample"
    )


def _greatest_gap(stream: Stream, max_gap: float | None) -> float:
    """Largest interval (ns) that is interpolated; see `resample`."""
    return GAP_INTERVALS * usual_interval(stream) if max_gap is None else max_gap * 1e9


def _episodes(at: NDArray[np.int64], marks: Stream | None) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return each sample's episode and the index of its mark; samples before the first mark belong to it."""
    if marks is None:
        return np.zeros(len(at), np.int64), np.zeros(len(at), np.int64)
    mark = np.maximum(np.searchsorted(marks.nanoseconds, at, side="right") - 1, 0)
    numbers = marks.values
    if len(np.unique(numbers)) < len(numbers):  # repeated numbers do not identify episodes: renumber them
        numbers = np.arange(len(numbers))
    return numbers[mark], mark


def _nothing_known(name: str, stream: Stream, reference: str, at: NDArray[np.int64], max_gap: float | None) -> str:
    """Return why a stream is known at no time of the reference.

    Raises:
        InvalidValueError: The stream is a tensor.
    """
    first, last = ((stream.nanoseconds[i] - at[0]) * 1e-9 for i in (0, -1))
    text = (
        f"{name} is not known at any time of {reference}: it has {len(stream.values)} samples from {first:.3f} s to "
        f"{last:.3f} s, {reference} spans 0 s to {(at[-1] - at[0]) * 1e-9:.3f} s"
    )
    if len(stream.values) > 1 and stream.nanoseconds[0] <= at[-1] and stream.nanoseconds[-1] >= at[0]:
        limit = _greatest_gap(stream, max_gap) * 1e-9
        text += f"; values between samples more than {limit:.3g} s apart are not known (max_gap)"
    if name in schemas.TACTILE_STREAMS:
        raise InvalidValueError(text)
    return text
