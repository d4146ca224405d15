"""Delay: how much later the channels follow the loads, by profile likelihood, with a jackknife interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from paxisim.calibrate.lagged import Array, Averaged, Lagged

LEVEL = 0.95
"""Coverage of the intervals."""
LEAST = 0.1
"""Least share of a channel's variance that the loads must explain for the channel to be used."""
RESOLUTION = 0.01
"""Share of the sample interval by which interpolation between samples may move a delay."""
_COARSE = 40  # steps on either side of 0
_FINE = 16  # steps between the neighbours of the best coarse step


@dataclass(frozen=True, eq=False)
class Delay:
    """A delay common to all channels.

    Attributes:
        value: Seconds by which the channels follow the loads; negative if the loads come later.
        interval: Ends of its 95 % interval (s).
        replicates: ``(blocks,)`` delays fitted without each block.
        searched: Delays up to this (s), of either sign, were tried.
    """

    value: float
    interval: tuple[float, float]
    replicates: Array
    searched: float

    @property
    def at_limit(self) -> bool:
        """Whether it lies at the end of the search, so that the true one may lie beyond."""
        return abs(self.value) > 0.98 * self.searched > 0


def fit_delay(lagged: Lagged, block: NDArray[np.intp], most: float) -> Delay:
    """The delay at which the channels that the loads explain are explained best.

    For each delay all coefficients are fitted anew. With the noise of each channel unknown, the likelihood of a delay
    is then a product over the channels of their residual variances. Its interval is a jackknife over blocks of time,
    since residuals of real sensors are far from independent.

    Args:
        lagged: The recording.
        block: ``(T,)`` number of the block of each sample, from 0.
        most: Largest delay to try (s); no more than a quarter of the usual piece is.
    """
    most = min(most, lagged.usual / 4)
    blocks = int(block.max()) + 1
    none = Delay(0.0, (0.0, 0.0), np.zeros(blocks), 0.0)
    if most <= 0:
        return none
    streams = lagged.averaged(most, block)
    step = max(most / _COARSE, min(lagged.interval, most))
    count = int(np.floor(most / step))
    tried = step * np.arange(-count, count + 1)
    squares = np.stack([_squares(streams, delay) for delay in tried])
    used = _explained(streams, squares) > LEAST
    if not used.any():
        return none
    best = float(tried[np.argmin(_unlikely(squares, used)[:, 0])])
    finer = best + step * np.linspace(-1, 1, _FINE + 1)
    finer = finer[np.abs(finer) <= most]
    squares = np.concatenate([squares, [_squares(streams, delay) for delay in finer]])
    tried, first = np.unique(np.concatenate([tried, finer]).round(9), return_index=True)
    unlikely = _unlikely(squares[first], used)
    value, *replicates = [_lowest(tried, curve) for curve in unlikely.T]
    half = float(np.hypot(half_width(np.array(replicates)), RESOLUTION * lagged.interval))
    return Delay(value, (value - half, value + half), np.array(replicates), most)


def half_width(replicates: Array) -> Array:
    """Half the width of the interval of an estimate, from its ``(blocks, ...)`` values without each block."""
    blocks = len(replicates)
    variance = (blocks - 1) * np.var(replicates, axis=0)
    return float(student.ppf((1 + LEVEL) / 2, blocks - 1)) * np.sqrt(variance)


def _squares(streams: Averaged, delay: float) -> Array:
    """``(1 + blocks, channels)`` mean squared residuals: of all blocks, then without each block."""
    sums = streams.sums(delay)
    parts = [sums.total(), sums.without()]
    return np.concatenate([part.squares(part.solve()) / part.count[:, None] for part in parts])


def _explained(streams: Averaged, squares: Array) -> Array:
    """``(channels,)`` largest share of the variance that is explained at any delay."""
    return 1 - squares[:, 0].min(axis=0) / np.maximum(streams.channels.var(axis=0), 1e-300)


def _unlikely(squares: Array, used: NDArray[np.bool_]) -> Array:
    """``(delays, 1 + blocks)`` negative log likelihood per sample, but for constants."""
    return 0.5 * np.sum(np.log(squares[..., used]), axis=-1)


def _lowest(tried: Array, curve: Array) -> float:
    """Where a parabola through the lowest value and its neighbours is lowest."""
    i = int(np.argmin(curve))
    if i in (0, len(tried) - 1):
        return float(tried[i])
    (a, b, c), (fa, fb, fc) = tried[i - 1 : i + 2], curve[i - 1 : i + 2]
    left, right = (fb - fa) / (b - a), (fc - fb) / (c - b)
    bend = right - left
    # the slopes belong to the middles of the two steps, and between them the slope runs straight
    return float(b) if bend <= 0 else float((a + b) / 2 - left * (c - a) / 2 / bend)
