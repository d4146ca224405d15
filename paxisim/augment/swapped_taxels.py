"""SwappedTaxels: taxels read each other's force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import is_torch, namespace
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class SwappedTaxels(Transform):
    """Taxels read each other's force on all axes, because wires or addresses were swapped.

    Use `LayoutFault` for a reversed order or for swapped axes or pads. No information is lost. One mapping applies to
    all environments; the field is not a number that can be fitted.

    Attributes:
        rings: Rings of two or more taxels. Each taxel reads the force of the next one, the last that of the first: the
            pad, then row and column of each taxel, ``(pad, row, col, row, col, ...)``. A ring of two is a swap. Empty
            for no swap.

    Raises:
        InvalidValueError: Also if a ring is not such a sequence of whole numbers of at least 0, or a taxel is named
            twice.
    """

    stage: ClassVar[str] = "electronics"

    rings: tuple[tuple[int, ...], ...] = ()

    def __post_init__(self) -> None:
        """Check the field."""
        super().__post_init__()
        try:
            given = tuple(tuple(ring) for ring in self.rings)
            rings: Any = tuple(tuple(int(number) for number in ring) for ring in given)
            right = rings == given and all(len(ring) >= 5 and len(ring) % 2 and min(ring) >= 0 for ring in rings)
        except (TypeError, ValueError):
            rings, right = (), False
        if not right:
            raise InvalidValueError(
                "SwappedTaxels: rings must be (pad, row, col, row, col, ...) each, whole numbers of at least 0, got "
                f"{self.rings!r}"
            )
        taxels = [taxel for ring in rings for taxel in _taxels(ring)]
        for taxel in taxels:
            if taxels.count(taxel) > 1:
                raise InvalidValueError(f"SwappedTaxels: rings name the taxel {taxel[1:]} of pad {taxel[0]} twice")
        object.__setattr__(self, "rings", rings)

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        if not self.rings:
            return x
        xp, shape = namespace(x), tuple(x.shape)
        pads, axes, rows, cols = shape[-4:]
        order = list(range(pads * axes * rows * cols))
        for ring in self.rings:
            taxels = _taxels(ring)
            for pad, row, col in taxels:
                if pad >= pads or row >= rows or col >= cols:
                    raise InvalidValueError(
                        f"SwappedTaxels: taxel ({row}, {col}) of pad {pad} is not in a tensor of shape {shape}"
                    )
            for axis in range(axes):
                places = [((pad * axes + axis) * rows + row) * cols + col for pad, row, col in taxels]
                for place, source in zip(places, [*places[1:], places[0]], strict=True):
                    order[place] = source
        index = xp.asarray(order, **({"device": x.device} if is_torch(x) else {}))
        return xp.reshape(xp.take(xp.reshape(x, (*shape[:-4], len(order))), index, axis=-1), shape)


def _taxels(ring: tuple[int, ...]) -> list[tuple[int, int, int]]:
    """Pad, row and column of each taxel of a ring."""
    return [(ring[0], row, col) for row, col in zip(ring[1::2], ring[2::2], strict=True)]
