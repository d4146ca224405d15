"""Dipoles: the field of small magnets, and how it changes when they move and turn.

A magnet whose size is small beside its distance is a dipole: ``B = mu0 / (4 pi) (3 r (m . r) / r^5 - m / r^3)``.
Source: J. D. Jackson, Classical Electrodynamics (1998), equation 5.56.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from array_api_compat import array_namespace
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

MU0_4PI = 1e-7  # T m / A


def field(moment: Any, offset: Any) -> Any:
    """``(..., 3)`` flux density (T) of dipoles at an offset from them.

    Args:
        moment: ``(..., 3)`` A m^2; numpy or torch.
        offset: ``(..., 3)`` from the magnet to where the field is wanted (m).
    """
    square = (offset * offset).sum(-1)[..., None]
    along = (moment * offset).sum(-1)[..., None]
    inverse = MU0_4PI / (square * square**0.5)
    return inverse * (3 * along / square * offset - moment)


def turned(moment: Any, rotation: Any) -> Any:
    """``(..., 3)`` moments after a rotation by ``(..., 3)`` rad about the axes, of the same length as before."""
    x, y, z = (moment[..., i] for i in range(3))
    a, b, c = (rotation[..., i] for i in range(3))
    parts = (x + b * z - c * y, y + c * x - a * z, z + a * y - b * x)
    length = ((x * x + y * y + z * z) / sum(part * part for part in parts)) ** 0.5
    return array_namespace(rotation).stack([part * length for part in parts], axis=-1)


def jacobian(moment: FloatArray, offset: FloatArray, step: float = 1e-6) -> FloatArray:
    """``(..., 3, 6)`` change of the field per metre and radian that each magnet moves (T/m, T/rad), by differences.

    Args:
        moment: ``(..., 3)`` A m^2.
        offset: ``(..., 3)`` from the magnet at rest to where the field is wanted (m).
        step: Of the differences (m and rad).
    """
    columns = []
    for axis in np.eye(3):
        # a magnet that moves by +step sees the place of the sensor at -step
        columns.append((field(moment, offset - step * axis) - field(moment, offset + step * axis)) / (2 * step))
    for axis in np.eye(3):
        there, back = (turned(moment, np.broadcast_to(s * step * axis, moment.shape)) for s in (1, -1))
        columns.append((field(there, offset) - field(back, offset)) / (2 * step))
    return np.stack(columns, axis=-1)
