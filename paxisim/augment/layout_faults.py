"""LayoutFault: the taxels, axes or pads are mapped wrongly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import as_like, namespace
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class LayoutFault(Transform):
    """Swapped taxels, axes or pads, as caused by a wrong mapping of the device's bytes.

    The steps are applied in this order: transpose rows and columns, flip rows, flip columns, permute the axes and set
    their signs, permute the pads. The result is::

        y[p, k, r, c] = axis_signs[k] x'[pad_order[p], axis_order[k], r, c]

    where x' is the transposed and flipped tensor. The flips move readings without rotating their vectors: a pad mounted
    the wrong way round, turned by 180 degrees, needs both flips and ``axis_signs=(-1, -1, 1)``. No information is lost,
    so a fault can be undone. One mapping applies to all environments; the fields are not numbers that can be fitted.

    Source: vendors rarely document taxel order, orientation and signs, and for the paper's pad not at all.

    Attributes:
        flip_rows: Whether row 0 is read as the last row.
        flip_cols: Whether column 0 is read as the last column.
        transpose: Whether rows are read as columns; requires as many rows as columns.
        pad_order: Pads that are read as pad 0, 1, ...; None for no swap.
        axis_order: Axes that are read as x, y and z.
        axis_signs: Signs, 1 or -1, of the x, y and z that are read.

    Raises:
        InvalidValueError: Also if an order is not a permutation, or a sign is neither 1 nor -1.
    """

    stage: ClassVar[str] = "electronics"

    flip_rows: bool = False
    flip_cols: bool = False
    transpose: bool = False
    pad_order: tuple[int, ...] | None = None
    axis_order: tuple[int, int, int] = (0, 1, 2)
    axis_signs: tuple[int, int, int] = (1, 1, 1)

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        for name in ("flip_rows", "flip_cols", "transpose"):
            if getattr(self, name) not in (True, False):
                raise InvalidValueError(f"LayoutFault: {name} must be true or false, got {getattr(self, name)!r}")
            object.__setattr__(self, name, bool(getattr(self, name)))
        for name in ("pad_order", "axis_order", "axis_signs"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _whole_numbers(name, getattr(self, name)))
        if self.pad_order is not None and sorted(self.pad_order) != list(range(len(self.pad_order))):
            raise InvalidValueError(f"LayoutFault: pad_order must be a permutation of 0, 1, ..., got {self.pad_order}")
        if sorted(self.axis_order) != [0, 1, 2]:
            raise InvalidValueError(f"LayoutFault: axis_order must be a permutation of 0, 1, 2, got {self.axis_order}")
        if len(self.axis_signs) != 3 or not set(self.axis_signs) <= {1, -1}:
            raise InvalidValueError(f"LayoutFault: axis_signs must be three of 1 and -1, got {self.axis_signs}")

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        pads, _, rows, cols = x.shape[-4:]
        if self.transpose:
            if rows != cols:
                raise InvalidValueError(
                    f"LayoutFault: transpose needs as many rows as columns, got a tensor of shape {tuple(x.shape)}"
                )
            x = xp.matrix_transpose(x)
        flips = [axis for axis, flipped in ((-2, self.flip_rows), (-1, self.flip_cols)) if flipped]
        if flips:
            x = xp.flip(x, axis=tuple(flips))
        if self.axis_order != (0, 1, 2):
            x = xp.stack([x[..., axis, :, :] for axis in self.axis_order], axis=-3)
        if self.pad_order is not None:
            if len(self.pad_order) != pads:
                raise InvalidValueError(
                    f"LayoutFault: pad_order names {len(self.pad_order)} pads, got a tensor of shape {tuple(x.shape)}"
                )
            x = xp.stack([x[..., pad, :, :, :] for pad in self.pad_order], axis=-4)
        return x * as_like([[[sign]] for sign in self.axis_signs], x)


def _whole_numbers(name: str, values: Any) -> tuple[int, ...]:
    try:
        numbers = tuple(int(value) for value in values)
        if any(number != value for number, value in zip(numbers, values, strict=True)):
            raise ValueError
    except (TypeError, ValueError):
        raise InvalidValueError(f"LayoutFault: {name} must be whole numbers, got {values!r}") from None
    return numbers
