"""lerobot_stats: the statistics by which LeRobot normalises a feature.

They have the same shape as LeRobot's own: one value for each index of the feature's last axis, taken over all frames
and all other axes. LeRobot can therefore add episodes to the dataset and merge it with others.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


def feature_stats(values: NDArray[Any]) -> dict[str, list[Any]]:
    """Return minimum, maximum, mean, standard deviation and quantiles of the known values, and the number of frames.

    Args:
        values: ``(T, *shape)``, or ``(T,)`` for the shape ``(1,)``.

    Returns:
        Lists by name, each as long as the last axis except ``count``, which has length 1; NaN if no value is known.
    """
    flat = values.reshape(-1, values.shape[-1] if values.ndim > 1 else 1)
    columns = [_column_stats(flat[:, i]) for i in range(flat.shape[1])]
    return {**{name: [column[name] for column in columns] for name in columns[0]}, "count": [len(values)]}


def _column_stats(column: NDArray[Any]) -> dict[str, Any]:
    known = column[~np.isnan(column)]
    if not len(known):
        return dict.fromkeys(("min", "max", "mean", "std", *QUANTILES), float("nan"))
    exact = known.astype(np.float64)
    return {
        "min": known.min().item(),
        "max": known.max().item(),
        "mean": float(exact.mean()),
        "std": float(exact.std()),
        **dict(zip(QUANTILES, np.quantile(exact, list(QUANTILES.values())).tolist(), strict=True)),
    }
