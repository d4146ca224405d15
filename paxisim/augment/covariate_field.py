"""CovariateField: a zero offset of each taxel that follows recorded covariates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from paxisim.augment.modes import each_mode
from paxisim.augment.parameter_spec import as_like, namespace, parameter
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError

_NONE = (((((0.0,),),),),) * 2


@dataclass(frozen=True, eq=False)
class CovariateField(Transform):
    """A zero that follows the pose: ``y_i = x_i + sum_m linear_im u_m + quadratic_im (u_m^2 - 1)``.

    The u are projections of the covariates, ``u = directions (c - middle)``: for one covariate its distance from the
    middle in standard deviations, for many joints their principal components. Each channel has its own coefficients.

    `Interference` models the same effect for one covariate and a field that is nearly uniform over the taxels, with
    parameters that can be set by hand. This transform is meant to be fitted: by the diagnosis, or by least squares to
    readings without contact.

    Source: on one magnetic fingertip, the pose of the finger alone moved the field by 100 uT (median). A quadratic
    function of the joint positions explained 97 to 99 % of it.

    Attributes:
        amounts: ``(..., 2 directions, pads, 3, rows, cols)`` coefficients (N), first the linear, then the quadratic.
        covariates: Names of the covariates, each with one number per frame.
        middle: Value of each covariate at the middle.
        directions: ``(directions, covariates)`` weight of each covariate in each direction, in 1 over its unit.
    """

    amounts: Any = parameter(_NONE, "mpkrc", unit="N", typical=(-0.3, 0.3))
    covariates: tuple[str, ...] = ("gripper_opening",)
    middle: tuple[float, ...] = (0.0,)
    directions: tuple[tuple[float, ...], ...] = ((1.0,),)

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        count = len(self.covariates)
        if not count or len(self.middle) != count or {len(row) for row in self.directions} != {count}:
            raise InvalidValueError(
                f"CovariateField: middle and each direction must have one number for each of {count} covariates, got "
                f"{len(self.middle)} in middle and {[len(row) for row in self.directions]} in directions"
            )
        modes = np.shape(self.amounts)[-5]
        if modes != 2 * len(self.directions):
            raise InvalidValueError(
                f"CovariateField: amounts must be (..., {2 * len(self.directions)}, pads, 3, rows, cols) for "
                f"{len(self.directions)} directions, got {modes} modes"
            )

    @property
    def covariate_names(self) -> tuple[str, ...]:
        """Names of the covariates it needs."""
        return self.covariates

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        lifted = [
            self.broadcast_covariate(n, covariates, x) - m for n, m in zip(self.covariates, self.middle, strict=True)
        ]
        away = xp.stack([one[..., 0, 0, 0, 0] for one in xp.broadcast_arrays(*lifted)], axis=-1)
        u = away @ as_like(np.asarray(self.directions).T, x)
        modes = xp.concat([u, u * u - 1], axis=-1)
        amounts = self.broadcast_parameter("amounts", each_mode(x))
        if amounts.ndim > 5:  # each member of the batch has its own
            return x + xp.sum(modes[..., None, None, None, None] * amounts, axis=-5)
        amounts = xp.broadcast_to(amounts, (amounts.shape[0], *x.shape[-4:]))
        added = modes @ xp.reshape(amounts, (amounts.shape[0], -1))
        return x + xp.reshape(added, (*added.shape[:-1], *x.shape[-4:]))
