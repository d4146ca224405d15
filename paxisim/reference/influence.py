"""Influence: displacement and rotation of every magnet of a pad under a force on every taxel."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from paxisim.layer.response import layer_response
from paxisim.layout import TaxelLayout
from paxisim.reference.parameters import PadParameters

FloatArray = NDArray[np.float64]

DIFFERENCE_STEP = 0.05
"""Step of the differences over a magnet's position, in thicknesses of the gel."""
CACHE_SIZE = 28
"""Number of cached matrices. A design needs seven, since its units differ only in modulus and magnet positions."""


def influence(layout: TaxelLayout, parameters: PadParameters, shift: FloatArray | None = None) -> FloatArray:
    """Return the displacements and rotations of the magnets per force on the taxels.

    A magnet moves with the gel at its actual position. The motion is expanded to second order along each axis about
    the nominal position.

    Args:
        layout: Layout of the taxels, a flat grid.
        parameters: Parameters of the pad.
        shift: ``(N, 3)`` vectors from the nominal to the actual position of each magnet (m). Default: zero.

    Returns:
        ``(3 N, 6, N)`` matrix from forces ``(3, N)`` to displacements and rotations along x, y and z of each magnet
        (m/N and rad/N).
    """
    layer, depth = parameters.layer, parameters.magnet_depth
    step = min(DIFFERENCE_STEP * layer.thickness, depth / 2, (layer.thickness - depth) / 2)

    def at(x: float, y: float, z: float) -> FloatArray:
        return _of_unit_modulus(layout, (x, y), depth + z, layer.thickness, layer.poisson)

    middle = at(0, 0, 0)
    if shift is None:
        return middle / layer.modulus
    total = middle.copy()
    for axis, by in enumerate(shift.T / step):
        there, back = (at(*(sign * step * np.eye(3)[axis])) for sign in (1, -1))
        total += by / 2 * (there - back) + by**2 / 2 * (there - 2 * middle + back)
    return total / layer.modulus


@lru_cache(maxsize=CACHE_SIZE)
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
