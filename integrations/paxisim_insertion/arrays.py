"""Formulas for numpy and torch: the library of an array, and constants that go with it."""

from __future__ import annotations

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
