"""Followed: the covariate that the effect of a cause follows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.transform import Transform


def followed(
    transform: Transform,
    covariates: Mapping[str, NDArray[np.floating]],
    added: NDArray[np.floating],
    frames: NDArray[np.bool_],
) -> tuple[str, float]:
    """Return the covariate that explains most of a transform's effect linearly, and the share that it explains.

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
        size = max(float(values @ values), 1e-300)
        shares[name] = float(np.sum((values @ apart) ** 2)) / size / whole
    best = max(shares, key=lambda name: shares[name])
    return best, shares[best]
