"""Influence: how far every magnet of a pad moves and turns under a force on every taxel."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout
from paxisim.reference.bonded_layer import layer_response
from paxisim.reference.parameters import PadParameters

FloatArray = NDArray[np.float64]

KEPT = 8
"""Designs whose matrices are kept; those of units of one design differ by a factor only."""


def influence(layout: TaxelLayout, parameters: PadParameters) -> tuple[FloatArray, FloatArray]:
    """The magnets' displacements and rotations by the forces on the taxels.

    Args:
        layout: A flat grid.
        parameters: What the pad is made of.

    Returns:
        Two ``(3 N, 3 N)`` matrices (m/N and rad/N): from forces ``(3, N)``, row-major, to ``(N, 3)``.
    """
    places = layout.positions[:, :2].astype(np.float64)
    design = parameters.magnet_depth, parameters.thickness, parameters.poisson, layout.pitch
    moved, turned = _of_unit_modulus(places.tobytes(), len(places), *design)
    return moved / parameters.modulus, turned / parameters.modulus


@lru_cache(maxsize=KEPT)
def _of_unit_modulus(
    places: bytes, count: int, depth: float, thickness: float, poisson: float, pitch: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    taxels = np.frombuffer(places).reshape(count, 2)
    offsets = (taxels[None] - taxels[:, None]).reshape(-1, 2)  # from the loaded taxel to the magnet
    unique, where = np.unique(np.round(offsets, 9), axis=0, return_inverse=True)
    found = []
    for response in layer_response(unique, depth, thickness, 1.0, poisson, pitch):
        full = response[where.reshape(-1)].reshape(count, count, 3, 3)  # [loaded, magnet, displacement, force]
        found.append(full.transpose(3, 0, 1, 2).reshape(3 * count, 3 * count))
    return found[0], found[1]
