"""Stopped: detection of a stream that stops changing while the other one continues."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MIN_STOP_SECONDS = 1.0
MIN_STOP_FRAMES = 20
OFTEN_STILL_SHARE = 0.1  # a stream that repeats in at least this share of busy frames elsewhere often stands still
MOVING_FRACTION = 0.3  # least standard deviation of the other stream during the stop, relative to its usual one


def stopped_in_words(
    time: NDArray[np.float64], measured: NDArray[np.floating], simulated: NDArray[np.floating]
) -> tuple[str, float]:
    """Describe which stream stops changing, and when, while the other one continues to change.

    A simulation without contact stays at 0, and a sensor with a coarse resolution repeats a value if nothing changes;
    neither counts as a stream that has stopped.

    Args:
        time: ``(T,)`` times in seconds.
        measured: ``(T, ...)`` measured values.
        simulated: ``(T, ...)`` simulated values, of the same shape.

    Returns:
        Description of the stop, and the share of the recording that it lasts; ``""`` and 0 if no stream stops.
    """
    streams = {"measured": measured.reshape(len(time), -1), "simulated": simulated.reshape(len(time), -1)}
    for name, other in (("measured", "simulated"), ("simulated", "measured")):
        values, others = streams[name], streams[other]
        still = np.all(values[1:] == values[:-1], axis=1)
        first, last = _longest(still)
        if last - first < MIN_STOP_FRAMES or time[last] - time[first] < MIN_STOP_SECONDS:
            continue
        if name == "simulated" and not values[first].any():
            continue
        moves = np.linalg.norm(np.diff(others.astype(np.float64), axis=0), axis=1)
        elsewhere = np.ones(len(still), dtype=bool)
        elsewhere[first:last] = False
        busy = elsewhere & (moves > np.median(moves)) & values[1:].any(axis=1)
        usual = _spread(others)
        if (
            busy.any()
            and still[busy].mean() < OFTEN_STILL_SHARE
            and _spread(others[first : last + 1]) > MOVING_FRACTION * usual > 0
        ):
            begin, end = time[first], time[last]
            words = f"{name} does not change from {begin:.2f} to {end:.2f} s, while {other} does"
            return words, float((last - first) / len(values))
    return "", 0.0


def _longest(still: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the first and the last frame of the longest run of repeated frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    starts, ends = edges[::2], edges[1::2]
    if not len(starts):
        return 0, 0
    most = int(np.argmax(ends - starts))
    return int(starts[most]), int(ends[most])


def _spread(values: NDArray[np.floating]) -> float:
    """Return the square root of the summed variances of all channels."""
    return float(np.sqrt(np.sum(np.var(values.astype(np.float64), axis=0))))
