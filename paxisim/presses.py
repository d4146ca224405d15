"""Presses: contacts found in a noisy load signal, and cuts between them that divide a recording into episodes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError

NOISE_THRESHOLDS = (3.0, 6.0)
"""Lower and upper threshold above rest, as multiples of the noise at rest."""
PEAK_THRESHOLDS = (0.01, 0.03)
"""Lower and upper threshold above rest, as shares of the peak, for signals with little noise."""
MIN_REST_SECONDS = 0.3
"""Minimum duration of a rest (s) at which a recording is cut; a shorter rest belongs to the surrounding press."""
MIN_EPISODE_SECONDS = 2.0
"""Minimum duration of an episode (s)."""
MIN_SAMPLES = 8
"""Minimum number of samples needed to find presses."""
_SHARE_AT_REST = 0.25  # share of the range; the rest level is searched below it


@dataclass(frozen=True, eq=False)
class Presses:
    """Presses found in a load signal by hysteresis thresholding.

    A press is a stretch above the lower threshold that rises above the upper one at least once. The lower threshold
    captures the whole press; the upper one prevents noise from counting as a press.

    Attributes:
        time: ``(T,)`` times (s).
        load: ``(T,)`` magnitude of the load (N).
        rest: Load at rest (N): its most frequent low level.
        noise: Standard deviation of the load at rest (N), from the median absolute deviation.
        low: Lower threshold (N).
        high: Upper threshold (N).
        spans: Samples of each press, as slices.
        cuts: Indices of the samples at which a new episode begins, in the middle of a rest; without the first sample.
    """

    time: NDArray[np.float64]
    load: NDArray[np.float64]
    rest: float
    noise: float
    low: float
    high: float
    spans: tuple[slice, ...]
    cuts: tuple[int, ...]

    @property
    def episode(self) -> NDArray[np.int64]:
        """Episode number of each sample, ``(T,)``."""
        episode = np.zeros(len(self.time), dtype=np.int64)
        episode[list(self.cuts)] = 1
        return np.cumsum(episode)

    def __repr__(self) -> str:
        """One-line summary."""
        count, pieces = len(self.spans), len(self.cuts) + 1
        return (
            f"{count} press{'es' * (count != 1)} in {pieces} episode{'s' * (pieces != 1)}: rest {self.rest:.3g} N, "
            f"noise {self.noise:.2g} N, thresholds {self.low:.3g} and {self.high:.3g} N"
        )


def find_presses(time: ArrayLike, load: ArrayLike) -> Presses:
    """Find the presses in a load signal, and where to cut it into episodes.

    The level at rest and its noise are estimated from the signal itself, so offset and noise of the load cell do not
    affect the cuts. A slow drift of the zero that exceeds the thresholds is not tracked.

    Args:
        time: ``(T,)`` times (s), not decreasing.
        load: ``(T,)`` or ``(T, components)`` load (N), NaN where unknown. For several components, the distance from
            their values at rest is used.

    Raises:
        InvalidValueError: The shapes do not fit, fewer than 8 samples are known, or time runs backwards.
    """
    at, values = np.asarray(time, dtype=np.float64), np.asarray(load, dtype=np.float64)
    if values.ndim not in (1, 2) or at.shape != values.shape[:1]:
        raise InvalidValueError(
            f"load must be (T,) or (T, components) and time (T,), got {values.shape} and {at.shape}"
        )
    if np.any(np.diff(at) < 0):
        raise InvalidValueError("time must not run backwards; pass each episode of a recording separately")
    values = values[:, None] if values.ndim == 1 else values
    known = np.isfinite(values).all(axis=1)
    if known.sum() < MIN_SAMPLES:
        raise InvalidValueError(f"finding presses needs at least {MIN_SAMPLES} known samples, got {int(known.sum())}")
    size = np.full(len(at), np.nan)
    size[known] = values[known, 0] if values.shape[1] == 1 else _distance(values[known])
    if values.shape[1] == 1 and _reads_negative(size[known]):
        size = -size
    rest, noise = _at_rest(size[known])
    peak = float(np.quantile(size[known], 0.995)) - rest
    low, high = (
        rest + max(share * peak, rise * noise) for share, rise in zip(PEAK_THRESHOLDS, NOISE_THRESHOLDS, strict=True)
    )
    spans = _between_rests(at, size, low, high)
    return Presses(at, size, rest, noise, low, high, spans, _cuts(at, spans))


def _reads_negative(load: NDArray[np.float64]) -> bool:
    """Return whether the load cell reads pressing as negative.

    A recording begins and ends at rest, whatever the zero of the load cell. If one end is pressed, its zero must do.
    """
    bottom, peak = np.quantile(load, [0.005, 0.995])
    begin, end = (float(np.median(part)) - bottom > 0.5 * (peak - bottom) for part in (load[:8], load[-8:]))
    return begin if begin == end else abs(load.min()) > load.max()


def _distance(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of the components from their values at rest, ``(T,)``."""
    zero = np.median(values, axis=0)
    for _ in range(5):  # the zero is estimated from the samples nearest to it, which depend on the zero
        size = np.sqrt(np.sum((values - zero) ** 2, axis=1))
        zero = np.array([_mode(column) for column in values[size <= np.quantile(size, 0.5)].T])
    return np.sqrt(np.sum((values - zero) ** 2, axis=1))


def _at_rest(load: NDArray[np.float64]) -> tuple[float, float]:
    """Return the level and the noise at rest.

    The level is the mode of the lower part of the signal. The noise is estimated only from the samples below it,
    because those above it may belong to a press.
    """
    bottom, peak = np.quantile(load, [0.005, 0.995])
    rest = _mode(load[load <= bottom + _SHARE_AT_REST * (peak - bottom)])
    noise = 0.0
    for _ in range(3):  # the mode is a noisy estimate; the median around it is a better one
        noise = float(1.4826 * np.median(rest - load[load <= rest]))
        rest = float(np.median(load[np.abs(load - rest) <= 2 * noise]))
    return rest, noise


def _mode(values: NDArray[np.float64]) -> float:
    """Return the half-sample mode: the densest half of the values, then the densest half of those, and so on."""
    values = np.sort(values)
    while len(values) > 3:
        half = (len(values) + 1) // 2
        start = int(np.argmin(values[half - 1 :] - values[: len(values) - half + 1]))
        values = values[start : start + half]
    return float(values[len(values) // 2])


def _between_rests(time: NDArray[np.float64], load: NDArray[np.float64], low: float, high: float) -> tuple[slice, ...]:
    """Return stretches above `low` that exceed `high`; merge those separated by less than `MIN_REST_SECONDS`."""
    spans: list[slice] = []
    for start, stop in runs(load > low):
        if not np.nanmax(load[start:stop]) > high:
            continue
        if spans and time[start] - time[spans[-1].stop - 1] < MIN_REST_SECONDS:
            spans[-1] = slice(spans[-1].start, stop)
        else:
            spans.append(slice(start, stop))
    return tuple(spans)


def _cuts(time: NDArray[np.float64], spans: Sequence[slice]) -> tuple[int, ...]:
    """Return the middles of the rests, without those that make an episode shorter than `MIN_EPISODE_SECONDS`."""
    cuts = [0]
    for before, after in itertools.pairwise(spans):
        middle = (before.stop + after.start) // 2
        if time[middle] - time[cuts[-1]] >= MIN_EPISODE_SECONDS:
            cuts.append(middle)
    if len(cuts) > 1 and time[-1] - time[cuts[-1]] < MIN_EPISODE_SECONDS:
        cuts.pop()
    return tuple(cuts[1:])


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return start and stop of each stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
