"""Gains: scale errors of the sensor, per axis and per taxel (the S of the paper's GCS)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from paxisim.augment.parameter_spec import parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class AxisGain(Transform):
    """One gain per axis, the same at every taxel: ``y_k = gain_k x_k``.

    Simulated contact forces and sensor readings differ in scale, and by different factors in shear and normal direction
    (paper, Method, "Domain Randomization of Force Scaling": alpha_k; Table I draws it from U(0.5, 1.5)).

    Attributes:
        gain: ``(..., 3)`` gains of x, y and z.
    """

    gain: Any = parameter((1.0, 1.0, 1.0), "k", low=0.0, typical=(0.5, 1.5))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        return x * self.broadcast_parameter("gain", x)


@dataclass(frozen=True, eq=False)
class PadAxisGain(Transform):
    """One gain per axis and pad, the same at every taxel of a pad: like `AxisGain`, for pads that differ.

    Attributes:
        gain: ``(..., pads, 3)`` gains of x, y and z.
    """

    gain: Any = parameter(((1.0, 1.0, 1.0),), "pk", low=0.0, typical=(0.5, 1.5))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        return x * self.broadcast_parameter("gain", x)


@dataclass(frozen=True, eq=False)
class TaxelGain(Transform):
    """One gain per taxel, the same on its three axes: ``y(i,j) = gain(i,j) x(i,j)``.

    No two magnets are placed identically (paper, Method, "Domain Randomization of Force Scaling": beta_ij; Table I
    draws it from N(1, 0.25) with 20 % dropout). A gain of 0 is a dropped taxel.

    Attributes:
        gain: ``(..., pads, rows, cols)`` gains.
    """

    gain: Any = parameter(((((1.0,),),)), "prc", low=0.0, typical=(0.25, 1.75))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        return x * self.broadcast_parameter("gain", x)
