"""Stiffening: a gel gives way less the more it is pressed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter import namespace, parameter
from paxisim.augment.transform import Covariates, Transform

KNEE = 0.01
"""Share of `scale` below which the response is linear; the slope of a power law at 0 is 0 or infinite."""


@dataclass(frozen=True, eq=False)
class Stiffening(Transform):
    """The reading grows as a power of the force on the taxel.

    With its length |x|::

        y = x ((|x|^2 / scale^2 + KNEE^2) / (1 + KNEE^2))^((exponent - 1) / 2)

    A magnet-based sensor measures how far its gel gives way, and a thin rubber layer stiffens as it is squeezed:
    calibrated at one load, it reads too much below and too little above it (exponent < 1); one that softens does the
    opposite. The length is that of all three components: the layer that a normal load has squeezed is the one that
    shears, so x, y and z share one gain. The direction of the force stays, as does its sign, and the reading grows with
    the force. A force of `scale` newtons reads as it is. Under ``KNEE * scale`` the gain levels off, so that it is
    finite at 0.

    The form is that of an empirical power law, as in Hertz's contact (exponent 2/3); the range is ours.

    Attributes:
        exponent: ``(...)`` the power; 1 is linear.
        scale: ``(...)`` force at which the sensor reads right (N).
    """

    stage: ClassVar[str] = "gel"

    exponent: Any = parameter(1.0, low=0.1, high=5.0, typical=(0.7, 1.5))
    scale: Any = parameter(1.0, unit="N", low=1e-3, high=1e3, typical=(0.5, 2.0))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        ratio = x / self.fit("scale", x)
        length = xp.full_like(ratio[..., :1, :, :], KNEE)  # begins above 0, where hypot has a gradient
        for axis in range(3):
            length = xp.hypot(length, ratio[..., axis : axis + 1, :, :])
        return x * (length / (1 + KNEE**2) ** 0.5) ** (self.fit("exponent", x) - 1)
