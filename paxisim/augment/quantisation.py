"""Quantisation: readings are whole numbers of steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import is_torch, namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class Quantisation(Transform):
    """Readings rounded to whole steps r: ``y = r * round(x / r)``, halves to the even step; r = 0 does not round.

    The gradient with respect to x is that of the identity (straight-through estimator). The true gradient is 0 almost
    everywhere, so no transform before this one could be fitted. There is no gradient with respect to `resolution`,
    which is determined directly from the data.

    PaXini's sensors send 0.1 N per count (vendor's document).

    Attributes:
        resolution: ``(..., 3)`` step size r of x, y and z (N).
    """

    stage: ClassVar[str] = "electronics"

    resolution: Any = parameter((0.0, 0.0, 0.0), "k", unit="N", low=0.0, typical=(0.01, 0.2))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        step = self.broadcast_parameter("resolution", x)
        stepped = xp.round(x / xp.where(step > 0, step, xp.ones_like(step))) * step
        return straight_through(xp.where(step > 0, stepped, x), x)


def straight_through(y: Any, x: Any) -> Any:
    """Return the value of `y` with the gradient of `x`."""
    return y.detach() + (x - x.detach()) if is_torch(y) else y
