"""DeadBand: small forces are not read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter import namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class DeadBand(Transform):
    """Readings within a band about 0 are 0: ``y = 0 for |x| < width, else x - shrink * width * sign(x)``.

    With ``shrink = 0`` the reading jumps from 0 to the full force at the edge of the band: a threshold, as electronics
    and firmware set it against noise. With ``shrink = 1`` it rises from 0 there: a slack that must be taken up first,
    as of a gel that sits loosely over its magnets. Between the two it is a blend; the default is the threshold, which
    leaves larger forces alone.

    The gradient is 1 outside the band and 0 inside. The range is ours, 0.5 to 3 counts of 0.1 N.

    Attributes:
        width: ``(..., 3)`` half-width of the band of x, y and z (N).
        shrink: ``(...)`` share of the width that is taken off the forces outside it, 0 to 1.
    """

    stage: ClassVar[str] = "electronics"

    width: Any = parameter((0.0, 0.0, 0.0), "k", unit="N", low=0.0, typical=(0.05, 0.3))
    shrink: Any = parameter(0.0, low=0.0, high=1.0, typical=(0.0, 1.0))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        width = self.fit("width", x)
        taken = self.fit("shrink", x) * width
        read = xp.where(x < 0, x + taken, x - taken)
        return xp.where(xp.abs(x) < width, xp.zeros_like(read), read)
