"""Deviations: remove from a residual the part that the objects' poses in individual episodes explain.

Otherwise the fit would absorb them: if an object lies 0.2 mm lower in one episode, a mount seems tilted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.responses import SPREAD, Responses

FloatArray = NDArray[np.float64]

CORRELATED_SAMPLES = 1000.0
"""Number of samples that share one error: model errors last longer than a frame and extend over many taxels."""


class Deviations:
    """Deviations of each episode's poses from their mean; the mean stays, as it is a cause of its own.

    The removed part is linear in the residual: a least-squares fit of poses with a normal prior (`SPREAD`) that sum to
    zero over the episodes.

    Attributes:
        simulated: ``(T, pads, 3, rows, cols)`` what is left of the effect of the poses that the simulation already has.
            It belongs to every residual, since the prior is about no deviation at all.
    """

    def __init__(self, scene: Responses, weight: FloatArray, episodes: Sequence[slice]) -> None:
        """Precompute the least-squares matrices.

        Args:
            scene: Effects of the poses.
            weight: ``(T, pads, 3, rows, cols)`` weights of the residual.
            episodes: Samples of each episode.
        """
        slopes = [scene.slope(one) * SPREAD[one.parameter.unit] * weight for one in scene.poses]
        self._columns = [np.stack([s[span].ravel() for s in slopes]) for span in episodes]
        self._episodes = tuple(episodes)
        eye = CORRELATED_SAMPLES * np.eye(len(slopes))
        self._inverses = np.linalg.inv(np.stack([own @ own.T + eye for own in self._columns]))
        self._common = np.linalg.inv(self._inverses.sum(axis=0))
        shares = [
            own[scene.rows] / SPREAD[one.parameter.unit] for one, own in zip(scene.poses, scene.simulated, strict=True)
        ]
        effect = sum(slope * np.reshape(own, (-1, 1, 1, 1, 1)) for slope, own in zip(slopes, shares, strict=True))
        self.simulated = self.removed(np.asarray(effect))

    @classmethod
    def of(cls, scene: Responses, weight: FloatArray, episodes: Sequence[slice]) -> Deviations | None:
        """Return the deviations, or None if there is no object or only one episode."""
        return cls(scene, weight, episodes) if scene.poses and len(episodes) > 1 else None

    def removed(self, residual: FloatArray) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` a weighted residual without the part that the poses explain."""
        parts = [residual[span].ravel() for span in self._episodes]
        right = np.stack([own @ part for own, part in zip(self._columns, parts, strict=True)])
        mean = self._common @ np.einsum("eij,ej->i", self._inverses, right)
        poses = np.einsum("eij,ej->ei", self._inverses, right - mean)
        out = np.empty_like(residual)
        for span, own, pose in zip(self._episodes, self._columns, poses, strict=True):
            out[span] = residual[span] - (pose @ own).reshape(residual[span].shape)
        return out
