"""SwappedTaxels: pairs of taxels are swapped."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import is_torch, namespace
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class SwappedTaxels(Transform):
    """Two taxels read each other's force on all axes, because two wires or two addresses were swapped.

    Use `LayoutFault` for a reversed order or for swapped axes or pads. No information is lost, and a swap is its own
    inverse. One mapping applies to all environments; the field is not a number that can be fitted.

    Attributes:
        pairs: One entry per pair: the pad, then row and column of both taxels, ``(pad, row, col, row, col)``; empty for
            no swap.

    Raises:
        InvalidValueError: Also if a pair is not five whole numbers of at least 0, or a taxel is named twice.
    """

    stage: ClassVar[str] = "electronics"

    pairs: tuple[tuple[int, int, int, int, int], ...] = ()

    def __post_init__(self) -> None:
        """Check the field."""
        super().__post_init__()
        try:
            given = tuple(tuple(pair) for pair in self.pairs)
            pairs: Any = tuple(tuple(int(number) for number in pair) for pair in given)
            right = pairs == given and all(len(pair) == 5 and min(pair) >= 0 for pair in pairs)
        except (TypeError, ValueError):
            pairs, right = (), False
        if not right:
            raise InvalidValueError(
                "SwappedTaxels: pairs must be (pad, row, col, row, col) each, whole numbers of at least 0, got "
                f"{self.pairs!r}"
            )
        taxels = [taxel for pad, *own in pairs for taxel in ((pad, *own[:2]), (pad, *own[2:]))]
        for taxel in taxels:
            if taxels.count(taxel) > 1:
                raise InvalidValueError(f"SwappedTaxels: pairs name the taxel {taxel[1:]} of pad {taxel[0]} twice")
        object.__setattr__(self, "pairs", pairs)

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        if not self.pairs:
            return x
        xp, shape = namespace(x), tuple(x.shape)
        pads, axes, rows, cols = shape[-4:]
        order = list(range(pads * axes * rows * cols))
        for pad, row, col, other_row, other_col in self.pairs:
            if pad >= pads or max(row, other_row) >= rows or max(col, other_col) >= cols:
                raise InvalidValueError(
                    f"SwappedTaxels: ({row}, {col}) and ({other_row}, {other_col}) of pad {pad} are not both in a "
                    f"tensor of shape {shape}"
                )
            for axis in range(axes):
                first = (pad * axes + axis) * rows * cols
                one, other = first + row * cols + col, first + other_row * cols + other_col
                order[one], order[other] = other, one
        index = xp.asarray(order, **({"device": x.device} if is_torch(x) else {}))
        return xp.reshape(xp.take(xp.reshape(x, (*shape[:-4], len(order))), index, axis=-1), shape)
