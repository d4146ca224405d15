"""Stiffening: how far rubber gives way at finite strain, against what linear elasticity says.

A neo-Hookean rod of initial modulus E carries, at the stretch ``s``, the nominal stress ``E / 3 (s - 1 / s^2)``
(L. R. G. Treloar, The Physics of Rubber Elasticity, 1975). Where linear elasticity says that a point moves by the
strain ``e``, the rod moves by ``s - 1`` with ``s - 1 / s^2 = 3 e``.
"""

from __future__ import annotations

from typing import Any

_STEPS = 2  # of Newton's method; it is then solved to 2e-8 up to a strain of 0.5, and to 5e-5 at 2


def finite_share(strain: Any) -> Any:
    """Share of the linear movement that is left at a compressive strain, 1 at 0; below 1 for compression.

    With ``t = 1 / s``, compression by ``e`` is ``t^3 = 1 + 3 e t``, and the share ``(1 - s) / e`` is
    ``3 / (t^2 + t + 1)``, which divides by no strain.

    Args:
        strain: What linear elasticity says (an array of numpy or torch), positive for compression; tension counts as 0.
    """
    e = (strain + abs(strain)) * 0.5
    t = (1 + 2.4 * e) ** 0.5  # a start within 5 % up to a strain of 2
    square = t * t
    for _ in range(_STEPS):
        t = (2 * square * t + 1) / (3 * (square - e))
        square = t * t
    return 3 / (square + t + 1)
