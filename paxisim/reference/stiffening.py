"""Stiffening: how far rubber gives way at finite strain, against what linear elasticity says.

A neo-Hookean rod of initial modulus E carries, at the stretch ``s``, the nominal stress ``E / 3 (s - 1 / s^2)``
(L. R. G. Treloar, The Physics of Rubber Elasticity, 1975). Where linear elasticity says that a point moves by the
strain ``e``, the rod moves by ``s - 1`` with ``s - 1 / s^2 = 3 e``.
"""

from __future__ import annotations

from typing import Any

_STEPS = 4  # of Newton's method; the stretch is then exact to 1e-6 between 0.2 and 2


def finite_share(strain: Any) -> Any:
    """Share of the linear movement that is left at a compressive strain, 1 at 0; below 1 for compression.

    Args:
        strain: What linear elasticity says (an array of numpy or torch), positive for compression; tension counts as 0.
    """
    e = (strain + abs(strain)) / 2
    # a start that is exact for small strains and of the right order for large ones
    s = (1 + 2 * e) ** -0.5
    for _ in range(_STEPS):
        s = s - (s - s**-2 + 3 * e) / (1 + 2 * s**-3)
    return (1 - s + 1e-12) / (e + 1e-12)
