"""Interference: a magnetic field from outside, the same at all taxels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from paxisim.augment.parameter import parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class Interference(Transform):
    """A common field that moves with a covariate c: ``y_k(p, i) = x_k(p, i) + linear_k(p) d + quadratic_k(p) d^2``,
    where ``d = c - zeroed_at``.

    Hall sensors also feel what is not their own magnet: motors, steel, the earth, above all the other finger's magnets,
    which come nearer as the gripper closes. Its distance is large against a pitch, so that all taxels of a pad read the
    same field, as a force that is not there. The constant part is zeroed away, and is `Offset` where it is not; for
    several covariates put one transform each into the chain.

    Source: on one magnetic fingertip the pose of the finger alone moved the field by 100 uT (median), of which a
    quadratic in the joints explained 97 to 99 %. The range is ours: 0.2 to 5 counts of 0.1 N over 80 mm of opening.

    Attributes:
        linear: ``(..., pads, 3)`` newtons per unit of the covariate; pads may be 1.
        quadratic: ``(..., pads, 3)`` newtons per square of the unit of the covariate; pads may be 1.
        zeroed_at: The covariate's value at which the sensor was zeroed, so that it reads no field there.
        covariate: Name of the covariate, in SI units; an opening in m.
    """

    linear: Any = parameter(((0.0, 0.0, 0.0),), "pk", unit="N/unit", typical=(-6.0, 6.0))
    quadratic: Any = parameter(((0.0, 0.0, 0.0),), "pk", unit="N/unit^2", typical=(-75.0, 75.0))
    zeroed_at: Any = parameter(0.0, "", unit="unit")
    covariate: str = "gripper_opening"

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        c = self.fit_covariate(self.covariate, covariates, x)
        d = c - self.fit("zeroed_at", x)
        return x + d * (self.fit("linear", x) + d * self.fit("quadratic", x))
