"""Stiffening: deformation of rubber at finite strain, relative to linear elasticity.

A neo-Hookean rod of initial modulus E at the stretch ``s`` carries the nominal stress ``E / 3 (s - 1 / s^2)``
(L. R. G. Treloar, The Physics of Rubber Elasticity, 1975). Under the stress for which linear elasticity gives the
strain ``e``, the strain of the rod is ``s - 1`` with ``s - 1 / s^2 = 3 e``.
"""

from __future__ import annotations

from typing import Any

_STEPS = 2  # steps of Newton's method; the error is then 2e-8 up to a strain of 0.5, and 5e-5 at 2


def finite_share(strain: Any) -> Any:
    """Return the ratio of finite to linear strain under compression, which is 1 at 0 and falls with compression.

    With ``t = 1 / s``, compression by ``e`` gives ``t^3 = 1 + 3 e t``. The ratio ``(1 - s) / e`` is then
    ``3 / (t^2 + t + 1)``, which avoids a division by the strain.

    Args:
        strain: Strain by linear elasticity (numpy or torch array), positive for compression; tension counts as 0.
    """
    e = (strain + abs(strain)) * 0.5
    t = (1 + 2.4 * e) ** 0.5  # initial value within 5 % up to a strain of 2
    square = t * t
    for _ in range(_STEPS):
        t = (2 * square * t + 1) / (3 * (square - e))
        square = t * t
    return 3 / (square + t + 1)
