"""Dipoles: the field of small magnets, and its change when they move and turn.

A magnet much smaller than its distance is a dipole: ``B = mu0 / (4 pi) (3 r (m . r) / r^5 - m / r^3)``.
Source: J. D. Jackson, Classical Electrodynamics (1998), equation 5.56.

Vectors are ``(..., 3)``, or three arrays of components, for which numpy is several times faster.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from array_api_compat import array_namespace
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

MU0_4PI = 1e-7  # T m / A


def field(moment: Any, offset: Any) -> Any:
    """Return the flux density (T) of dipoles at an offset from them, ``(..., 3)``.

    Args:
        moment: ``(..., 3)`` moments (A m^2); numpy or torch.
        offset: ``(..., 3)`` vectors from the magnet to the point (m).
    """
    return array_namespace(offset).stack(field_parts(_parts(moment), _parts(offset)), axis=-1)


def field_parts(moment: Sequence[Any], offset: Sequence[Any]) -> list[Any]:
    """Return the same as `field`, with three arrays of components as arguments and result."""
    (mx, my, mz), (x, y, z) = moment, offset
    inverse = 1 / (x * x + y * y + z * z)
    along = (3 * (mx * x + my * y + mz * z)) * inverse
    scale = (MU0_4PI * inverse) * inverse**0.5
    return [scale * (along * r - m) for m, r in zip(moment, offset, strict=True)]


def turned(moment: Any, rotation: Any) -> Any:
    """Return moments ``(..., 3)`` after small rotations ``(..., 3)`` (rad) about the axes, with unchanged length."""
    return array_namespace(rotation).stack(turned_parts(_parts(moment), _parts(rotation)), axis=-1)


def turned_parts(moment: Sequence[Any], rotation: Sequence[Any]) -> list[Any]:
    """Return the same as `turned`, with three arrays of components as arguments and result."""
    (x, y, z), (a, b, c) = moment, rotation
    across = b * z - c * y, c * x - a * z, a * y - b * x
    # the added part is perpendicular to the moment
    square = x * x + y * y + z * z
    length = (square / (square + sum(part * part for part in across))) ** 0.5
    return [length * (m + part) for m, part in zip(moment, across, strict=True)]


def jacobian(moment: FloatArray, offset: FloatArray, step: float = 1e-6) -> FloatArray:
    """Return the derivative of the field by displacement (T/m) and rotation (T/rad) of each magnet, ``(..., 3, 6)``.

    Args:
        moment: ``(..., 3)`` moments (A m^2).
        offset: ``(..., 3)`` vectors from the magnet at rest to the point (m).
        step: Step of the central differences (m and rad).
    """
    columns = []
    for axis in np.eye(3):
        # moving the magnet by +step shifts the offset by -step
        columns.append((field(moment, offset - step * axis) - field(moment, offset + step * axis)) / (2 * step))
    for axis in np.eye(3):
        there, back = (turned(moment, np.broadcast_to(s * step * axis, moment.shape)) for s in (1, -1))
        columns.append((field(there, offset) - field(back, offset)) / (2 * step))
    return np.stack(columns, axis=-1)


def _parts(vectors: Any) -> list[Any]:
    return [vectors[..., axis] for axis in range(3)]
