"""Influence: how far every magnet of a pad moves and turns under a force on every taxel."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout
from paxisim.reference.bonded_layer import layer_response
from paxisim.reference.parameters import PadParameters

FloatArray = NDArray[np.float64]

STEP = 0.05
"""Of the differences over a magnet's place, in thicknesses of the gel."""
KEPT = 28
"""Matrices that are kept: seven for a design, whose units differ by the modulus and the magnets' places only."""


def influence(layout: TaxelLayout, parameters: PadParameters, shift: FloatArray | None = None) -> FloatArray:
    """The magnets' displacements and rotations by the forces on the taxels.

    A magnet that is not at its nominal place moves as the gel does where it is. The motion is expanded about the
    nominal place to second order along each axis.

    Args:
        layout: A flat grid.
        parameters: What the pad is made of.
        shift: ``(N, 3)`` from each magnet's nominal place to its own (m). Default: none.

    Returns:
        ``(3 N, 6, N)``: from forces ``(3, N)`` to displacements and rotations along x, y and z of each magnet
        (m/N and rad/N).
    """
    own = parameters
    step = min(STEP * own.thickness, own.magnet_depth / 2, (own.thickness - own.magnet_depth) / 2)

    def at(x: float, y: float, z: float) -> FloatArray:
        return _of_unit_modulus(layout, (x, y), own.magnet_depth + z, own.thickness, own.poisson)

    middle = at(0, 0, 0)
    if shift is None:
        return middle / own.modulus
    total = middle.copy()
    for axis, by in enumerate(shift.T / step):
        there, back = (at(*(sign * step * np.eye(3)[axis])) for sign in (1, -1))
        total += by / 2 * (there - back) + by**2 / 2 * (there - 2 * middle + back)
    return total / own.modulus


@lru_cache(maxsize=KEPT)
def _of_unit_modulus(
    layout: TaxelLayout, beside: tuple[float, float], depth: float, thickness: float, poisson: float
) -> FloatArray:
    taxels, count = layout.positions[:, :2].astype(np.float64), layout.taxels
    offsets = (taxels[None] - taxels[:, None]).reshape(-1, 2) + beside  # from the loaded taxel to the magnet
    unique, where = np.unique(np.round(offsets, 9), axis=0, return_inverse=True)
    response = np.concatenate(layer_response(unique, depth, thickness, 1.0, poisson, layout.pitch), axis=1)
    full = response[where.reshape(-1)].reshape(count, count, 6, 3)  # [loaded, magnet, motion, force]
    matrix = np.ascontiguousarray(full.transpose(3, 0, 2, 1)).reshape(3 * count, 6, count)
    matrix.setflags(write=False)
    return matrix
