"""Directions: principal components of the covariates recorded without contact, such as the joints of a hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.transform import Transform
from paxisim.diagnose.data.pieces import FloatArray
from paxisim.diagnose.rules import NOISE

NO_POSE = ("temperature",)  # covariates that do not describe a pose and so do not change a field


@dataclass(frozen=True, eq=False)
class Directions:
    """Principal components of covariates without contact.

    Attributes:
        names: Names of the covariates.
        middle: ``(covariates,)`` means, each in the covariate's unit.
        axes: ``(directions, covariates)`` weight of each covariate in each direction, in 1 over the covariate's unit.
    """

    names: tuple[str, ...]
    middle: FloatArray
    axes: FloatArray

    def along(self, covariates: Mapping[str, FloatArray]) -> FloatArray:
        """``(directions, T)`` scores of ``(T,)`` covariates; without contact each has mean 0 and spread 1."""
        return self.axes @ (np.stack([covariates[name] for name in self.names]) - self.middle[:, None])


def directions_of(covariates: Mapping[str, FloatArray], rest: NDArray[np.bool_]) -> Directions | None:
    """The directions of the ``(T,)`` covariates that vary in the samples `rest` without contact; None if none does."""
    poses = {name: c for name, c in covariates.items() if name not in NO_POSE}
    spreads = {name: (float(np.std(c[rest])), float(np.std(c))) for name, c in poses.items()}
    least = {
        name: max(NOISE.free_spread * whole, NOISE.constant * float(np.abs(poses[name]).max()))
        for name, (_, whole) in spreads.items()
    }
    names = tuple(name for name, (own, _) in spreads.items() if own > least[name])
    if not names:
        return None
    values = np.stack([covariates[name][rest] for name in names])
    middle, scale = values.mean(axis=1), values.std(axis=1)
    size, ways = np.linalg.eigh(np.cov((values - middle[:, None]) / scale[:, None], bias=True).reshape(len(names), -1))
    size, ways = size[::-1], ways[:, ::-1].T
    enough = int(np.searchsorted(np.cumsum(size) / size.sum(), NOISE.kept_variance)) + 1
    count = min(enough, NOISE.directions, len(names))
    return Directions(names, middle, ways[:count] / np.sqrt(size[:count, None]) / scale)


def followed(
    transform: Transform,
    covariates: Mapping[str, NDArray[np.floating]],
    added: NDArray[np.floating],
    frames: NDArray[np.bool_],
) -> tuple[str, float]:
    """The covariate that explains most of a transform's effect linearly, and the share that it explains.

    Args:
        transform: Transform with covariates.
        covariates: Covariates by name, ``(T,)`` each.
        added: ``(frames, channels)`` N, effect of the transform in the selected frames.
        frames: ``(T,)`` selected frames.
    """
    apart = added - added.mean(axis=0)
    whole = max(float(np.sum(apart**2)), 1e-300)
    shares = {}
    for name in transform.covariate_names:
        values = covariates[name][frames] - covariates[name][frames].mean()
        shares[name] = float(np.sum((values @ apart) ** 2)) / max(float(values @ values), 1e-300) / whole
    best = max(shares, key=lambda name: shares[name])
    return best, shares[best]
