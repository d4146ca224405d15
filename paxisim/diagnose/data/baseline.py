"""Baseline: the zero offset of each channel, which follows a few curves over time, estimated from samples at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.pieces import FloatArray
from paxisim.diagnose.rules import NOISE


@dataclass(frozen=True, eq=False)
class Curves:
    """Time curves that the zero offset of each channel follows, with an amplitude for each curve and channel.

    Attributes:
        values: ``(curves, T)``.
        owners: Name of the cause that each curve belongs to.
        shrink: ``(curves, pads, 3, 1, 1)`` factor on the deviation of a curve's amplitudes from a plane over the pad's
            axis; None for no shrinkage.
    """

    values: FloatArray
    owners: tuple[str, ...] = ()
    shrink: FloatArray | None = None

    def __len__(self) -> int:
        """Number of curves."""
        return len(self.values)

    @property
    def constant(self) -> NDArray[np.bool_]:
        """``(curves,)`` whether each curve is a constant."""
        return np.ptp(self.values, axis=1) == 0

    def owned_by(self, name: str) -> list[int]:
        """Indices of the curves that belong to a cause."""
        return [number for number, owner in enumerate(self.owners) if owner == name]

    def at(self, frames: NDArray[np.intp]) -> Curves:
        """The curves in some frames."""
        return replace(self, values=self.values[:, frames])

    def over_time(self, zero: FloatArray) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N, the zero offset with ``(curves, pads, 3, rows, cols)`` amplitudes."""
        return np.tensordot(self.values.T, zero, 1)


class Baseline:
    """Estimates of the zero offset of each channel.

    Attributes:
        samples: ``(T,)`` samples from which it is estimated.
        by_episode: Their indices, by episode.
    """

    def __init__(
        self,
        curves: Curves | None,
        weight: FloatArray,
        samples: NDArray[np.bool_],
        episodes: Sequence[slice],
        interval: float,
    ) -> None:
        """Keep what the estimates need.

        Args:
            curves: Curves that the zero offset follows.
            weight: ``(T, pads, 3, rows, cols)`` weights of the samples, 0 for channels that are not in use.
            samples: ``(T,)`` samples to estimate it from.
            episodes: Samples of each episode.
            interval: Interval between samples, in seconds.
        """
        self.samples, self._curves, self._weight, self._interval = samples, curves, weight, interval
        self.by_episode = [span.start + np.flatnonzero(samples[span]) for span in episodes]
        self._alive = weight[0] > 0

    def fit(self, difference: FloatArray) -> FloatArray:
        """``(curves, pads, 3, rows, cols)`` least-squares amplitudes of the curves for a difference (N)."""
        assert self._curves is not None
        curves = self._curves.values
        flat = difference.reshape(len(self.samples), -1)
        right = curves @ (self._square * flat)
        zero = np.einsum("cij,jc->ic", self._inverse, right).reshape(len(curves), *self._alive.shape)
        if self._curves.shrink is not None:
            zero = self.drawn(zero)
            for steady in np.flatnonzero(self._curves.constant):  # the constant, given the others
                normal = np.einsum("it,tc->ic", curves[steady] * curves, self._square)
                others = np.sum(normal * zero.reshape(len(zero), -1), axis=0) - normal[steady] * zero[steady].ravel()
                own = (right[steady] - others) / np.maximum(normal[steady], 1e-12)
                zero[steady] = own.reshape(zero[steady].shape)
        return zero

    def means(self, values: FloatArray, piece: float = np.inf) -> FloatArray:
        """Means of ``(T, ...)`` values over the samples, by episode or by pieces of `piece` seconds."""
        most = max(NOISE.samples, int(min(piece / self._interval, len(self.samples))))
        pieces = [
            part
            for frames in self.by_episode
            for part in np.array_split(frames, max(1, len(frames) // most))
            if len(part) >= NOISE.samples
        ]
        return np.reshape([values[part].mean(axis=0) for part in pieces], (len(pieces), *values.shape[1:]))

    def planes(self, values: FloatArray) -> FloatArray:
        """``(..., pads, 3, rows, cols)`` planes fitted to the values of each pad's axis."""
        flat = values.reshape(*values.shape[:-2], -1)
        return np.einsum("pkij,...pkj->...pki", self._onto_planes, flat, optimize=True).reshape(values.shape)

    def drawn(self, amounts: FloatArray) -> FloatArray:
        """Amplitudes of the curves, shrunk toward planes."""
        assert self._curves is not None
        if self._curves.shrink is None:
            return amounts
        plane = self.planes(amounts)
        return plane + self._curves.shrink * (amounts - plane)

    def shrunk(self, difference: FloatArray) -> Curves:
        """The curves, with the amplitudes of each but constants shrunk toward a plane over each pad's axis.

        This is a James-Stein estimator: the shrinkage increases as the spread of the amplitudes approaches their
        sampling error, estimated from the scatter between pieces at rest.

        Args:
            difference: ``(T, pads, 3, rows, cols)`` N, to be explained by the zero offset.
        """
        assert self._curves is not None
        steady = self._curves.constant
        basis = self.means(self._curves.values.T, NOISE.piece)
        means = self.means(difference, NOISE.piece)
        degrees = len(basis) - basis.shape[1]
        if steady.all() or degrees < 2:
            return self._curves
        solve = np.linalg.pinv(basis)
        amounts = np.tensordot(solve, means, 1)
        left = np.sum((means - np.tensordot(basis, amounts, 1)) ** 2, axis=0, where=self._alive) / degrees
        variance = np.multiply.outer(np.sum(solve**2, axis=1), left.sum(axis=(-2, -1), keepdims=True))
        spread = np.sum((amounts - self.planes(amounts)) ** 2, axis=(-2, -1), keepdims=True, where=self._alive)
        free = 1 - np.trace(self._onto_planes, axis1=-2, axis2=-1) / np.maximum(self._alive.sum(axis=(-2, -1)), 1)
        share = 1 - variance * free[..., None, None] / np.maximum(spread, 1e-12)
        shrink = np.where(steady[:, None, None, None, None], 1.0, np.clip(share, 0.0, 1.0))
        return replace(self._curves, shrink=shrink)

    @cached_property
    def _square(self) -> FloatArray:
        """``(T, channels)`` least-squares weights."""
        return (self._weight**2).reshape(len(self.samples), -1) * self.samples[:, None]

    @cached_property
    def _inverse(self) -> FloatArray:
        """``(channels, curves, curves)`` inverse normal matrix."""
        assert self._curves is not None
        curves = self._curves.values
        normal = np.einsum("it,jt,tc->cij", curves, curves, self._square, optimize=True)
        ridge = 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-12
        return np.linalg.inv(normal + ridge * np.eye(len(curves)))

    @cached_property
    def _onto_planes(self) -> FloatArray:
        """``(pads, 3, taxels, taxels)`` projection of a pad axis's values onto the plane fitted to channels in use."""
        pads, axes, rows, cols = self._alive.shape
        row, col = np.meshgrid(np.arange(rows) - (rows - 1) / 2, np.arange(cols) - (cols - 1) / 2, indexing="ij")
        plane = np.stack([np.ones(rows * cols), row.ravel(), col.ravel()], axis=1)
        alive = self._alive.reshape(pads, axes, -1)
        return plane @ np.linalg.pinv(plane * alive[..., None]) * alive[..., None, :]
