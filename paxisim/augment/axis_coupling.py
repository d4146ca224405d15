"""AxisCoupling: a force along one axis also shows up on the others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from paxisim.augment.parameter_spec import as_like, namespace, parameter
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class AxisCoupling(Transform):
    """A 3x3 matrix that mixes the axes of each taxel: ``y_k(i) = sum_j matrix_kj x_j(i)``.

    A magnet that tilts as it sinks, or a Hall sensor that is not square to it, reads normal force as shear. The matrix
    is the same at every taxel. Its diagonal is a gain: keep it at 1 if the chain contains an `AxisGain`.

    Source: uSkin-class sensors are calibrated with such a matrix. The range, 2 to 20 % off the diagonal, is ours.

    Attributes:
        matrix: ``(..., 3, 3)`` matrix; rows are the axes of the reading, columns those of the force.
    """

    matrix: Any = parameter(
        ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), "kj", low=-10.0, high=10.0, typical=(-0.2, 0.2)
    )

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        matrix = as_like(self.matrix, x)
        for ours, theirs in zip(matrix.shape[-3::-1], x.shape[-5::-1], strict=False):
            if ours != theirs and 1 not in (ours, theirs):
                raise InvalidValueError(
                    f"AxisCoupling: matrix of shape {tuple(matrix.shape)} does not fit a tensor of shape "
                    f"{tuple(x.shape)}"
                )
        return mix_axes(matrix[..., None, :, :], x)


def mix_axes(matrix: Any, x: Any) -> Any:
    """Multiply forces ``(*batch, pads, 3, rows, cols)`` by matrices ``(*batch, pads or 1, 3, 3)``."""
    xp = namespace(x)
    rows, cols = x.shape[-2:]
    mixed = matrix @ xp.reshape(x, (*x.shape[:-2], rows * cols))
    return xp.reshape(mixed, (*mixed.shape[:-1], rows, cols))
