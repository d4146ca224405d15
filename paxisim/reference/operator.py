"""The nominal operator of a magnetic pad: what its design makes of the loads on neighbouring taxels."""

from __future__ import annotations

import numpy as np

from paxisim.augment.gel_operator import GelOperator
from paxisim.layout import TaxelLayout
from paxisim.reference.pad import MagneticPad
from paxisim.reference.parameters import PadParameters, size_of

PEAK = 0.3
"""Peak force (N) of a press on a taxel of the default size, so small that the pad is linear."""
WIDTHS = (0.7, 1.5, 3.0)
"""Standard deviations of the presses (pitches), from a point to a flat face."""
DRAGS = ((0.0, 0.0), (0.3, 0.0), (0.0, 0.3), (-0.3, 0.0), (0.0, -0.3))
"""Shear of the presses along x and y, as shares of the normal force."""


def nominal_operator(layout: TaxelLayout, parameters: PadParameters | None = None, *, rings: int = 1) -> GelOperator:
    """Return the `GelOperator` nearest to the nominal pad of a design, over presses on each of its taxels.

    Presses of all widths matter: fitted to loads on single taxels, the operator misses the sum of what far neighbours
    do.

    Args:
        layout: Layout of the taxels, a flat grid.
        parameters: Design of the pad. Default: `PadParameters.for_layout` of the layout.
        rings: Rings of neighbours, 1 or 2.

    Raises:
        InvalidValueError: The layout is not a flat grid, or `rings` is neither 1 nor 2.
    """
    pad = MagneticPad(layout, parameters)
    row, col = np.mgrid[: layout.rows, : layout.cols]
    squared = (row - row.reshape(-1, 1, 1)) ** 2 + (col - col.reshape(-1, 1, 1)) ** 2  # (taxel pressed, rows, cols)
    bumps = np.exp(-squared / (2 * np.square(WIDTHS)[:, None, None, None])).reshape(-1, 1, *row.shape)
    along = np.array([(x, y, 1.0) for x, y in DRAGS])[:, None, :, None, None]
    force = (PEAK * size_of(layout) * along * bumps).reshape(-1, 3, *row.shape)
    return GelOperator.fitted(force, pad.read(force), rings=rings)
