"""Lagged: delayed loads paired with channels, and the sums that a least-squares fit needs."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError

Array = NDArray[np.float64]

MAX_GAP_INTERVALS = 10.0
"""Longest gap between samples that is interpolated across, in typical sample intervals."""
MAX_VALUES = 20_000_000
"""Maximum number of channel values in a fit; longer recordings use every n-th sample."""
_TINY = 1e-10  # added to the diagonal, so that exactly collinear terms can be solved for
_AROUND = 3.0  # half-width, in sample intervals, of the window over which streams are averaged to find a delay
_CHUNK = 64  # channels that are averaged at a time


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums of products, by block.

    Attributes:
        count: ``(blocks,)`` number of samples.
        xx: ``(blocks, terms, terms)`` products of terms with terms.
        xy: ``(blocks, terms, channels)`` products of terms with channels.
        yy: ``(blocks, channels)`` squares of the channels.
    """

    count: Array
    xx: Array
    xy: Array
    yy: Array

    def without(self) -> Sums:
        """Return, for each block, the sums over all other blocks."""
        return Sums(*(getattr(self, f).sum(axis=0) - getattr(self, f) for f in ("count", "xx", "xy", "yy")))

    def total(self) -> Sums:
        """Return the sums over all blocks, as a single block."""
        return Sums(*(getattr(self, f).sum(axis=0, keepdims=True) for f in ("count", "xx", "xy", "yy")))

    def solve(self, ridge: float = 0.0) -> Array:
        """Return the least-squares coefficients, ``(blocks, terms, channels)``.

        Args:
            ridge: Multiple of the number of samples that is added to the diagonal, except for the first term, a
                constant. Terms are expected to have unit variance.
        """
        penalty = np.full(self.xx.shape[-1], ridge + _TINY)
        penalty[0] = _TINY
        size = np.maximum(self.count, 1.0)[:, None, None]
        return np.linalg.solve(self.xx + size * np.diag(penalty), self.xy)

    def squares(self, coefficients: Array) -> Array:
        """Return sums of squared residuals, ``(blocks, channels)``, of ``(blocks, terms, channels)`` coefficients."""
        fitted = np.einsum("btc,btu,buc->bc", coefficients, self.xx, coefficients, optimize=True)
        return np.maximum(self.yy - 2 * np.sum(coefficients * self.xy, axis=1) + fitted, 1e-300)


def block_sums(terms: Array, values: Array, block: NDArray[np.intp], count: int) -> Sums:
    """Sum products of ``(T, terms)`` and ``(T, values)`` samples by block ``(T,)``, numbered 0 to ``count - 1``."""
    order = np.argsort(block, kind="stable")
    edges = np.searchsorted(block[order], np.arange(count + 1))
    parts = [order[a:b] for a, b in itertools.pairwise(edges)]
    return Sums(
        np.array([float(len(part)) for part in parts]),
        np.stack([terms[part].T @ terms[part] for part in parts]),
        np.stack([terms[part].T @ values[part] for part in parts]),
        np.stack([np.sum(values[part] ** 2, axis=0) for part in parts]),
    )


