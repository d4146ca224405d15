"""CovariateField: a reading without force that follows recorded covariates, by taxel."""

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

    The u are directions of the covariates, ``u = directions (c - middle)``: with one covariate its distance from the
    middle in standard deviations, with many joints their principal components. Each channel has its own amounts.

    `Interference` is the same for one covariate and a field that is nearly the same at all taxels, in units that can be
    written down by hand. This one is fitted: by the diagnosis, or by least squares on readings without contact.

    Source: on one magnetic fingertip the pose of the finger alone moved the field by 100 uT (median), of which a
    quadratic in the joints explained 97 to 99 %.

    Attributes:
        amounts: ``(..., 2 directions, pads, 3, rows, cols)`` N, the linear ones first, then the quadratic ones.
        covariates: Names of the covariates, of one number a frame each.
        middle: Value of each covariate at the middle.
        directions: ``(directions, covariates)`` what each direction takes of each covariate, in 1 over its unit.
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
                f"CovariateField: middle and each direction must have a number for each of the {count} covariates, got "
                f"{len(self.middle)} in middle and {[len(row) for row in self.directions]} in directions"
            )
        modes = np.shape(self.amounts)[-5]
        if modes != 2 * len(self.directions):
            raise InvalidValueError(
                f"CovariateField: amounts must be (..., {2 * len(self.directions)}, pads, 3, rows, cols) for "
                f"{len(self.directions)} directions, got {modes} in place of the first"
            )

    @property
    def covariate_names(self) -> tuple[str, ...]:
        """The covariates it needs."""
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
        if amounts.ndim > 5:  # of each member of a batch
            return x + xp.sum(modes[..., None, None, None, None] * amounts, axis=-5)
        amounts = xp.broadcast_to(amounts, (amounts.shape[0], *x.shape[-4:]))
        added = modes @ xp.reshape(amounts, (amounts.shape[0], -1))
        return x + xp.reshape(added, (*added.shape[:-1], *x.shape[-4:]))
