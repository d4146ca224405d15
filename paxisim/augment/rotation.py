"""Rotation: the sensor's frame is rotated against the pad's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from paxisim.augment.axis_coupling import mix_axes
from paxisim.augment.constant import constant
from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class Rotation(Transform):
    """Each pad's sensor is rotated in its housing and reads the force in its own frame: ``y(i) = R^T x(i)``.

    R rotates the pad frame into the sensor frame, by the angle ``|angles|`` about the axis ``angles / |angles|`` in the
    pad frame (a rotation vector, right-handed; Rodrigues' formula). A small (a, b, c) is a tilt by a about x and b
    about y and a rotation by c about z. After a rotation by +90 degrees about z, the sensor's x is the pad's y. Each
    taxel rotates in place; see `LayoutFault` for taxels that change position.

    The magnitude of the force is unchanged. The range is ours, 2 to 20 degrees about z; tilts are typically 0.5 to 5.

    Attributes:
        angles: ``(..., pads, 3)`` rotation vector of each pad's sensor (rad); pads may be 1, for all pads alike.
    """

    angles: Any = parameter(((0.0, 0.0, 0.0),), "pk", unit="rad", low=-math.pi, high=math.pi, typical=(-0.35, 0.35))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        # R^T is the rotation by the negative vector
        return mix_axes(rotation_matrix(-self.broadcast_parameter("angles", x)[..., 0, 0]), x)


def rotation_matrix(vector: Any) -> Any:
    """Convert rotation vectors ``(..., 3)`` (rad) to matrices ``(..., 3, 3)``; differentiable everywhere."""
    xp = namespace(vector)
    square = xp.sum(vector * vector, axis=-1)[..., None, None]
    small = square < 0.01
    angle = xp.sqrt(xp.where(small, xp.ones_like(square), square))
    # sin(t) / t and (1 - cos(t)) / t^2; at small t the series are exact to rounding, unlike the quotients
    sine = xp.where(small, _series(square, 6, 20, 42, 72), xp.sin(angle) / angle)
    cosine = xp.where(small, _series(square, 12, 30, 56, 90) / 2, 2 * (xp.sin(angle / 2) / angle) ** 2)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    zero = xp.zeros_like(x)
    cross = xp.reshape(xp.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1), (*x.shape, 3, 3))
    return constant(np.eye, (3,), vector) + sine * cross + cosine * (cross @ cross)


def _series(square: Any, *divisors: int) -> Any:
    """Return ``1 - s/a + s^2/(a b) - s^3/(a b c) + ...``."""
    total = 1.0
    for divisor in reversed(divisors):
        total = 1 - square / divisor * total
    return total
