"""Firmware: how a PaXini sensor's processor encodes the forces."""

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
    """Forces as a PaXini sensor sends them: whole counts of 0.1 N, small ones set to 0, clipped to one byte each.

    1. Counts: ``n = round(x / resolution)``, halves to even.
    2. Gate: ``n = 0`` where ``|n| < gate_counts``, for each component separately.
    3. Floor of the shear, off by default: where the normal count is 0, the taxel is off and its shear is 0; elsewhere
       shear below `shear_floor_counts` has this magnitude, with the sign of the force (+ for none).
    4. Clip: shear to ``[-shear_counts, shear_counts - 1]`` (int8), normal force to ``[0, normal_counts]`` (uint8), so
       normal force cannot be negative.
    5. ``y = n resolution``.

    Unlike the other transforms, it is **not** the identity by default, but matches the real firmware. A `resolution`
    near 0 with high counts and no gate approximates the identity. The gradient passes straight through rounding,
    gate and floor, but not through the clip.

    Source: step size and byte ranges are common to all documented PaXini protocols. The gate appears in captures of
    real GEN3 sensors, where a component is either 0 or at least 2 counts. Whether GEN1 has it is unknown;
    ``gate_counts=0`` switches it off. In a press of a real GEN3 S1813E, x and y of a taxel that is on are
    never below 2 counts, as with ``shear_floor_counts=2``; which sign a shear of 0 gets is not known. Not modelled are
    the sensors' resultant, which is not the sum of the taxels, and taxels that drop out or persist for a frame.

    Attributes:
        resolution: ``(...)`` newtons per count.
        shear_counts: ``(...)`` magnitude of the lowest shear reading, in counts; the highest is one count less.
        normal_counts: ``(...)`` highest normal force reading, in counts.
        gate_counts: ``(...)`` smallest magnitude that is not set to 0, in counts.
        shear_floor_counts: ``(...)`` smallest magnitude of the shear of a taxel that is on, in counts; 0 for none.
    """

    stage: ClassVar[str] = "firmware"

    resolution: Any = parameter(0.1, unit="N", low=1e-6, high=10.0, typical=(0.1, 0.1))
    shear_counts: Any = parameter(128.0, unit="counts", low=1.0, typical=(128.0, 128.0), whole=True)
    normal_counts: Any = parameter(255.0, unit="counts", low=1.0, typical=(255.0, 255.0), whole=True)
    gate_counts: Any = parameter(2.0, unit="counts", low=0.0, typical=(0.0, 3.0), whole=True)
    shear_floor_counts: Any = parameter(0.0, unit="counts", low=0.0, typical=(0.0, 2.0), whole=True)

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
        floor = self.broadcast_parameter("shear_floor_counts", x)
        is_on = counts[..., 2:, :, :] > 0
        raised = xp.where(xp.abs(counts) < floor, xp.where(x < 0, -floor, floor), counts)
        floored = xp.where(is_on, raised, xp.zeros_like(counts))
        counts = xp.where(is_normal | (floor == 0), counts, floored)
        y = xp.minimum(xp.maximum(counts, least), most) * step
        return straight_through(y, xp.minimum(xp.maximum(x, least * step), most * step))


def _is_normal() -> NDArray[np.floating]:
    """``(3, 1, 1)``, 1 for z."""
    return np.array([[[0.0]], [[0.0]], [[1.0]]])
