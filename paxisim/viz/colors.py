"""Colour scale common to all figures: red for compression, blue for tension."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

STOPS: tuple[tuple[float, tuple[float, float, float]], ...] = (
    (-1.0, (0.07, 0.27, 0.60)),
    (-0.5, (0.36, 0.59, 0.85)),
    (0.0, (0.95, 0.95, 0.94)),
    (0.5, (0.96, 0.50, 0.42)),
    (1.0, (0.76, 0.03, 0.10)),
)
"""(normal force / vmax, RGB): light grey at rest, red where pressed, blue where the normal force is negative."""

STOPS_ON_DARK: tuple[tuple[float, tuple[float, float, float]], ...] = (
    (-1.0, (0.45, 0.72, 1.00)),
    (-0.5, (0.14, 0.40, 0.82)),
    (0.0, (0.20, 0.20, 0.20)),
    (0.5, (0.66, 0.17, 0.17)),
    (1.0, (1.00, 0.38, 0.33)),
)
"""The same for figures with a dark background: dark grey at rest."""

UNKNOWN_COLOR = (0.55, 0.55, 0.55)
"""RGB of a taxel whose reading is NaN."""


def taxel_colors(force: ArrayLike, vmax: float) -> NDArray[np.float64]:
    """Colour taxels by their normal force.

    Args:
        force: ``(..., 3, rows, cols)`` newtons, pad frame. Only z, the normal force, is used.
        vmax: Normal force (N) of full red, positive; full blue is at ``-vmax``. Larger magnitudes are clipped.

    Returns:
        ``(..., rows, cols, 4)`` opaque RGBA in 0..1; grey where the force is NaN.
    """
    level = np.asarray(force, dtype=np.float64)[..., 2, :, :] / vmax
    levels = [stop for stop, _ in STOPS]
    rgb = np.stack([np.interp(level, levels, channel) for channel in zip(*(c for _, c in STOPS), strict=True)], -1)
    rgb = np.where(np.isnan(level)[..., None], UNKNOWN_COLOR, rgb)
    return np.concatenate([rgb, np.ones_like(rgb[..., :1])], axis=-1)
