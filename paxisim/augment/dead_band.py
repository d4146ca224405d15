"""DeadBand: small forces read as zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.constant import constant
from paxisim.augment.parameter_spec import is_torch, namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class DeadBand(Transform):
    """Readings within a band around 0 are 0: ``y = 0 for |x| < width, else x - shrink * width * sign(x)``.

    With ``shrink = 0`` the reading jumps from 0 to the full force at the edge of the band, like a noise threshold in
    electronics or firmware. With ``shrink = 1`` it rises from 0 there, like slack that must be taken up first, for
    example in a gel that sits loosely over its magnets. Values in between blend the two. The default is the threshold,
    which leaves larger forces unchanged.

    The edge is soft if noise is added before the threshold: near it some readings pass and others do not, and their
    mean rises from zero to the full force over a share ``e`` of the width on both sides::

        y = h(u) (x - shrink * width * sign(x)),  h(u) = u^2 (3 - 2 u),  u = (|x| / width - 1 + e) / 2 e in [0, 1]

    With a hard edge the gradient is 1 outside the band and 0 inside. The range is ours, 0.5 to 3 counts of 0.1 N.

    A `shear_floor` is what PaXini's GEN3 sensors show (`Firmware`): the shear of a taxel whose normal force is within
    its band is 0, and that of a loaded taxel is never smaller than the floor, with the sign of the shear. A soft edge
    also softens this step of the sign, over a share ``e`` of the floor.

    Attributes:
        width: ``(..., 3)`` half-width of the band for x, y and z (N), at the middle of a soft edge.
        shrink: ``(...)`` share of the width that is subtracted from forces outside the band, 0 to 1.
        edge: ``(...)`` half-width of the soft edge as a share of `width`, 0 to 1.
        shear_floor: ``(...)`` smallest magnitude of the shear of a loaded taxel (N); 0 for none.
    """

    stage: ClassVar[str] = "electronics"

    width: Any = parameter((0.0, 0.0, 0.0), "k", unit="N", low=0.0, typical=(0.05, 0.3))
    shrink: Any = parameter(0.0, low=0.0, high=1.0, typical=(0.0, 1.0))
    edge: Any = parameter(0.0, low=0.0, high=1.0, typical=(0.0, 0.5))
    shear_floor: Any = parameter(0.0, unit="N", low=0.0, typical=(0.0, 0.2))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        width, zero = self.broadcast_parameter("width", x), xp.zeros_like(x[..., :1, :1])
        edge, floor = (self.broadcast_parameter(name, x) for name in ("edge", "shear_floor"))
        taken, reach = self.broadcast_parameter("shrink", x) * width, edge * width
        negative, size = x < 0, xp.abs(x)
        outside = xp.where(negative, x + taken, x - taken)
        hard, soft = size >= width, reach > 0
        if is_torch(soft) or soft.any():
            # avoid dividing by 0 in the branch that is not taken: the gradient would be nan
            way = (size - (width - reach)) / (2 * xp.where(soft, reach, xp.ones_like(reach)))
            way = xp.minimum(xp.maximum(way, zero), zero + 1)
            passed = xp.where(soft, way * way * (3 - 2 * way), hard * (zero + 1))
            inward = xp.where(size < taken, zero, outside)  # a soft edge must not restore what the slack takes
            read = xp.where(soft, passed * inward, xp.where(hard, outside, zero))
        else:
            passed, read = hard * (zero + 1), xp.where(hard, outside, zero)
        if not is_torch(floor) and not floor.any():
            return read
        sign = xp.where(negative, zero - 1, zero + 1)
        softened = x / xp.where(edge * floor > 0, edge * floor, xp.ones_like(floor))
        sign = xp.where(edge > 0, xp.minimum(xp.maximum(softened, zero - 1), zero + 1), sign)
        loaded = passed[..., 2:, :, :] * xp.where(size < floor, floor * sign, x)
        is_shear = constant(_is_shear, (), x) > 0
        return xp.where(is_shear & (floor > 0), loaded, read)


def _is_shear() -> NDArray[np.floating]:
    """``(3, 1, 1)``, 1 for x and y."""
    return np.array([[[1.0]], [[1.0]], [[0.0]]])
