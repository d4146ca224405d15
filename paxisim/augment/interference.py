"""Interference: an external magnetic field, nearly uniform over the taxels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.constant import constant
from paxisim.augment.modes import each_mode
from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError

_FLAT = (((0.0, 0.0, 0.0),), ((0.0, 0.0, 0.0),))


@dataclass(frozen=True, eq=False)
class Interference(Transform):
    """A field that follows a covariate: ``y_k(p, i) = x_k(p, i) + linear_k(p, i) d + quadratic_k(p, i) d^2``.

    Here d is the difference between the covariate and its value at zeroing. ``linear_k(p, i)`` is the coefficient at
    the middle of the pad plus a gradient from taxel to taxel along rows and columns; ``quadratic_k(p, i)`` likewise.

    Hall sensors also respond to fields other than their own magnet's: those of motors, steel, the earth, and above all
    the magnets of the other finger, which come closer as the gripper closes. The source is farther away than the size
    of a pad, so all taxels of a pad read nearly the same spurious force. Zeroing removes the constant part; use
    `Offset` for what remains. For several covariates, put one transform for each into the chain.

    Source: on one magnetic fingertip, the pose of the finger alone moved the field by 100 uT (median). A quadratic
    function of the joint positions explained 97 to 99 % of it. The range is ours: 0.2 to 5 counts of 0.1 N over 80 mm
    of opening.

    Attributes:
        linear: ``(..., pads, 3)`` newtons per unit of the covariate; pads may be 1.
        quadratic: ``(..., pads, 3)`` newtons per squared unit of the covariate; pads may be 1.
        linear_rise: ``(..., 2, pads, 3)`` change of `linear` from one row to the next and from one column to the next
            (newtons per unit of the covariate); pads may be 1.
        quadratic_rise: ``(..., 2, pads, 3)`` the same for `quadratic` (newtons per squared unit of the covariate).
        zeroed_at: Value of the covariate at which the sensor was zeroed and reads no field.
        covariate: Name of the covariate, in SI units; an opening in m.
    """

    linear: Any = parameter(((0.0, 0.0, 0.0),), "pk", unit="N/unit", typical=(-6.0, 6.0))
    quadratic: Any = parameter(((0.0, 0.0, 0.0),), "pk", unit="N/unit^2", typical=(-75.0, 75.0))
    linear_rise: Any = parameter(_FLAT, "mpk", unit="N/unit")
    quadratic_rise: Any = parameter(_FLAT, "mpk", unit="N/unit^2")
    zeroed_at: Any = parameter(0.0, "", unit="unit")
    covariate: str = "gripper_opening"

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        c = self.broadcast_covariate(self.covariate, covariates, x)
        d = c - self.broadcast_parameter("zeroed_at", x)
        return x + d * (self._at_taxels("linear", x) + d * self._at_taxels("quadratic", x))

    def _at_taxels(self, name: str, x: Any) -> Any:
        """Coefficients of each taxel, ``(..., pads, 3, rows, cols)``."""
        rise = self.broadcast_parameter(f"{name}_rise", each_mode(x))
        if rise.shape[-5] != 2:
            raise InvalidValueError(
                f"{self.name}: {name}_rise of shape {tuple(np.shape(getattr(self, f'{name}_rise')))} does not fit a "
                f"tensor of shape {tuple(x.shape)}: it must be (..., 2, pads, 3), along rows and along columns"
            )
        places = constant(_places, (int(x.shape[-2]), int(x.shape[-1])), x)
        return self.broadcast_parameter(name, x) + namespace(x).sum(rise * places, axis=-5)


def _places(rows: int, cols: int) -> NDArray[np.float64]:
    """Row and column of each taxel, counted from the pad's middle, ``(2, 1, 1, rows, cols)``."""
    row, col = np.meshgrid(np.arange(rows) - (rows - 1) / 2, np.arange(cols) - (cols - 1) / 2, indexing="ij")
    return np.stack([row, col])[:, None, None]
