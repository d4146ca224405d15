"""Displacement and rotation inside a soft layer on a rigid base, under a load on its surface.

The layer is linear elastic, isotropic, of constant thickness and infinite in x and y. It is bonded to its base, or, for
normal loads, lies on a smooth one. A Fourier transform over the
surface (Sneddon, *Fourier Transforms*, 1951; Johnson, *Contact Mechanics*, 1985, for layers) leaves, for every
wavenumber k, ordinary differential equations over the depth z. They separate into motion in the plane of the wave and
the depth, and motion across it. Both have closed-form solutions: exponentials that decay from the surface, and
exponentials that decay from the base. Hence nothing overflows if k times the thickness is large. No term divides by
1 - 2 nu, so a nearly incompressible layer is not a special case.
"""

from __future__ import annotations

import numbers
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError

MAX_POISSON = 0.495
"""Largest Poisson's ratio. Closer to 0.5, the load spreads much further than the thickness of the layer."""
MAX_PITCHES = 100
"""Largest distance of a point from the load, in pitches; the computing time grows with its square."""

_Array = NDArray[np.float64]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_PHASE = 24.0  # rad, largest phase change of a wave within a panel of 16 nodes
_WAVES = 16.0  # per side of the rectangle; shorter waves are cut off
_DECAY = 25.0  # waves that decay by more than exp(-25) down to the depth are left out


def layer_response(
    offsets: ArrayLike, depth: float, thickness: float, modulus: float, poisson: float, pitch: tuple[float, float]
) -> tuple[_Array, _Array]:
    """Return displacement and rotation inside the layer per newton, spread evenly over one taxel's rectangle.

    The frame is that of the pad: x right, y down the pad, z into it; a force along +z pushes into the pad.

    The waves are summed by Gauss quadrature, so the load has no periodic copies. The error is about 1e-6 of the largest
    value. Waves shorter than a sixteenth of the rectangle are left out, which blurs the edge of the load. From a depth
    of a tenth of a side, this changes the response by at most 1e-3 of its largest value; from a quarter of a side, by
    at most 1e-5. At the surface, it changes the displacement at the edge by 0.01, or by 0.02 in a layer thinner than a
    third of a side. The rotation, which diverges at the edge, stays finite there.

    480 scattered points of a 12x10 pad take half a second at the surface; points on a grid or deeper points take less.
    The layer is bonded to its base: a layer that slides on it cannot hold a shear force.

    Args:
        offsets: ``(n, 2)`` points, x and y from the centre of the loaded rectangle (m).
        depth: Depth of the points below the surface (m), from 0 to below `thickness`.
        thickness: Thickness of the layer (m).
        modulus: Young's modulus (Pa).
        poisson: Poisson's ratio, 0 to `MAX_POISSON`.
        pitch: Size of the rectangle (m), (along y, along x) as in `TaxelLayout`.

    Returns:
        The displacement (m/N), ``(n, 3, 3)``: point, direction of the displacement, direction of the force; and the
        rotation (rad/N), ``(n, 3, 3)``: point, axis, direction of the force. The rotation is half the curl of the
        displacement.

    Raises:
        InvalidValueError: A value is outside its range, or an offset is larger than `MAX_PITCHES`.
    """
    points, sides = _checked(offsets, depth, thickness, modulus, poisson, pitch)
    kx, x_waves, at_x = _waves(points[:, 0], sides[0], depth, thickness)
    ky, y_waves, at_y = _waves(points[:, 1], sides[1], depth, thickness)
    response = np.zeros((2, len(points), 3, 3))
    for start in range(0, len(ky), len(_NODES)):  # a few rows at a time: the whole plane may not fit in memory
        part = slice(start, start + len(_NODES))
        for (kind, i, j), odd_x, odd_y, spectrum in _components(kx[:, None], ky[part], depth, thickness, poisson):
            over_x = (x_waves[odd_x] @ spectrum)[at_x]
            response[kind, :, i, j] += np.sum(over_x * y_waves[odd_y][at_y, part], axis=1)
    response[0, :, 1, 0] = response[0, :, 0, 1]
    response /= modulus / (2 * (1 + poisson))
    return response[0], response[1]


