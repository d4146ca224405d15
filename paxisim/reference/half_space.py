"""Half-space: motion of an infinitely deep elastic body under forces on its surface.

Frame: x and y on the surface, z into the body. Sources: J. Boussinesq (1885) for a normal and V. Cerruti (1882) for a
tangential point force, as in K. L. Johnson, Contact Mechanics (1985), chapter 3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

QUADRATURE_POINTS = 8
"""Quadrature points along each side of a loaded rectangle."""
_STEP = 1e-4  # step of the derivatives for the rotation, as a share of the depth


def half_space_response(
    offsets: FloatArray, depth: float, modulus: float, poisson: float, pitch: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Return displacement and rotation inside a half-space per newton, spread evenly over one taxel's rectangle.

    Args:
        offsets: ``(n, 2)`` points, x and y from the centre of the rectangle (m).
        depth: Depth of the points below the surface (m), more than 0.
        modulus: Young's modulus (Pa).
        poisson: Poisson's ratio, 0 to 0.5.
        pitch: Size of the rectangle along y and along x (m).

    Returns:
        ``(n, 3, 3)`` displacement (m/N): [point, direction of the displacement, direction of the force]; and
        ``(n, 3, 3)`` rotation (rad/N): [point, axis, direction of the force], half the curl of the displacement.
    """
    nodes, weights = np.polynomial.legendre.leggauss(QUADRATURE_POINTS)
    height, width = pitch
    x, y = (part.ravel() for part in np.meshgrid(0.5 * width * nodes, 0.5 * height * nodes))
    weight = np.outer(weights, weights).ravel() / 4
    from_points = np.asarray(offsets, dtype=np.float64)[:, None, :] - np.stack([x, y], axis=-1)
    step = _STEP * depth

    def moved(shift: FloatArray) -> FloatArray:
        at = np.concatenate([from_points, np.full((*from_points.shape[:2], 1), depth)], axis=-1) + shift
        return np.einsum("nqij,q->nij", point_response(at, modulus, poisson), weight)

    # [point, derivative along, displacement, force]
    slopes = np.stack([(moved(step * axis) - moved(-step * axis)) / (2 * step) for axis in np.eye(3)], axis=1)
    curl = np.stack(
        [
            slopes[:, 1, 2] - slopes[:, 2, 1],
            slopes[:, 2, 0] - slopes[:, 0, 2],
            slopes[:, 0, 1] - slopes[:, 1, 0],
        ],
        axis=1,
    )
    return moved(np.zeros(3)), 0.5 * curl


def point_response(at: FloatArray, modulus: float, poisson: float) -> FloatArray:
    """Return the displacement (m/N) at ``(..., 3)`` from a point force (m), ``(..., 3, 3)``: [displacement, force]."""
    x, y, z = np.moveaxis(at, -1, 0)
    r = np.sqrt(x * x + y * y + z * z)
    shear = modulus / (2 * (1 + poisson))
    free, near = 1 - 2 * poisson, r * (r + z)
    out = np.empty((*at.shape[:-1], 3, 3))
    for k, (along, across) in enumerate(((x, y), (y, x))):  # Cerruti
        out[..., k, k] = 1 / r + along**2 / r**3 + free * (1 / (r + z) - along**2 / (near * (r + z)))
        out[..., 1 - k, k] = along * across / r**3 - free * along * across / (near * (r + z))
        out[..., 2, k] = along * z / r**3 + free * along / near
    out[..., 0, 2] = x * z / r**3 - free * x / near  # Boussinesq
    out[..., 1, 2] = y * z / r**3 - free * y / near
    out[..., 2, 2] = z**2 / r**3 + 2 * (1 - poisson) / r
    return out / (4 * np.pi * shear)
