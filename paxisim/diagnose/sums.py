"""Sums: curves of time fitted to every channel by least squares, each episode judged by what the others say."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from paxisim.diagnose.problem import FloatArray, Problem

FALSE_CHANNELS = 0.05  # share of the channels said to need a curve, of which that is not so


class Sums:
    """Least squares of a few curves of time for every channel, with the sums of each episode kept apart."""

    def __init__(
        self,
        problem: Problem,
        rest: FloatArray,
        curves: list[FloatArray],
        frames: NDArray[np.bool_],
        slope: FloatArray | None = None,
    ) -> None:
        """Sum up.

        Args:
            problem: The recording.
            rest: ``(T, pads, 3, rows, cols)`` newtons to be explained.
            curves: ``(T,)`` each.
            frames: ``(T,)`` that count.
            slope: ``(T, pads, 3, rows, cols)`` by how much a reading moves with the curves; default: 1.
        """
        basis = np.stack(curves)
        products, projections = [], []
        weight = (problem.weight**2).reshape(len(rest), -1) * frames[:, None]
        steep = weight if slope is None else weight * slope.reshape(len(rest), -1)
        both = weight if slope is None else steep * slope.reshape(len(rest), -1)
        flat = rest.reshape(len(rest), -1)
        for span in problem.episodes:
            own = basis[:, span]
            products.append(np.einsum("it,jt,tc->cij", own, own, both[span], optimize=True))
            projections.append(np.einsum("it,tc->ci", own, steep[span] * flat[span]))
        self._products, self._projections = np.array(products), np.array(projections)

    def _solve(self, products: FloatArray, projections: FloatArray, prior: float) -> FloatArray:
        size = products.shape[-1]
        ridge = 1e-6 * np.trace(products, axis1=-2, axis2=-1)[..., None, None] / size + max(prior, 1e-9)
        return np.linalg.solve(products + ridge * np.eye(size), projections[..., None])[..., 0]

    def values(self, prior: float = 0.0) -> FloatArray:
        """``(channels, curves)`` newtons; `prior` is what each draws to 0 with (1/N^2)."""
        return self._solve(self._products.sum(axis=0), self._projections.sum(axis=0), prior)

    def values_of_others(self, prior: float = 0.0) -> FloatArray:
        """``(episodes, channels, curves)`` newtons, fitted on the other episodes."""
        total, right = self._products.sum(axis=0), self._projections.sum(axis=0)
        return self._solve(total - self._products, right - self._projections, prior)

    def _gain(self, values: FloatArray) -> FloatArray:
        quadratic = np.einsum("...ci,...cij,...cj->...c", values, self._products, values)
        return 2 * np.einsum("...ci,...ci->...c", values, self._projections) - quadratic

    def explained(self) -> FloatArray:
        """``(episodes, channels)`` energy taken away, fitted on all."""
        return self._gain(np.broadcast_to(self.values(), self._projections.shape))

    def heldout(self) -> FloatArray:
        """``(episodes, channels)`` energy taken away, fitted on the other episodes."""
        return self._gain(self.values_of_others())

    def rejects(self) -> NDArray[np.bool_]:
        """``(channels,)`` whose last curve is there: episodes are the replicates, false discoveries are bounded."""
        values = self.values()
        inverse = np.linalg.pinv(self._products.sum(axis=0))
        score = self._projections - np.einsum("ecij,cj->eci", self._products, values)
        effect = np.einsum("cij,eci->ecj", inverse, score)[..., -1]
        used = np.abs(self._projections).sum(axis=(1, 2)) > 0
        degrees = max(int(used.sum()) - values.shape[1], 1)
        spread = np.sqrt(np.sum(effect**2, axis=0) * used.sum() / degrees)
        p = 2 * student.sf(np.abs(values[:, -1]) / np.maximum(spread, 1e-12), degrees)
        p[np.abs(values[:, -1]) < 1e-12] = 1.0
        order = np.sort(p)
        passing = np.flatnonzero(order <= FALSE_CHANNELS * np.arange(1, len(p) + 1) / len(p))
        return p <= (order[passing[-1]] if len(passing) else -1.0)
