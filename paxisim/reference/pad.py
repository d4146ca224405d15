"""MagneticPad: readings of a magnetic sensor from the forces on its taxels."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from array_api_compat import array_namespace
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout
from paxisim.reference.parameters import PadParameters, size_of
from paxisim.reference.stack import Stack, apply
from paxisim.reference.unevenness import uneven_heights
from paxisim.reference.unit import make_unit

FloatArray = NDArray[np.float64]

CALIBRATION_PRESSES = (0.25, 0.5, 1.0)
"""Normal forces (N) of the maker's calibration on a taxel of the default size; other sizes get the same pressures."""
DRAGS = (-0.3, 0.0, 0.3)
"""Shear along x and along y during these presses, as shares of the normal force."""
TEMPERATURE = -1.2e-3
"""Relative change of a magnet's remanence per kelvin: data sheets of NdFeB state -0.11 to -0.12 % per kelvin."""


class MagneticPad:
    """One manufactured pad.

    Forces on the taxels deform a soft layer. Each magnet in it moves and turns under the loads on all taxels. Each Hall
    sensor below the layer reads the sum of all magnets' fields. A calibration, fitted to presses of single taxels of
    the nominal design, converts the change of a sensor's field to the force on its taxel.

    Example::

        pad = MagneticPad.unit(layout, seed=7)
        reading = pad.read(force)  # (..., 3, rows, cols) newtons, as such a sensor reports them

    Attributes:
        layout: Layout of the taxels, a flat grid.
        parameters: Parameters of this unit.
        seed: Number of the unit, which seeds its deviations from the nominal design; None for the nominal design.
        made: Matrices of this unit.
        heights: ``(rows, cols)`` surface of this unit (m), for `paxisim.set_surface`; that of the nominal design is
            flat. The forces on the taxels of an uneven surface differ; what the pad makes of them does not.
    """

    def __init__(self, layout: TaxelLayout, parameters: PadParameters | None = None, seed: int | None = None) -> None:
        """Make the nominal pad, or, with a seed, the unit with that number; see `unit`.

        Args:
            layout: Layout of the taxels, a flat grid.
            parameters: Nominal design. Default: `PadParameters.for_layout` of the layout.
            seed: Number of the unit.

        Raises:
            InvalidValueError: The layout is not a flat grid, or the seed is not a whole number of 0 or more.
        """
        self.layout, self.seed = layout, seed
        nominal = PadParameters.for_layout(layout) if parameters is None else parameters
        self.made, self.parameters = make_unit(layout, nominal, seed)
        self.heights = uneven_heights(layout, nominal.unevenness, seed)
        self._stack = Stack([self.made], calibration(layout, nominal), self.parameters.layer.thickness)

    @classmethod
    def unit(cls, layout: TaxelLayout, seed: int, parameters: PadParameters | None = None) -> MagneticPad:
        """Make one manufactured unit, whose deviations from the nominal design are drawn with the seed.

        Args:
            layout: Layout of the taxels, a flat grid.
            seed: Number of the unit.
            parameters: Nominal design. Default: `PadParameters.for_layout` of the layout.
        """
        return cls(layout, parameters, seed)

    def read(self, force: Any, *, warmer: float = 0.0, outside: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
        """Return the reading of the pad under forces, without noise.

        Args:
            force: ``(..., 3, rows, cols)`` newtons; numpy or torch.
            warmer: Temperature rise of the magnets since zeroing (K).
            outside: Change of an external flux density (T, pad frame) since zeroing, e.g. from iron, a motor or a
                magnet.

        Returns:
            ``(..., 3, rows, cols)`` newtons.
        """
        change = self._change(force)
        if warmer or any(outside):
            loss = TEMPERATURE * warmer
            change = change * (1 + loss) + loss * self._stack.arrays(change).alone
            xp = array_namespace(change)
            change = change + xp.stack([change[:, :, 0] * 0 + part for part in outside], axis=2)
        return self._joined(self._stack.read(change), force)

    def measure(self, force: Any, rng: np.random.Generator) -> FloatArray:
        """Return the reading with the noise, quantisation and range of the Hall sensors; numpy only."""
        own, force = self.parameters, np.asarray(force, dtype=np.float64)
        change = self._change(force)
        like = self._stack.arrays(change)
        rest = apply(like.view, like.alone + self.made.earth)
        flux = apply(like.view, change) + rest
        flux = np.clip(flux + own.noise * rng.standard_normal(flux.shape), -own.range, own.range)
        return self._joined(apply(like.to_force, own.step * np.rint(flux / own.step) - rest), force)

    def flux(self, force: Any) -> Any:
        """Return the change of the flux density (T) in each Hall sensor's own axes, ``(..., 3, rows, cols)``."""
        change = self._change(force)
        return self._joined(apply(self._stack.arrays(change).view, change), force)

    def motion(self, force: Any) -> tuple[Any, Any]:
        """Return displacement (m) and rotation (rad) of each magnet, each ``(..., 3, rows, cols)``."""
        both = self._stack.motion(self._split(force))
        return self._joined(both[:, :, :3], force), self._joined(both[:, :, 3:], force)

    def _change(self, force: Any) -> Any:
        return self._stack.change(self._split(force))

    def _split(self, force: Any) -> Any:
        self.layout.check(force)
        return self._stack.split(force[..., None, :, :, :])

    def _joined(self, parts: Any, force: Any) -> Any:
        return self._stack.joined(parts, force)

    def __repr__(self) -> str:
        """Return the size of the grid and the number of the unit."""
        which = "nominal" if self.seed is None else f"unit {self.seed}"
        return f"MagneticPad({self.layout.rows}x{self.layout.cols}, {which})"


@lru_cache(maxsize=8)
def calibration(layout: TaxelLayout, nominal: PadParameters) -> FloatArray:
    """Return the calibration of each taxel (N/T), ``(3, 3, N)``, fitted to presses of single nominal taxels."""
    made, own = make_unit(layout, nominal, None)
    stack = Stack([made], np.zeros((3, 3, layout.taxels)), own.layer.thickness)
    loads = size_of(layout) * np.array([(p * a, p * b, p) for p in CALIBRATION_PRESSES for a in DRAGS for b in DRAGS])
    maps = np.empty((3, 3, layout.taxels))
    for taxel in range(layout.taxels):
        force = np.zeros((1, len(loads), 3, layout.taxels))
        force[0, :, :, taxel] = loads
        change = stack.change(force)[0, :, :, taxel]
        maps[:, :, taxel] = np.linalg.lstsq(change, loads, rcond=None)[0].T
    maps.setflags(write=False)
    return maps
