"""Offset: the sensor reads a constant force without load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class Offset(Transform):
    """A constant added to every reading: ``y = x + value``.

    It models a residual zero error: the pad was zeroed under load, or its field has changed since. The range is ours:
    0.2 to 3 counts of a sensor with 0.1 N per count.

    Attributes:
        value: ``(..., pads, 3, rows, cols)`` reading without load (N); any of the four dimensions may be 1.
    """

    stage: ClassVar[str] = "electronics"

    value: Any = parameter(((((0.0,),),),), "pkrc", unit="N", typical=(-0.3, 0.3))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        return x + self.broadcast_parameter("value", x)
