"""Layer: the soft layer of a pad, from whose material and thickness its stiffness under any object follows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layer.contact import pressed
from paxisim.layer.response import MAX_POISSON, surface_deflection
from paxisim.layout import TaxelLayout

FloatArray = NDArray[np.float64]
Contact = Literal["flat", "taxel"] | float

STATED_FORCE = 5.0
"""Force (N) at which the stiffness under a sphere is stated by default."""

_CELLS = 24  # cells along the longer side of a contact; twice as many change a stiffness by 1 % or less
_LEAST = 12  # cells across the contact of a sphere, at least
_BED_NODES = 200


@dataclass(frozen=True)
class Layer:
    """An elastic layer on a rigid base, in SI units.

    The layer is linear elastic and isotropic, and extends beyond the pad. A pad's stiffness depends on what presses on
    it: a bonded, nearly incompressible layer cannot yield sideways under a wide face, so it is stiffer per taxel there
    than under one taxel. `stiffness` gives the figure for a contact, and `Gel.of` makes MuJoCo's springs of it.

    Example::

        layer = paxisim.Layer(modulus=0.3e6)
        gel = paxisim.Gel.of(layer, layout, contact="flat")

    Attributes:
        modulus: Young's modulus (Pa). Silicones of such sensors, Shore 00-50 to A 30, have 0.1 to 1.2 MPa. The default
            is ours.
        poisson: Poisson's ratio, 0 to 0.495; rubber is nearly incompressible. The default is ours.
        thickness: Thickness (m). The default is ours.
        bonded: Whether the layer is bonded to its base. Otherwise it slides on it without friction, which is defined
            for normal loads only: nothing holds such a layer against a shear force.

    Raises:
        InvalidValueError: The modulus or the thickness is not a positive finite number, Poisson's ratio is not from 0
            to 0.495, or `bonded` is not a truth value.
    """

    modulus: float = 0.5e6
    poisson: float = 0.48
    thickness: float = 3e-3
    bonded: bool = True

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("modulus", "thickness"):
            if not (_is_number(value := getattr(self, name)) and 0 < value < np.inf):
                raise InvalidValueError(f"a layer's {name} must be positive and finite, got {value!r}")
        if not (_is_number(self.poisson) and 0 <= self.poisson <= MAX_POISSON):
            raise InvalidValueError(f"a layer's poisson must be from 0 to {MAX_POISSON}, got {self.poisson!r}")
        if not isinstance(self.bonded, (bool, np.bool_)):
            raise InvalidValueError(f"a layer's bonded must be True or False, got {self.bonded!r}")

    def compliance(self, layout: TaxelLayout) -> FloatArray:
        """Return how far each taxel sinks per newton on each taxel.

        A load is even over its taxel, and the depth is the mean over a taxel; see
        `paxisim.layer.response.surface_deflection`.

        Args:
            layout: Layout of the taxels, a flat grid.

        Returns:
            ``(N, N)`` depth (m/N), symmetric and positive definite.

        Raises:
            InvalidValueError: The layout is not a flat grid.
        """
        if not layout.is_grid:
            raise InvalidValueError("a layer needs a flat grid of taxels: curved layers are not supported")
        x, y = np.meshgrid(np.arange(layout.cols) * layout.pitch[1], np.arange(layout.rows) * layout.pitch[0])
        steps = np.stack([x, y], axis=-1).reshape(-1, 2)
        sunk = surface_deflection(
            steps, self.thickness, self.modulus, self.poisson, layout.pitch, bonded=bool(self.bonded)
        ).reshape(layout.rows, layout.cols)
        row, col = np.divmod(np.arange(layout.taxels), layout.cols)
        return sunk[np.abs(row[:, None] - row), np.abs(col[:, None] - col)]

    def stiffness(self, layout: TaxelLayout, contact: Contact = "flat", *, force: float = STATED_FORCE) -> float:
        """Return the stiffness of one taxel for a contact (N/m).

        It is that of independent springs which carry the same force at the same indentation as the layer.

        Args:
            layout: Layout of the taxels; a flat grid unless the contact is ``"taxel"``.
            contact: ``"flat"``: a rigid face over the whole pad. ``"taxel"``: a rigid face over one taxel alone. A
                number: a rigid sphere of this radius (m) on the middle of the pad.
            force: Force (N) that presses the sphere: the stiffness is the secant at this force. The layer is linear
                under faces, so there the force does not matter.

        Raises:
            InvalidValueError: The contact is neither of these, the force is not positive or presses the sphere through
                the layer, or the layout is not a flat grid.
        """
        height, width = layout.pitch
        area = height * width
        if contact == "taxel":
            return self._springs(height, width, None, force) * area
        if not layout.is_grid:
            raise InvalidValueError("a layout that is not a flat grid has only the contact 'taxel'")
        height, width = height * layout.rows, width * layout.cols
        if contact == "flat":
            return self._springs(height, width, None, force) * area
        if not _is_number(contact) or not 0 < contact < np.inf:
            raise InvalidValueError(f"contact must be 'flat', 'taxel' or a radius in m, got {contact!r}")
        return self._springs(height, width, float(contact), force) * area

    def _springs(self, height: float, width: float, radius: float | None, force: float) -> float:
        """Return the stiffness per area (N/m^3) of springs that act on an object as the layer does.

        The object presses on a rectangle. The cells of a sphere's contact become finer until they resolve it.
        """
        if radius is None:
            _, depth, _ = self._pressed(height, width, None, force)
            return force / (depth * height * width)
        tall, wide = height, width
        while True:
            loads, depth, cells = self._pressed(tall, wide, radius, force)
            reach = np.abs(cells.positions[loads > 0, :2]).max(axis=0) + np.array(cells.pitch[::-1]) / 2
            if max(reach) >= max(tall, wide) / 2 * _LEAST / _CELLS:
                if depth >= self.thickness:
                    raise InvalidValueError(
                        f"{force:g} N press a sphere of {radius:g} m through the layer of {self.thickness:g} m: "
                        "state the stiffness at a smaller force"
                    )
                return force / _bed_volume(height, width, radius, depth)
            tall, wide = (min(side, 2.5 * max(reach)) for side in (tall, wide))

    def _pressed(
        self, height: float, width: float, radius: float | None, force: float
    ) -> tuple[FloatArray, float, TaxelLayout]:
        """Return the loads on the cells of a rectangle (N), the depth of a face or a sphere (m), and the cells."""
        rows, cols = (max(1, math.ceil(_CELLS * side / max(height, width))) for side in (height, width))
        cells = TaxelLayout(rows, cols, (height / rows, width / cols))
        gap = np.zeros(cells.taxels)
        if radius is not None:
            gap = _sphere_gap(cells.positions[:, 0], cells.positions[:, 1], radius)
        loads, depth = pressed(self.compliance(cells), gap, force)
        return loads, depth + float(gap.min()), cells


def _bed_volume(height: float, width: float, radius: float, depth: float) -> float:
    """Return the volume (m^3) that a sphere at a depth takes from a rectangle of springs, each pushed on its own."""
    reach = math.sqrt(depth * (2 * radius - depth)) if depth < radius else radius
    tall, wide = min(height, 2 * reach), min(width, 2 * reach)
    nodes, weights = np.polynomial.legendre.leggauss(_BED_NODES)
    y, x = np.meshgrid(tall / 2 * nodes, wide / 2 * nodes, indexing="ij")
    pushed = np.clip(depth - _sphere_gap(x, y, radius), 0, None)
    return float(weights @ pushed @ weights) * tall * wide / 4


def _sphere_gap(x: NDArray[np.floating], y: NDArray[np.floating], radius: float) -> FloatArray:
    """Return the distance (m) of a sphere that touches the origin from the plane, infinite beyond its equator."""
    squared = np.asarray(x, dtype=np.float64) ** 2 + np.asarray(y, dtype=np.float64) ** 2
    return np.where(squared < radius**2, radius - np.sqrt(np.clip(radius**2 - squared, 0, None)), np.inf)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
