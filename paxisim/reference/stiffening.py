"""Stiffening: how far rubber gives way at finite strain, against what linear elasticity says.

A neo-Hookean rod of initial modulus E carries, at the stretch ``s``, the nominal stress ``E / 3 (s - 1 / s^2)``
(L. R. G. Treloar, The Physics of Rubber Elasticity, 1975). Where linear elasticity says that a point moves by the
strain ``e``, the rod moves by ``s - 1`` with ``s - 1 / s^2 = 3 e``.
"""

from __future__ import annotations

from typing import Any

_STEPS = 2  # of Newton's method; it is then solved to 3e-5 up to a strain of 0.5, and to 2e-3 at 2


def finite_share(strain: Any) -> Any:
    """Share of the linear movement that is left at a compressive strain, 1 at 0; below 1 for compression.

    Args:
        strain: What linear elasticity says (an array of numpy or torch), positive for compression; tension counts as 0.
    """
    e = (strain + abs(strain)) / 2
    # a start that is exact for small strains and of the right order for large ones
    s = 1 / (1 + 2 * e) ** 0.5
    for _ in range(_STEPS):
        inverse = 1 / (s * s)  # products: powers cost ten times as much
        s = s - (s - inverse + 3 * e) / (1 + 2 * inverse / s)
    return (1 - s + 1e-12) / (e + 1e-12)
