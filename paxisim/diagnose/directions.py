"""Directions: what recorded covariates do without contact, such as the joints of a hand, as a few numbers a frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NO_POSE = ("temperature",)  # covariates that a field does not follow
KEPT = 0.99  # of the variance of all covariates, that the directions hold
MOST = 6  # directions
STILL = 1e-9  # of a covariate, by which one that stands still varies
SEEN = 0.25  # of a covariate's spread, that it must have without contact: else what it does is not told from a force's


@dataclass(frozen=True, eq=False)
class Directions:
    """Principal components of covariates without contact.

    Attributes:
        names: Of the covariates.
        middle: ``(covariates,)`` their means, each in its unit.
        axes: ``(directions, covariates)`` what each direction takes of each, in 1 over its unit.
    """

    names: tuple[str, ...]
    middle: FloatArray
    axes: FloatArray

    def along(self, covariates: Mapping[str, FloatArray]) -> FloatArray:
        """``(directions, T)`` of ``(T,)`` covariates; each has a mean of 0 and a spread of 1 without contact."""
        return self.axes @ (np.stack([covariates[name] for name in self.names]) - self.middle[:, None])


def directions_of(covariates: Mapping[str, FloatArray], rest: NDArray[np.bool_]) -> Directions | None:
    """The directions of the ``(T,)`` covariates that vary without contact, in samples `rest`; None if none does."""
    poses = {name: c for name, c in covariates.items() if name not in NO_POSE}
    spreads = {name: (float(np.std(c[rest])), float(np.std(c))) for name, c in poses.items()}
    least = {name: max(SEEN * whole, STILL * float(np.abs(poses[name]).max())) for name, (_, whole) in spreads.items()}
    names = tuple(name for name, (own, _) in spreads.items() if own > least[name])
    if not names:
        return None
    values = np.stack([covariates[name][rest] for name in names])
    middle, scale = values.mean(axis=1), values.std(axis=1)
    size, ways = np.linalg.eigh(np.cov((values - middle[:, None]) / scale[:, None], bias=True).reshape(len(names), -1))
    size, ways = size[::-1], ways[:, ::-1].T
    count = min(int(np.searchsorted(np.cumsum(size) / size.sum(), KEPT)) + 1, MOST, len(names))
    return Directions(names, middle, ways[:count] / np.sqrt(size[:count, None]) / scale)
