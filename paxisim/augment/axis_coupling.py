"""AxisCoupling: a force along one axis is read on the others too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from paxisim.augment.parameter_spec import as_like, namespace, parameter
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class AxisCoupling(Transform):
    """A 3x3 matrix that mixes the axes of each taxel: ``y_k(i) = sum_j matrix_kj x_j(i)``.

    A magnet that tilts as it sinks, and a Hall sensor that is not square to it, read normal force as shear. The matrix
    is the same at every taxel. Its diagonal is a gain: keep it at 1 where an `AxisGain` is in the chain.

    Source: uSkin-class sensors are calibrated with such a matrix. The range is ours, 2 to 20 % off the diagonal.

    Attributes:
        matrix: ``(..., 3, 3)``, rows are the axes that are read, columns those of the force.
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
    """``(*batch, pads or 1, 3, 3)`` times the forces of ``(*batch, pads, 3, rows, cols)``."""
    xp = namespace(x)
    rows, cols = x.shape[-2:]
    mixed = matrix @ xp.reshape(x, (*x.shape[:-2], rows * cols))
    return xp.reshape(mixed, (*mixed.shape[:-1], rows, cols))
