"""DeadBand: small forces are not read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import is_torch, namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class DeadBand(Transform):
    """Readings within a band about 0 are 0: ``y = 0 for |x| < width, else x - shrink * width * sign(x)``.

    With ``shrink = 0`` the reading jumps from 0 to the full force at the edge of the band: a threshold, as electronics
    and firmware set it against noise. With ``shrink = 1`` it rises from 0 there: a slack that must be taken up first,
    as of a gel that sits loosely over its magnets. Between the two it is a blend; the default is the threshold, which
    leaves larger forces alone.

    An edge is soft where noise comes ahead of the threshold: near it some readings pass and others do not, and their
    mean rises from nothing to the whole over a share ``e`` of the width to both sides::

        y = h(u) (x - shrink * width * sign(x)),  h(u) = u^2 (3 - 2 u),  u = (|x| / width - 1 + e) / 2 e in [0, 1]

    The gradient of a hard edge is 1 outside the band and 0 inside. The range is ours, 0.5 to 3 counts of 0.1 N.

    Attributes:
        width: ``(..., 3)`` half-width of the band of x, y and z (N), at the middle of a soft edge.
        shrink: ``(...)`` share of the width that is taken off the forces outside it, 0 to 1.
        edge: ``(...)`` share of the width over which the reading sets in, to both sides, 0 to 1.
    """

    stage: ClassVar[str] = "electronics"

    width: Any = parameter((0.0, 0.0, 0.0), "k", unit="N", low=0.0, typical=(0.05, 0.3))
    shrink: Any = parameter(0.0, low=0.0, high=1.0, typical=(0.0, 1.0))
    edge: Any = parameter(0.0, low=0.0, high=1.0, typical=(0.0, 0.5))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        width, zero = self.broadcast_parameter("width", x), xp.zeros_like(x[..., :1, :1])
        taken, reach = self.broadcast_parameter("shrink", x) * width, self.broadcast_parameter("edge", x) * width
        negative, size = x < 0, xp.abs(x)
        outside = xp.where(negative, x + taken, x - taken)
        hard = xp.where(size < width, zero, outside)
        soft = reach > 0
        if not is_torch(soft) and not soft.any():
            return hard
        # no division by 0 in the branch that is not taken: it would be nan in the gradient
        way = (size - (width - reach)) / (2 * xp.where(soft, reach, xp.ones_like(reach)))
        way = xp.minimum(xp.maximum(way, zero), zero + 1)
        inward = xp.where(size < taken, zero, outside)  # what a slack takes is not given back within the edge
        return xp.where(soft, way * way * (3 - 2 * way) * inward, hard)
