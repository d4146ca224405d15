"""Directions: principal components of the covariates recorded without contact, such as the joints of a hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NO_POSE = ("temperature",)  # covariates that do not describe a pose and so do not change a field
KEPT_VARIANCE = 0.99  # share of the variance of all covariates that the directions retain
MAX_DIRECTIONS = 6  # most directions
CONSTANT_SPREAD = 1e-9  # relative spread up to which a covariate is constant
MIN_FREE_SPREAD = 0.25  # least spread without contact, relative to the whole; below it, force confounds the effect


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
        name: max(MIN_FREE_SPREAD * whole, CONSTANT_SPREAD * float(np.abs(poses[name]).max()))
        for name, (_, whole) in spreads.items()
    }
    names = tuple(name for name, (own, _) in spreads.items() if own > least[name])
    if not names:
        return None
    values = np.stack([covariates[name][rest] for name in names])
    middle, scale = values.mean(axis=1), values.std(axis=1)
    size, ways = np.linalg.eigh(np.cov((values - middle[:, None]) / scale[:, None], bias=True).reshape(len(names), -1))
    size, ways = size[::-1], ways[:, ::-1].T
    count = min(int(np.searchsorted(np.cumsum(size) / size.sum(), KEPT_VARIANCE)) + 1, MAX_DIRECTIONS, len(names))
    return Directions(names, middle, ways[:count] / np.sqrt(size[:count, None]) / scale)
