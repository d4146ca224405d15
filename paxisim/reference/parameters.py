"""What a magnetic pad is made of: nominal figures, how far single units differ from them, and where they come from."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

VACUUM = 4e-7 * math.pi
"""Permeability of vacuum (T m / A)."""
PITCH = 26.1e-3 / 6, 22.6e-3 / 5
"""Size (m) of the taxels for which the defaults are: those of 6x5 taxels on a pad of 26.1 by 22.6 mm."""


@dataclass(frozen=True)
class PadParameters:
    """A pad's design, in SI units.

    No public figure was found for the gel, the magnets or the sensors' distance of PaXini's or XELA's pads. Where the
    source is "ours", the value is a plausible one of a pad with taxels of some 4 mm; `for_layout` has those of others.

    Attributes:
        modulus: Young's modulus of the gel (Pa). Ours: silicones of Shore 00-50 to A 30 have 0.1 to 1.2 MPa.
        poisson: Its Poisson's ratio; rubber is nearly incompressible.
        thickness: Of the gel, bonded to a rigid base (m). Ours.
        magnet_depth: Of the magnets' centres below the surface (m). Ours.
        sensor_gap: From the base to the Hall sensors below it (m). Ours.
        remanence: Of the magnets (T). NdFeB of grade N52 has 1.43 to 1.48; bonded and small ones less.
        magnet_volume: Of one magnet (m^3). Ours: a cylinder of 1 mm diameter and 0.5 mm height.
        noise: Standard deviation of a Hall sensor's reading (T). MLX90393's data sheet: 5 uT and less, by its settings.
        step: Of a Hall sensor's counts (T). MLX90393's data sheet: 0.161 uT at its highest gain and resolution.
        range: Largest flux density that it reads (T). MLX90393's data sheet: 5 to 50 mT.
        remanence_spread: Standard deviation from magnet to magnet, as a share. Ours.
        place_spread: Of each magnet's centre along each axis (m). Ours.
        tilt_spread: Of each magnet's axis (rad). Ours.
        modulus_spread: Of the gel from unit to unit, as a share. Ours.
        gain_spread: Of each Hall sensor's axes, as a share. MLX90393's data sheet: a few per cent.
        turn_spread: Of each Hall sensor's orientation on the board (rad). Ours.
        earth: Flux density of the earth's field (T), of a direction that each unit draws. 25 to 65 uT by place.

    Raises:
        InvalidValueError: A length, modulus or volume that is not positive, magnets that are not in the gel, or a
            Poisson's ratio that is not below 0.5.
    """

    modulus: float = 0.5e6
    poisson: float = 0.48
    thickness: float = 3e-3
    magnet_depth: float = 1.2e-3
    sensor_gap: float = 1e-3
    remanence: float = 1.2
    magnet_volume: float = math.pi / 4 * 1e-3**2 * 0.5e-3
    noise: float = 2e-6
    step: float = 0.161e-6
    range: float = 50e-3
    remanence_spread: float = 0.05
    place_spread: float = 0.1e-3
    tilt_spread: float = 0.05
    modulus_spread: float = 0.1
    gain_spread: float = 0.02
    turn_spread: float = 0.02
    earth: float = 50e-6

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("modulus", "thickness", "magnet_depth", "sensor_gap", "remanence", "magnet_volume", "range"):
            if not 0 < getattr(self, name) < np.inf:
                raise InvalidValueError(f"{name} must be positive, got {getattr(self, name)!r}")
        if not self.magnet_depth < self.thickness:
            raise InvalidValueError(
                f"magnet_depth must be less than the thickness of the gel, {self.thickness:g} m, got "
                f"{self.magnet_depth:g}"
            )
        if not 0 <= self.poisson < 0.5:
            raise InvalidValueError(f"poisson must be from 0 to below 0.5, got {self.poisson!r}")

    @classmethod
    def for_layout(cls, layout: TaxelLayout) -> PadParameters:
        """The defaults for the taxels of a layout: all lengths in proportion to their size."""
        scale = size_of(layout) ** 0.5
        lengths = ("thickness", "magnet_depth", "sensor_gap", "place_spread")
        values = {name: scale * getattr(cls, name) for name in lengths}
        return cls(magnet_volume=scale**3 * cls.magnet_volume, **values)

    @property
    def moment(self) -> float:
        """Magnetic moment of a magnet (A m^2)."""
        return self.remanence * self.magnet_volume / VACUUM

    @property
    def distance(self) -> float:
        """From a magnet at rest to the Hall sensor below it (m)."""
        return self.thickness - self.magnet_depth + self.sensor_gap


def size_of(layout: TaxelLayout) -> float:
    """Area of a taxel as a share of that of the default design."""
    return math.prod(layout.pitch) / math.prod(PITCH)


@dataclass(frozen=True)
class GelMemory:
    """How a gel relaxes and rubs within itself; see `paxisim.reference.memory`.

    Silicones relax by some per cent in seconds to minutes and lose a part of the work of each cycle, also of slow ones.
    No figures were found for the gel of such a pad; those here are ours.

    Attributes:
        shares: Stiffness of each arm that relaxes, as a share of the modulus, which is that at rest. Ours.
        times: Relaxation time of each arm (s). Ours.
        friction: Stiffness of the spring behind the slider, as a share of the modulus. Ours.
        slip: Stress (Pa) on a taxel that deforms the gel at rest so far that the slider slips. Ours.

    Raises:
        InvalidValueError: Shares or a friction that are negative or not finite, times or a slip that are not positive,
            or not one time for each share.
    """

    shares: tuple[float, ...] = (0.06, 0.04)
    times: tuple[float, ...] = (0.5, 20.0)
    friction: float = 0.15
    slip: float = 5e3

    def __post_init__(self) -> None:
        """Check the values."""
        if len(self.shares) != len(self.times):
            raise InvalidValueError(f"expected a time for each share, got {len(self.times)} for {len(self.shares)}")
        for name, values in (("shares", self.shares), ("friction", (self.friction,))):
            if not all(0 <= value < np.inf for value in values):
                raise InvalidValueError(f"{name} must be 0 or more, got {getattr(self, name)!r}")
        for name, values in (("times", self.times), ("slip", (self.slip,))):
            if not all(0 < value < np.inf for value in values):
                raise InvalidValueError(f"{name} must be positive, got {getattr(self, name)!r}")
