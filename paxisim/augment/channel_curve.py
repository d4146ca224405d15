"""ChannelCurve: each channel responds to the load along its own curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from paxisim.augment.modes import each_mode
from paxisim.augment.parameter_spec import Parameter, as_like, check, is_torch, namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class ChannelCurve(Transform):
    """Each channel has a load-dependent reading error: a piecewise linear curve through M knots.

    The knots are M equally spaced loads from `low` to `high`; ``error_m`` is the excess reading at the m-th knot. The
    error is interpolated linearly between knots and held constant beyond the ends, so that it cannot run away outside
    the measured range. A single axis of a magnetometer bends according to where it lies in the field, one upwards,
    another downwards. A law shared by all taxels (`Stiffening`, `Saturation`) cannot express that.

    Example:
        ``ChannelCurve(error, low=0.0, high=2.0)`` with knots at 0, 1 and 2 N and errors of 0, 0.4 and 0.2 N:

        | x (N) | y (N) |
        |---|---|
        | 0 | 0 |
        | 0.5 | 0.7 |
        | 1 | 1.4 |
        | 3 | 3.2 |

    The range is ours.

    Attributes:
        error: ``(..., M, pads, 3, rows, cols)`` reading minus load at each knot (N); any of the last four may be 1.
        low: ``(...)`` load at the first knot (N).
        high: ``(...)`` load at the last knot (N), at least `low`.

    Raises:
        InvalidValueError: Also if the last knot is below the first.
    """

    error: Any = parameter((((((0.0,),),),),), "mpkrc", unit="N", typical=(-0.3, 0.3))
    low: Any = parameter(0.0, unit="N")
    high: Any = parameter(1.0, unit="N")

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        like = self.low if is_torch(self.low) else self.high if is_torch(self.high) else _NUMBER
        check("ChannelCurve", "high - low", as_like(self.high, like) - as_like(self.low, like), _WIDTH)

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        low, high = self.broadcast_parameter("low", x), self.broadcast_parameter("high", x)
        error = self.broadcast_parameter("error", each_mode(x))
        return x + xp.sum(error * hats(x, low, high, error.shape[-5]), axis=-5)


_NUMBER, _WIDTH = np.zeros(()), Parameter(unit="N", low=0.0)


def hats(x: Any, low: Any, high: Any, count: int) -> Any:
    """Interpolation weights of `count` knots at the loads `x`: ``(*batch, count, pads, 3, rows, cols)``, with sum 1."""
    xp = namespace(x)
    width = high - low
    place = (x - low) / xp.where(width > 0, width, xp.ones_like(width)) * (count - 1)
    place = each_mode(xp.clip(place, 0, count - 1))
    knots = as_like(list(range(count)), x).reshape(count, 1, 1, 1, 1)
    return xp.clip(1 - xp.abs(place - knots), 0, 1)