def surface_deflection(
    offsets: ArrayLike,
    thickness: float,
    modulus: float,
    poisson: float,
    pitch: tuple[float, float],
    *,
    bonded: bool = True,
) -> _Array:
    """Return how far the surface sinks under a normal force of 1 N, spread evenly over one rectangle.

    The depth is the mean over a rectangle of the same size at each offset. So the work of one load on the deflection of
    another is exact, the matrix between the cells of a grid is symmetric and positive, and the edge of the load, where
    waves are cut off, does not matter.

    Args:
        offsets: ``(n, 2)`` points, x and y from the centre of the loaded rectangle (m).
        thickness: Thickness of the layer (m).
        modulus: Young's modulus (Pa).
        poisson: Poisson's ratio, 0 to `MAX_POISSON`.
        pitch: Size of the rectangles (m), (along y, along x) as in `TaxelLayout`.
        bonded: Whether the layer is bonded to its base; otherwise it slides on it without friction.

    Returns:
        ``(n,)`` depth (m/N), positive into the pad.

    Raises:
        InvalidValueError: A value is outside its range, or an offset is larger than `MAX_PITCHES`.
    """
    points, sides = _checked(offsets, 0.0, thickness, modulus, poisson, pitch)
    kx, (x_waves, _), at_x = _waves(points[:, 0], sides[0], 0.0, thickness)
    ky, (y_waves, _), at_y = _waves(points[:, 1], sides[1], 0.0, thickness)
    x_waves, y_waves = x_waves * np.sinc(kx * sides[0] / (2 * np.pi)), y_waves * np.sinc(ky * sides[1] / (2 * np.pi))
    deflection = np.zeros(len(points))
    for start in range(0, len(ky), len(_NODES)):
        part = slice(start, start + len(_NODES))
        push, _ = _in_plane(np.hypot(kx[:, None], ky[part]), 0.0, thickness, poisson, bonded)
        deflection += np.sum((x_waves @ push.down)[at_x] * y_waves[at_y, part], axis=1)
    return deflection / (modulus / (2 * (1 + poisson)))


def _checked(
    offsets: ArrayLike, depth: float, thickness: float, modulus: float, poisson: float, pitch: tuple[float, float]
) -> tuple[_Array, _Array]:
    """Check all values, and return the offsets and the sides of the rectangle along x and y."""
    try:
        points, sides = np.asarray(offsets, dtype=float), np.array([pitch[1], pitch[0]], dtype=float)
    except (TypeError, ValueError, IndexError):
        raise InvalidValueError("offsets must be (n, 2) lengths and pitch two lengths, in m") from None
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise InvalidValueError(f"offsets must be (n, 2) finite lengths in m, got shape {points.shape}")
    if len(pitch) != 2 or not (np.isfinite(sides).all() and (sides > 0).all()):
        raise InvalidValueError(f"pitch must be two positive finite lengths in m, got {pitch!r}")
    for name, value in (("depth", depth), ("thickness", thickness), ("modulus", modulus), ("poisson", poisson)):
        if not isinstance(value, numbers.Real):
            raise InvalidValueError(f"{name} must be a number, got {value!r}")
    for name, value in (("thickness", thickness), ("modulus", modulus)):
        if not 0 < value < np.inf:
            raise InvalidValueError(f"{name} must be positive and finite, got {value!r}")
    if not 0 <= depth < thickness:
        raise InvalidValueError(f"depth must be from 0 to below the thickness, {thickness!r} m, got {depth!r}")
    if not 0 <= poisson <= MAX_POISSON:
        raise InvalidValueError(f"poisson must be from 0 to {MAX_POISSON}, got {poisson!r}")
    if np.any(np.abs(points) > MAX_PITCHES * sides):
        raise InvalidValueError(f"offsets must be within {MAX_PITCHES} pitches of the load; leave out those beyond")
    return points, sides


def _waves(
    places: _Array, side: float, depth: float, thickness: float
) -> tuple[_Array, tuple[_Array, _Array], NDArray[np.intp]]:
    """Return wavenumbers along one axis, the load's waves at the distinct places, and the index of each place.

    The panels of the quadrature start as narrow as the layer's response requires, and double up to the width that the
    waves allow. The cosine and sine waves include the weights of the quadrature.
    """
    limit = 2 * np.pi * _WAVES / side
    last = min(limit, _DECAY / depth) if depth else limit
    widest = _PHASE / (np.max(np.abs(places), initial=0.0) + side / 2)
    edges = [0.0, min(1 / thickness, widest, last)]
    while edges[-1] < last:
        edges.append(min(edges[-1] + min(edges[-1], widest), last))
    start, width = np.array(edges[:-1])[:, None], np.diff(edges)[:, None]
    k = (start + width * (1 + _NODES) / 2).ravel()
    load = (width * _WEIGHTS / 2).ravel() / np.pi
    load *= np.sinc(k * side / (2 * np.pi)) * np.exp(-36 * (k / limit) ** 8)
    distinct, which = np.unique(places, return_inverse=True)
    phase = distinct[:, None] * k
    return k, (np.cos(phase) * load, np.sin(phase) * load), which.ravel()


