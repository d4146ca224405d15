"""Deviations: what the objects' poses in single episodes explain of a residual, taken out of it.

A fit that left them in would bend to them: where an object lies 0.2 mm lower in one episode, a mount seems tilted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.inside.responses import SPREAD, Responses

FloatArray = NDArray[np.float64]

REMEMBERED = 1000.0
"""Numbers that share their error: what a model is wrong by lasts for longer than a frame, on many taxels."""


class Deviations:
    """Poses of each episode that differ from their mean, which stays: it is a cause of its own.

    What is taken out is linear in the residual: poses of a normal distribution (`SPREAD`) that sum to zero over the
    episodes, by least squares.
    """

    def __init__(self, scene: Responses, weight: FloatArray, episodes: Sequence[slice]) -> None:
        """Prepare.

        Args:
            scene: What the poses do.
            weight: ``(T, pads, 3, rows, cols)`` what a residual is multiplied by.
            episodes: The samples of each episode.
        """
        slopes = [scene.slope(one) * SPREAD[one.parameter.unit] * weight for one in scene.poses]
        self._columns = [np.stack([s[span].ravel() for s in slopes]) for span in episodes]
        self._episodes = tuple(episodes)
        eye = REMEMBERED * np.eye(len(slopes))
        self._inverses = np.linalg.inv(np.stack([own @ own.T + eye for own in self._columns]))
        self._common = np.linalg.inv(self._inverses.sum(axis=0))

    @classmethod
    def of(cls, scene: Responses, weight: FloatArray, episodes: Sequence[slice]) -> Deviations | None:
        """The same, or None where there is no object, or but one episode."""
        return cls(scene, weight, episodes) if scene.poses and len(episodes) > 1 else None

    def removed(self, residual: FloatArray) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` a weighed residual without them."""
        parts = [residual[span].ravel() for span in self._episodes]
        right = np.stack([own @ part for own, part in zip(self._columns, parts, strict=True)])
        mean = self._common @ np.einsum("eij,ej->i", self._inverses, right)
        poses = np.einsum("eij,ej->ei", self._inverses, right - mean)
        out = np.empty_like(residual)
        for span, own, pose in zip(self._episodes, self._columns, poses, strict=True):
            out[span] = residual[span] - (pose @ own).reshape(residual[span].shape)
        return out