class Lagged:
    """Loads and channels of a recording without unknown values, prepared for shifting in time.

    A piece is a stretch without a gap; `usual` is the median duration of the pieces (s).

    The terms are a constant, then for each power all loads to that power, each scaled to zero mean and unit variance.
    """

    def __init__(self, time: Array, loads: Array, channels: Array, episode: NDArray[np.int64], degree: int) -> None:
        """Find the pieces without a gap, and the scales.

        Args:
            time: ``(T,)`` times (s).
            loads: ``(T, loads)`` known values.
            channels: ``(T, channels)`` known values.
            episode: ``(T,)`` episode number of each sample.
            degree: Highest power of a load.

        Raises:
            InvalidValueError: No piece has two samples, or most samples repeat a timestamp.
        """
        steps = np.diff(time)
        inside = steps[(np.diff(episode) == 0) & (steps > 0)]
        self.interval = float(np.median(inside)) if len(inside) else 0.0
        breaks = np.flatnonzero((np.diff(episode) != 0) | (steps > MAX_GAP_INTERVALS * self.interval)) + 1
        edges = [0, *breaks.tolist(), len(time)]
        self.pieces = [slice(a, b) for a, b in itertools.pairwise(edges) if b - a > 1]
        if not self.pieces or not self.interval:
            raise InvalidValueError(
                "a readout needs stretches of two or more consecutive samples, each with its own timestamp"
            )
        self.usual = float(np.median([time[piece.stop - 1] - time[piece.start] for piece in self.pieces]))
        self.time, self.loads, self.channels = time, loads, channels
        self.size = np.maximum(np.abs(loads).max(axis=0), 1e-300)
        self.degree = degree
        powers = self._powers(loads)
        self.mean, self.spread = powers.mean(axis=0), np.maximum(powers.std(axis=0), 1e-12)
        self.level, self.scatter = channels.mean(axis=0), np.maximum(channels.std(axis=0), 1e-12)
        self._stride = -(-channels.size // MAX_VALUES)

    def _powers(self, loads: Array) -> Array:
        relative = loads / self.size
        return np.concatenate([relative**power for power in range(1, self.degree + 1)], axis=1)

    def sums(self, delay: float, block: NDArray[np.intp]) -> Sums:
        """Sum the products of the terms at ``time - delay`` and the channels.

        Args:
            delay: Delay of the channels (s).
            block: ``(T,)`` block number of each sample, from 0.
        """
        at, loads = [], []
        for piece in self.pieces:
            own = np.arange(piece.start, piece.stop, self._stride)
            past = self.time[own] - delay
            own = own[(past >= self.time[piece.start]) & (past <= self.time[piece.stop - 1])]
            at.append(own)
            loads.append(_interpolated(self.time[piece], self.loads[piece], self.time[own] - delay))
        which = np.concatenate(at)
        channels = (self.channels[which] - self.level) / self.scatter
        return self._sums(np.concatenate(loads), channels, block[which], int(block.max()) + 1)

    def polynomial(self, coefficients: Array) -> tuple[Array, Array]:
        """Return offset ``(channels,)`` and coefficients of the powers ``(degree, loads, channels)`` in original units.

        Args:
            coefficients: ``(terms, channels)`` coefficients of the scaled terms.
        """
        slopes = coefficients[1:] / self.spread[:, None]
        offset = self.level + self.scatter * (coefficients[0] - self.mean @ slopes)
        power = np.repeat(np.arange(1, self.degree + 1), len(self.size))
        slopes = self.scatter * slopes / np.tile(self.size, self.degree)[:, None] ** power[:, None]
        return offset, slopes.reshape(self.degree, len(self.size), -1)

    def gains(self, coefficients: Array) -> Array:
        """Return the slopes ``(loads, channels)`` of such coefficients, averaged over the samples."""
        slopes = self.polynomial(coefficients)[1]
        powers = [power * np.mean(self.loads ** (power - 1), axis=0) for power in range(1, self.degree + 1)]
        return np.einsum("pk,pkc->kc", np.stack(powers), slopes)

    def averaged(self, most: float, block: NDArray[np.intp]) -> Averaged:
        """Return both streams averaged over a few intervals, at samples that are valid for all delays up to `most`.

        Raises:
            InvalidValueError: There is no such sample.
        """
        half = min(max(_AROUND, self._stride / 2) * self.interval, self.usual / 8)
        at, pieces = [], []
        for piece in self.pieces:
            begin, end = self.time[piece.start] + most + half, self.time[piece.stop - 1] - most - half
            own = np.arange(piece.start, piece.stop, self._stride)
            own = own[(self.time[own] >= begin) & (self.time[own] <= end)]
            if len(own):
                at.append(own)
                pieces.append(piece)
        if not at:
            raise InvalidValueError(
                f"the known stretches of the recording are only {self.usual:.2g} s long, too short to fit a readout"
            )
        return Averaged(self, half, pieces, at, block)

    def _sums(self, loads: Array, channels: Array, block: NDArray[np.intp], count: int) -> Sums:
        terms = (self._powers(loads) - self.mean) / self.spread
        terms = np.concatenate([np.ones((len(terms), 1)), terms], axis=1)
        return block_sums(terms, channels, block, count)


class Averaged:
    """Loads and channels averaged in the same way, for the fit of the delay and the gains.

    Linear interpolation between noisy samples is smoother in the middle of an interval than at its ends, which biases a
    delay towards the middle. Averages over several intervals are almost equally smooth everywhere, and they reduce the
    attenuation of the gains by noise in the loads. Both streams are averaged in the same way, and averaging commutes
    with a delay and a linear readout, so delay and gains do not change otherwise.
    """

    def __init__(
        self, lagged: Lagged, half: float, pieces: list[slice], at: list[NDArray[np.intp]], block: NDArray[np.intp]
    ) -> None:
        """Average the channels once for all delays."""
        self._lagged, self._half, self._pieces, self._at = lagged, half, pieces, at
        self._block = block[np.concatenate(at)]
        self._blocks = int(block.max()) + 1
        self.channels = np.concatenate([self._channels(piece, own) for piece, own in zip(pieces, at, strict=True)])

    def _channels(self, piece: slice, own: NDArray[np.intp]) -> Array:
        lagged = self._lagged
        out = np.empty((len(own), lagged.channels.shape[1]))
        for first in range(0, out.shape[1], _CHUNK):
            part = slice(first, first + _CHUNK)
            values = (lagged.channels[piece, part] - lagged.level[part]) / lagged.scatter[part]
            out[:, part] = _mean_around(lagged.time[piece], values, lagged.time[own], self._half)
        return out

    def sums(self, delay: float) -> Sums:
        """Sum the products of the terms at ``time - delay`` and the channels."""
        lagged = self._lagged
        loads = [
            _mean_around(lagged.time[piece], lagged.loads[piece], lagged.time[own] - delay, self._half)
            for piece, own in zip(self._pieces, self._at, strict=True)
        ]
        return lagged._sums(np.concatenate(loads), self.channels, self._block, self._blocks)


def _interpolated(time: Array, values: Array, at: Array) -> Array:
    return np.stack([np.interp(at, time, column) for column in values.T], axis=1)


def _mean_around(time: Array, values: Array, at: Array, half: float) -> Array:
    """Mean ``(len(at), columns)`` of the linearly interpolated ``values`` over ``at - half`` to ``at + half``."""
    steps = np.diff(time)[:, None]
    slope = np.divide(np.diff(values, axis=0), steps, out=np.zeros((len(steps), values.shape[1])), where=steps > 0)
    area = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(steps * (values[1:] + values[:-1]) / 2, axis=0)])

    def integral(to: Array) -> Array:
        i = np.clip(np.searchsorted(time, to, side="right") - 1, 0, len(time) - 2)
        into = (to - time[i])[:, None]
        return area[i] + into * (values[i] + into * slope[i] / 2)

    return (integral(at + half) - integral(at - half)) / (2 * half)
