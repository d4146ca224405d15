"""Delay between loads and channels, by profile likelihood, with a jackknife interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from paxisim.calibrate.lagged import Array, Averaged, Lagged

INTERVAL_COVERAGE = 0.95
"""Coverage of the intervals."""
MIN_EXPLAINED_SHARE = 0.1
"""Minimum share of a channel's variance that the loads must explain for the channel to be used."""
INTERPOLATION_ERROR = 0.01
"""Error of a delay due to interpolation between samples, as a share of the sample interval."""
_AT_END = 0.98  # share of the searched range beyond which a delay counts as at its end
_COARSE = 40  # steps on either side of 0
_FINE = 16  # steps between the neighbours of the best coarse step


@dataclass(frozen=True, eq=False)
class Delay:
    """A delay common to all channels.

    Attributes:
        value: Delay of the channels after the loads (s); negative if the loads come later.
        interval: Ends of its 95 % interval (s). At the end of the search, the interval is open on that side.
        replicates: ``(blocks,)`` delays fitted without each block (s).
    """

    value: float
    interval: tuple[float, float]
    replicates: Array

    @property
    def at_limit(self) -> bool:
        """Whether the delay lies at the end of the search range, so that the true delay may lie beyond."""
        return bool(np.isinf(self.interval).any())


def fit_delay(lagged: Lagged, block: NDArray[np.intp], most: float) -> Delay:
    """Fit the delay at which the loads explain the channels best, using channels that respond to the loads.

    All coefficients are refitted for each delay. With the noise of each channel unknown, the likelihood of a delay
    then depends only on the product of the channels' residual variances. The interval is a jackknife over blocks of
    time, because residuals of real sensors are far from independent.

    Args:
        lagged: Loads and channels of the recording.
        block: ``(T,)`` block number of each sample, from 0.
        most: Largest delay to search (s); limited to a quarter of the median piece.
    """
    most = min(most, lagged.usual / 4)
    blocks = int(block.max()) + 1
    none = Delay(0.0, (0.0, 0.0), np.zeros(blocks))
    if most <= 0:
        return none
    streams = lagged.averaged(most, block)
    step = max(most / _COARSE, min(lagged.interval, most))
    count = int(np.floor(most / step))
    tried = step * np.arange(-count, count + 1)
    squares = np.stack([_squares(streams, delay) for delay in tried])
    used = _explained(streams, squares) > MIN_EXPLAINED_SHARE
    if not used.any():
        return none
    best = float(tried[np.argmin(_unlikely(squares, used)[:, 0])])
    finer = best + step * np.linspace(-1, 1, _FINE + 1)
    finer = finer[np.abs(finer) <= most]
    squares = np.concatenate([squares, [_squares(streams, delay) for delay in finer]])
    tried, first = np.unique(np.concatenate([tried, finer]).round(9), return_index=True)
    unlikely = _unlikely(squares[first], used)
    value, *replicates = [_lowest(tried, curve) for curve in unlikely.T]
    half = float(np.hypot(half_width(np.array(replicates)), INTERPOLATION_ERROR * lagged.interval))
    # at the end of the search all replicates agree, which says nothing about delays beyond it
    low = -np.inf if value < -_AT_END * most else value - half
    high = np.inf if value > _AT_END * most else value + half
    return Delay(value, (low, high), np.array(replicates))


def half_width(replicates: Array) -> Array:
    """Return the half-width of an estimate's interval from its ``(blocks, ...)`` leave-one-block-out values."""
    blocks = len(replicates)
    variance = (blocks - 1) * np.var(replicates, axis=0)
    return float(student.ppf((1 + INTERVAL_COVERAGE) / 2, blocks - 1)) * np.sqrt(variance)


def _squares(streams: Averaged, delay: float) -> Array:
    """Return ``(1 + blocks, channels)`` mean squared residuals: of all blocks, then without each block."""
    sums = streams.sums(delay)
    parts = [sums.total(), sums.without()]
    return np.concatenate([part.squares(part.solve()) / part.count[:, None] for part in parts])


def _explained(streams: Averaged, squares: Array) -> Array:
    """Return the largest explained share of the variance over all delays, ``(channels,)``."""
    return 1 - squares[:, 0].min(axis=0) / np.maximum(streams.channels.var(axis=0), 1e-300)


def _unlikely(squares: Array, used: NDArray[np.bool_]) -> Array:
    """Return the negative log likelihood per sample, up to a constant, ``(delays, 1 + blocks)``."""
    return 0.5 * np.sum(np.log(squares[..., used]), axis=-1)


def _lowest(tried: Array, curve: Array) -> float:
    """Return the minimum of a parabola through the lowest value and its neighbours."""
    i = int(np.argmin(curve))
    if i in (0, len(tried) - 1):
        return float(tried[i])
    (a, b, c), (fa, fb, fc) = tried[i - 1 : i + 2], curve[i - 1 : i + 2]
    left, right = (fb - fa) / (b - a), (fc - fb) / (c - b)
    bend = right - left
    # the slopes hold at the middles of the two steps; in between, the slope is linear
    return float(b) if bend <= 0 else float((a + b) / 2 - left * (c - a) / 2 / bend)
