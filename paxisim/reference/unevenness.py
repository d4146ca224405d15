"""Unevenness: the surface of a manufactured unit, which is not flat.

Real pads have uneven gels, and those of one product differ (paper, "Non-uniform Contact"). A unit's surface is the sum
of long waves, as of a warped mould, and of bumps and dents with the deviations of the paper's bumps (Table I). The
paper gives no sizes: those in `PadParameters.unevenness` are ours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from paxisim.bump import DEVIATION_RANGE
from paxisim.layout import TaxelLayout

FloatArray = NDArray[np.float64]

THICKNESS = 1e-3
"""Mean height of a surface (m): the thickness of the taxel cubes of a `Pad`."""
HEIGHT_RANGE = (0.5, 1.5)
"""Bounds of a unit's unevenness relative to that of the design, drawn evenly. Ours."""
_STREAM = 1  # beside the number of the unit: these draws change no other ones
_WAVES = _BUMPS = 3


def uneven_heights(layout: TaxelLayout, unevenness: float, seed: int | None) -> FloatArray:
    """Draw the surface of the unit with a number, or return a flat one for None.

    Args:
        layout: Layout of the taxels, a flat grid.
        unevenness: Distance (m) from the lowest to the highest taxel of an average unit.
        seed: Number of the unit.

    Returns:
        ``(rows, cols)`` heights (m), as for `paxisim.set_surface`: thickness of the taxel cubes, `THICKNESS` on
        average.
    """
    shape = layout.rows, layout.cols
    if seed is None or layout.taxels == 1:
        return np.full(shape, THICKNESS)
    rng = np.random.default_rng([seed, _STREAM])
    row, col = np.indices(shape) + 0.5  # in taxels from the corner, as for the paper's bumps
    slopes = rng.uniform(-1, 1, (2, _WAVES, 1, 1))  # at most one wave over the pad along each axis
    turns = slopes[0] * row / layout.rows + slopes[1] * col / layout.cols + rng.uniform(0, 1, (_WAVES, 1, 1))
    waves = np.cos(2 * np.pi * turns).sum(axis=0)
    middle, deviation = rng.uniform(0, 1, (2, _BUMPS, 1, 1)), rng.uniform(*DEVIATION_RANGE, (2, _BUMPS, 1, 1))
    down, right = (row - middle[0] * layout.rows) / deviation[0], (col - middle[1] * layout.cols) / deviation[1]
    bumps = (rng.choice([-1.0, 1.0], (_BUMPS, 1, 1)) * np.exp(-(down**2 + right**2) / 2)).sum(axis=0)
    surface = waves / np.ptp(waves) + bumps / np.ptp(bumps)
    surface *= rng.uniform(*HEIGHT_RANGE) * unevenness / np.ptp(surface)
    return surface - surface.mean() + THICKNESS
