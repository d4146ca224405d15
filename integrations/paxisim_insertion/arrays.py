"""Formulas for numpy and torch: the library of an array, constants that go with it, and rotation vectors."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import array_api_compat
import numpy as np


def library_of(array: Any) -> Any:
    """Return the functions of the array's library by the names of the array API standard."""
    return array_api_compat.array_namespace(array)


def like(values: Any, array: Any) -> Any:
    """Return numbers as an array of another array's library, floating dtype and device.

    Tensors are kept, so that a constant travels to the device only once. Do not change the result in place.
    """
    numbers = np.asarray(values, dtype=float)
    if array_api_compat.is_numpy_array(array):
        return numbers.astype(np.result_type(array.dtype, np.float32), copy=False)  # whole numbers become floats
    return _kept(numbers.tobytes(), numbers.shape, library_of(array), array.dtype, array_api_compat.device(array))


@lru_cache(maxsize=256)
def _kept(numbers: bytes, shape: tuple[int, ...], xp: Any, dtype: Any, device: Any) -> Any:
    values = np.frombuffer(numbers).reshape(shape).tolist()
    return xp.asarray(values, dtype=dtype, device=device)


def rotation_vector(rotation: Any) -> Any:
    """Convert rotation matrices ``(..., 3, 3)`` to rotation vectors ``(..., 3)`` (rad), in numpy or torch."""
    xp = library_of(rotation)
    m = [[rotation[..., row, column] for column in range(3)] for row in range(3)]
    x, y, z = m[0][0], m[1][1], m[2][2]
    # four multiples of the quaternion, each by four times one of its components, which is the entry on the diagonal
    multiples = [
        [1 + x + y + z, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]],
        [m[2][1] - m[1][2], 1 + x - y - z, m[1][0] + m[0][1], m[0][2] + m[2][0]],
        [m[0][2] - m[2][0], m[1][0] + m[0][1], 1 - x + y - z, m[2][1] + m[1][2]],
        [m[1][0] - m[0][1], m[0][2] + m[2][0], m[2][1] + m[1][2], 1 - x - y + z],
    ]
    largest, quat = multiples[0][0], xp.stack(multiples[0], axis=-1)
    for index in (1, 2, 3):
        larger = multiples[index][index] > largest
        largest = xp.where(larger, multiples[index][index], largest)
        quat = xp.where(larger[..., None], xp.stack(multiples[index], axis=-1), quat)
    axis = quat[..., 1:]
    sine = xp.sqrt(xp.sum(axis * axis, axis=-1))
    angle = 2 * xp.atan2(sine, quat[..., 0])
    angle = xp.where(angle > math.pi, angle - 2 * math.pi, angle)
    return axis * (angle / xp.where(sine > 0, sine, xp.ones_like(sine)))[..., None]
