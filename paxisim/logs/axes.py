"""The axes of an array of taxels, in words, and the tensor that they make of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

WORDS = ("pads", "xyz", "rows", "cols", "taxels")
"""Names of axes: those of the tensor in its order, and ``taxels`` in place of rows and columns."""
FORMS = (
    *(("taxels", "xyz"), ("xyz", "taxels"), ("rows", "cols", "xyz"), ("xyz", "rows", "cols")),
    *(("pads", "xyz", "rows", "cols"), ("pads", "rows", "cols", "xyz")),
)
OFFERED = (  # in messages; never assumed
    *(("pads", "taxels", "xyz"), ("pads", "xyz", "taxels")),
    *(("taxels",), ("rows", "cols"), ("pads", "taxels"), ("pads", "rows", "cols")),
)

Axes = tuple[str, ...]


def given_axes(name: str, shape: Sequence[int], text: str) -> Axes:
    """Return the axes that a user states for an array, such as ``"rows,cols,xyz"``.

    Args:
        name: Name of the array, for messages.
        shape: Its shape without time.
        text: Words of `WORDS`, in the order of the array.

    Raises:
        InvalidValueError: The text is not such words, or they do not fit the shape.
    """
    axes = tuple(text.split(",")) if isinstance(text, str) else ()
    if not are_axes(axes):
        raise InvalidValueError(
            f"the axes of {name} must be rows,cols or taxels, with xyz and pads where the array has them, in its "
            f"order, e.g. rows,cols,xyz; got {text!r}"
        )
    if not fits(axes, shape):
        raise InvalidValueError(
            f"the axes {text} do not fit {name} of shape {shape}: expected one word for each axis and 3 values along "
            "xyz; only a vector can be split, into taxels,xyz or xyz,taxels"
        )
    return axes


def are_axes(axes: Axes) -> bool:
    """Return whether words are the axes of an array: rows and cols, or taxels; with xyz and pads or without."""
    rest = sorted(set(axes) - {"pads", "xyz"})
    return rest in (["cols", "rows"], ["taxels"]) and len(set(axes)) == len(axes)


def fits(axes: Axes, shape: Sequence[int]) -> bool:
    """Return whether an array of that shape, without time, can have these axes."""
    if len(shape) == 1 and len(axes) == 2 and "xyz" in axes:
        return shape[0] % 3 == 0
    return len(axes) == len(shape) and ("xyz" not in axes or shape[axes.index("xyz")] == 3)


def tensor_of(values: NDArray[Any], axes: Axes) -> NDArray[np.float32]:
    """Return ``(T, pads, 3, rows, cols)``, with the taxels of an axis ``taxels`` in one row."""
    if len(axes) == 2 and "xyz" in axes:
        values = values.reshape(len(values), *(3 if axis == "xyz" else -1 for axis in axes))
    elif len(axes) == 1:
        values = values.reshape(len(values), -1)
    own = ["cols" if axis == "taxels" else axis for axis in axes]
    there = [axis for axis in WORDS if axis in own]
    tensor = values.transpose(0, *(1 + own.index(axis) for axis in there))
    tensor = np.expand_dims(tensor, [1 + i for i, axis in enumerate(WORDS[:4]) if axis not in own])
    tensor = tensor.astype(np.float32, copy=False)
    if "xyz" in axes:
        return tensor
    pads, _, rows, cols = tensor.shape[1:]
    full = np.full((len(tensor), pads, 3, rows, cols), np.nan, np.float32)
    full[:, :, 2:] = tensor
    return full


def on_grid(tensor: NDArray[np.float32], layout: TaxelLayout | None) -> NDArray[np.float32]:
    """Return taxels that are in one row, in the vendor's order, on the grid of a layout of as many taxels."""
    if layout is None or layout.taxels != tensor.shape[-1]:
        return tensor  # if the number of taxels differs, the check of the whole recording refuses it
    flat = tensor[:, :, :, 0].swapaxes(2, 3).reshape(*tensor.shape[:2], -1)
    return layout.from_flat(flat)
