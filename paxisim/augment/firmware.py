"""Firmware: what a PaXini sensor's own processor makes of the forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.constant import constant
from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.quantisation import straight_through
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class Firmware(Transform):
    """Forces as a PaXini sensor sends them: whole counts of 0.1 N, small ones 0, clipped to one byte each.

    1. Counts: ``n = round(x / resolution)``, halves to even.
    2. Gate: ``n = 0`` where ``|n| < gate_counts``, for each component by itself.
    3. Clip: shear to ``[-shear_counts, shear_counts - 1]`` (int8), normal force to ``[0, normal_counts]`` (uint8): a
       normal force cannot be negative.
    4. ``y = n resolution``.

    Unlike the other transforms it is **not** the identity by default, but the real one; a `resolution` near 0 with high
    counts and no gate comes close to it. The gradient passes straight through steps and gate, and not through the clip.

    Source: steps and bytes are common to all documented PaXini protocols. The gate is seen in captures of real GEN3
    sensors, where a component is 0 or at least 2 counts; whether GEN1 does the same is unknown, ``gate_counts=0``
    switches it off. Their resultant, which is not the sum of the taxels, and taxels that drop out or linger for a frame
    are not in it.

    Attributes:
        resolution: ``(...)`` newtons a count.
        shear_counts: ``(...)`` counts down to which shear is read; up to one less.
        normal_counts: ``(...)`` counts up to which normal force is read.
        gate_counts: ``(...)`` least number of counts that is not taken for 0.
    """

    stage: ClassVar[str] = "firmware"

    resolution: Any = parameter(0.1, unit="N", low=1e-6, high=10.0, typical=(0.1, 0.1))
    shear_counts: Any = parameter(128.0, unit="counts", low=1.0, typical=(128.0, 128.0), whole=True)
    normal_counts: Any = parameter(255.0, unit="counts", low=1.0, typical=(255.0, 255.0), whole=True)
    gate_counts: Any = parameter(2.0, unit="counts", low=0.0, typical=(0.0, 3.0), whole=True)

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        step = self.broadcast_parameter("resolution", x)
        is_normal = constant(_is_normal, (), x) > 0
        shear = self.broadcast_parameter("shear_counts", x)
        least = xp.where(is_normal, xp.zeros_like(shear), -shear)
        most = xp.where(is_normal, self.broadcast_parameter("normal_counts", x), shear - 1)
        counts = xp.round(x / step)
        counts = xp.where(xp.abs(counts) < self.broadcast_parameter("gate_counts", x), xp.zeros_like(counts), counts)
        y = xp.minimum(xp.maximum(counts, least), most) * step
        return straight_through(y, xp.minimum(xp.maximum(x, least * step), most * step))


def _is_normal() -> NDArray[np.floating]:
    """``(3, 1, 1)``, 1 for z."""
    return np.array([[[0.0]], [[0.0]], [[1.0]]])