def _components(
    kx: _Array, ky: _Array, depth: float, thickness: float, poisson: float
) -> list[tuple[tuple[int, int, int], bool, bool, _Array]]:
    """Return the spectra of the nonzero components, for a shear modulus of 1, with their symmetry.

    Each item is (component, odd in x, odd in y, values). A component is (0 for displacement or 1 for rotation, its
    direction or axis, direction of the force). Displacement along y due to a force along x is left out, since it equals
    displacement along x due to a force along y.
    """
    k = np.hypot(kx, ky)
    x, y = kx / k, ky / k
    push, drag = _in_plane(k, depth, thickness, poisson)
    across, slope = _across(k, depth, thickness)
    return [
        ((0, 0, 0), False, False, x * x * drag.along + y * y * across),
        ((0, 1, 1), False, False, y * y * drag.along + x * x * across),
        ((0, 0, 1), True, True, x * y * (across - drag.along)),
        ((0, 0, 2), True, False, -x * push.along),
        ((0, 1, 2), False, True, -y * push.along),
        ((0, 2, 0), True, False, x * drag.down),
        ((0, 2, 1), False, True, y * drag.down),
        ((0, 2, 2), False, False, push.down),
        ((1, 0, 0), True, True, x * y * (drag.turn - slope / 2)),
        ((1, 0, 1), False, False, -y * y * drag.turn - x * x * slope / 2),
        ((1, 1, 0), False, False, x * x * drag.turn + y * y * slope / 2),
        ((1, 1, 1), True, True, x * y * (slope / 2 - drag.turn)),
        ((1, 0, 2), False, True, y * push.turn),
        ((1, 1, 2), True, False, -x * push.turn),
        ((1, 2, 0), False, True, ky * across / 2),
        ((1, 2, 1), True, False, -kx * across / 2),
    ]


class _Motion(NamedTuple):
    """Amplitudes in the plane of a wave and the depth: i `along` the wave, `down`, i `turn` about the third axis."""

    along: _Array
    down: _Array
    turn: _Array


def _in_plane(
    k: _Array, depth: float, thickness: float, poisson: float, bonded: bool = True
) -> tuple[_Motion, _Motion]:
    """Return the motion under a pressure of amplitude 1 and under a shear traction of amplitude i along the wave.

    The shear modulus is 1. With s = thickness - z, the displacement is a sum of four solutions of Navier's equations::

        along:  (a + b k z) exp(-k z)            + (c + d k s) exp(-k s)
        down:  -(a + b (q + k z)) exp(-k z)      + (c + d (q + k s)) exp(-k s)      q = 3 - 4 nu

    Both are zero at a bonded base, which gives c and d from a and b. A smooth base is like the middle of a layer of
    twice the thickness with the same load on both faces: there the second pair mirrors the first. The tractions at the
    surface then give a and b.
    """
    q, n, m = 3 - 4 * poisson, 2 - 2 * poisson, 1 - 2 * poisson
    kh = k * thickness
    e = np.exp(-kh)
    # c = e (c_a a + c_b b), d = e (d_a a + d_b b)
    c_a, c_b, d_a, d_b = (-1.0, -kh, 2 / q, (q + 2 * kh) / q) if bonded else (1.0, kh, 0.0, 1.0)
    shear_a = -1 + e**2 * (c_a + d_a * (m + kh))
    shear_b = -m + e**2 * (c_b + d_b * (m + kh))
    pressure_a = 1 + e**2 * (c_a + d_a * (n + kh))
    pressure_b = n + e**2 * (c_b + d_b * (n + kh))
    scale = -1 / (2 * k * (shear_a * pressure_b - shear_b * pressure_a))
    kz, ks = k * depth, k * (thickness - depth)
    from_surface, from_base = np.exp(-kz), np.exp(-ks)
    motions = []
    for a, b in ((-shear_b * scale, shear_a * scale), (pressure_b * scale, -pressure_a * scale)):
        c, d = e * (c_a * a + c_b * b), e * (d_a * a + d_b * b)
        along = (a + b * kz) * from_surface + (c + d * ks) * from_base
        down = -(a + b * (q + kz)) * from_surface + (c + d * (q + ks)) * from_base
        motions.append(_Motion(along, down, n * k * (b * from_surface - d * from_base)))
    return motions[0], motions[1]


def _across(k: _Array, depth: float, thickness: float) -> tuple[_Array, _Array]:
    """Return the displacement under a shear traction of amplitude 1, both across the wave, and its slope in depth."""
    down, up = np.exp(-k * depth), np.exp(-k * (2 * thickness - depth))
    even = 1 + np.exp(-2 * k * thickness)
    return (down - up) / (k * even), -1.0 * (down + up) / even
