"""Spread: random deviations of a manufactured unit from the nominal design."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim.reference.dipoles import turned
from paxisim.reference.parameters import PadParameters

FloatArray = NDArray[np.float64]


class Spread:
    """Random deviations of one unit; call the methods always in the same order."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Draw the deviations from `rng`."""
        self._rng = rng

    def of(self, nominal: PadParameters) -> PadParameters:
        """Draw the parameters of the unit."""
        modulus = nominal.layer.modulus * np.exp(nominal.modulus_spread * self._rng.standard_normal())
        return replace(nominal, layer=replace(nominal.layer, modulus=modulus))

    def magnets(self, places: FloatArray, moments: FloatArray, own: PadParameters) -> tuple[FloatArray, FloatArray]:
        """Draw positions (m) and moments (A m^2) of the magnets about the nominal ones."""
        places = places + own.place_spread * self._rng.standard_normal(places.shape)
        moments = moments * (1 + own.remanence_spread * self._rng.standard_normal((len(moments), 1)))
        tilt = own.tilt_spread * self._rng.standard_normal(moments.shape)
        return places, turned(moments, tilt)

    def sensors(self, count: int, own: PadParameters) -> FloatArray:
        """Draw the matrix of gains and orientation of each Hall sensor, ``(N, 3, 3)``."""
        gains = 1 + own.gain_spread * self._rng.standard_normal((count, 3))
        axes = own.turn_spread * self._rng.standard_normal((count, 3))
        seen = np.stack([turned(np.tile(axis, (count, 1)), axes) for axis in np.eye(3)], axis=-1)
        return gains[..., None] * seen

    def earth(self, own: PadParameters) -> FloatArray:
        """Draw the earth's field in the pad frame (T), ``(3,)``."""
        direction = self._rng.standard_normal(3)
        return own.earth * direction / np.linalg.norm(direction)
