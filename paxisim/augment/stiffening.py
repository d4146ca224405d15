"""Stiffening: a gel becomes stiffer under load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class Stiffening(Transform):
    """The reading grows as a power of the force on the taxel.

    With the magnitude |x| of the force::

        y = x ((|x|^2 / scale^2 + knee^2) / (1 + knee^2))^((exponent - 1) / 2)

    A magnet-based sensor measures the deflection of its gel, and a thin rubber layer stiffens as it is squeezed.
    Calibrated at one load, such a sensor reads too high below and too low above it (exponent < 1); a softening one does
    the opposite. The magnitude includes all three components, because the layer squeezed by a normal load is also the
    one that shears: x, y and z share one gain and the direction of the force is preserved. If the readout is nonlinear
    instead, each axis bends independently: ``shared`` multiplies the squares of the other two axes in the magnitude.
    The reading increases monotonically with the force. A force of `scale` newtons is read correctly. Below ``knee *
    scale`` the gain levels off, so it is finite at 0. With a knee of 1 or more the gain varies with the square of the
    force up to there.

    The form is an empirical power law, as in Hertz's contact (exponent 2/3); the range is ours.

    Attributes:
        exponent: ``(...)`` exponent of the power law; 1 is linear.
        scale: ``(...)`` force at which the reading is correct (N).
        knee: ``(...)`` share of `scale` below which the response is linear.
        shared: ``(...)`` 1 if the gain of an axis depends on the whole force, 0 if only on its own component.
    """

    stage: ClassVar[str] = "gel"

    exponent: Any = parameter(1.0, low=0.1, high=5.0, typical=(0.7, 1.5))
    scale: Any = parameter(1.0, unit="N", low=1e-3, high=1e3, typical=(0.5, 2.0))
    knee: Any = parameter(0.01, low=1e-3, high=100.0, typical=(0.01, 1.0))
    shared: Any = parameter(1.0, low=0.0, high=1.0, typical=(0.0, 1.0))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        ratio, knee, shared = (
            x / self.broadcast_parameter("scale", x),
            self.broadcast_parameter("knee", x),
            self.broadcast_parameter("shared", x),
        )
        own = ratio**2
        square = knee**2 + shared * xp.sum(own, axis=-3, keepdims=True) + (1 - shared) * own  # above 0, for the root
        return x * (square / (1 + knee**2)) ** ((self.broadcast_parameter("exponent", x) - 1) / 2)
