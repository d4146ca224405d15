"""Saturation: a sensor's reading stops increasing beyond its range."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class Saturation(Transform):
    """The reading levels off at a limit, abruptly or over a knee.

    For a force x > 0, with the limit L and the softness s::

        y = x                                           x <= K = (1 - s) L
        y = K + s L tanh((x - K) / (s L))               x > K, s > 0
        y = L                                           x > L, s = 0

    and likewise below 0. The slope is continuous at a soft knee; s = 1 gives ``L tanh(x / L)``, s = 0 a hard clip. The
    reading never exceeds the limit. An amplifier clips hard; a Hall sensor, or a magnet at the end of its travel, clips
    softly.

    The lower limit is at most 0 and the upper at least 0. A limit of 0 suppresses all forces of that sign, like a uint8
    normal force. The range is ours: 40 to 95 % of the peak measured force, here 10 N.

    Attributes:
        limit_low: ``(..., 3)`` lowest reading of x, y and z (N), 0 or negative; may be -inf.
        limit_high: ``(..., 3)`` highest reading of x, y and z (N), 0 or positive; may be inf.
        softness: ``(...)`` share of the limit over which the knee extends, 0 to 1.
    """

    limit_low: Any = parameter((-math.inf,) * 3, "k", unit="N", high=0.0, typical=(-9.5, -4.0), infinite=True)
    limit_high: Any = parameter((math.inf,) * 3, "k", unit="N", low=0.0, typical=(4.0, 9.5), infinite=True)
    softness: Any = parameter(0.0, low=0.0, high=1.0, typical=(0.0, 1.0))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        sign = xp.where(x < 0, -xp.ones_like(x), xp.ones_like(x))
        limit = xp.where(x < 0, -self.broadcast_parameter("limit_low", x), self.broadcast_parameter("limit_high", x))
        clipped = xp.minimum(sign * x, limit)
        # remove infinities: they would make the gradient of the branch that is not taken nan
        finite = xp.where(xp.isfinite(limit), limit, xp.zeros_like(limit))
        width = self.broadcast_parameter("softness", x) * finite
        knee = finite - width
        excess = sign * x - knee
        soft = (excess > 0) & (width > 0)
        # at 40 widths tanh equals 1 to rounding
        turns = xp.minimum(xp.where(soft, excess, 0 * width), 40 * width) / xp.where(soft, width, xp.ones_like(width))
        bent = knee + width * xp.tanh(turns)
        return sign * xp.where(soft, xp.minimum(bent, limit), clipped)
