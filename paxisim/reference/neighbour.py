"""Neighbour: field of a pad's magnets at the Hall sensors of the pad that faces it.

Two pads on a parallel gripper face each other: their rows run in the same direction, their columns in opposite
directions. Seen from one pad, the other is rotated by half a turn about y, and the distance of their surfaces is the
opening of the gripper.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from paxisim.augment.parameter_spec import namespace
from paxisim.errors import InvalidValueError
from paxisim.reference.dipoles import field
from paxisim.reference.stack import as_kind
from paxisim.reference.unit import Unit

FloatArray = NDArray[np.float64]

DEGREE = 20
"""Degree of the polynomial over the opening; its error is below 1e-4 of the largest field at all openings."""
SCALE = 10e-3
"""Scale (m) of the polynomial's variable ``1 / (1 + opening / SCALE)``, which maps all openings to 0 to 1."""
HALF_TURN = np.array([-1.0, 1.0, -1.0])


def facing_field(unit: Unit, other: Unit, opening: float) -> FloatArray:
    """Return the field (T) of the other pad's magnets at a pad's Hall sensors, ``(3, N)`` in the pad frame.

    Args:
        unit: The pad.
        other: The pad that faces it.
        opening: Distance between their surfaces (m).
    """
    magnets = HALF_TURN * other.magnets.T - [0, 0, opening]
    offsets = unit.sensors.T[:, None] - magnets
    return field(np.broadcast_to(HALF_TURN * other.moments.T, offsets.shape), offsets).sum(axis=1).T


class Facing:
    """Fields of two pads at each other as functions of the opening, with their magnets at rest.

    The motion of the other pad's magnets under load is neglected: 0.5 N on each taxel of a 6x5 pad changes their field
    at 18 mm by 0.6 %.
    """

    def __init__(self, units: Sequence[Unit], zeroed_at: float = np.inf) -> None:
        """Fit the polynomials.

        Args:
            units: The two pads.
            zeroed_at: Opening (m) at which they were zeroed. Default: far apart.

        Raises:
            InvalidValueError: The number of pads is not two.
        """
        if len(units) != 2:
            raise InvalidValueError(f"two pads face each other, got {len(units)}")
        left, right = units
        nodes = (chebyshev.chebpts1(DEGREE + 1) + 1) / 2  # values of 1 / (1 + opening / SCALE)
        fields = [
            [facing_field(unit, other, SCALE * (1 / node - 1)).ravel() for node in nodes]
            for unit, other in ((left, right), (right, left))
        ]
        found = [chebyshev.chebfit(2 * nodes - 1, np.array(rows), DEGREE) for rows in fields]
        self._coefficients = np.stack(found)  # (2, DEGREE + 1, 3 N)
        self._coefficients[:, :1] -= _waves(np.array([float(zeroed_at)])) @ self._coefficients
        self._kinds: dict[Any, Any] = {}

    def change(self, opening: Any) -> Any:
        """Return the change of the field (T) since zeroing at openings ``(B,)`` (m), ``(2, B, 3, N)``.

        Openings below 0 count as 0.
        """
        key = opening.dtype, getattr(opening, "device", None)
        if key not in self._kinds:
            self._kinds[key] = as_kind(self._coefficients, opening)
        change = _waves(opening) @ self._kinds[key]
        return change.reshape((2, len(opening), 3, -1))


def _waves(opening: Any) -> Any:
    """Return the Chebyshev polynomials at openings ``(B,)``, ``(B, DEGREE + 1)``."""
    xp = namespace(opening)
    near = 1 / (1 + (opening + abs(opening)) / (2 * SCALE))
    return xp.cos(xp.acos(2 * near - 1)[:, None] * as_kind(np.arange(DEGREE + 1.0), opening))
