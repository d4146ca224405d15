"""Parameters of a magnetic pad: nominal values, their spread between units, and their sources."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.layer.layer import Layer
from paxisim.layout import TaxelLayout

VACUUM = 4e-7 * math.pi
"""Permeability of vacuum (T m / A)."""
PITCH = 26.1e-3 / 6, 22.6e-3 / 5
"""Taxel size (m) of the default parameters: 6x5 taxels on a pad of 26.1 by 22.6 mm."""
MAX_UNEVENNESS = 0.5e-3
"""Largest unevenness of a design (m): half the thickness of a taxel cube."""
LAYER = Layer()
"""Gel of the default parameters."""


@dataclass(frozen=True)
class PadParameters:
    """Design of a pad, in SI units.

    No public values were found for the gel, the magnets or the position of the sensors in PaXini's or XELA's pads.
    Where the source is "ours", the value is plausible for a pad with taxels of about 4 mm; `for_layout` scales it to
    other sizes. All spreads are standard deviations.

    Attributes:
        layer: The gel, bonded to a rigid base. `Gel.of` makes MuJoCo's springs of the same layer.
        magnet_depth: Depth of the magnets' centres below the surface (m). Ours.
        sensor_gap: Distance from the base to the Hall sensors below it (m). Ours.
        remanence: Remanence of the magnets (T). NdFeB of grade N52 has 1.43 to 1.48; bonded and small magnets less.
        magnet_volume: Volume of one magnet (m^3). Ours: a cylinder of 1 mm diameter and 0.5 mm height.
        noise: Standard deviation of a Hall sensor's reading (T). MLX90393 data sheet: 5 uT or less, by its settings.
        step: Step of a Hall sensor's counts (T). MLX90393 data sheet: 0.161 uT at its highest gain and resolution.
        range: Largest flux density that a Hall sensor reads (T). MLX90393 data sheet: 5 to 50 mT.
        remanence_spread: Spread of the remanence between magnets, relative. Ours.
        place_spread: Spread of each magnet's centre along each axis (m). Ours.
        tilt_spread: Spread of each magnet's axis (rad). Ours.
        modulus_spread: Spread of the gel's modulus between units, relative (log-normal). Ours.
        gain_spread: Spread of the gains of each Hall sensor's axes, relative. MLX90393 data sheet: a few per cent.
        turn_spread: Spread of each Hall sensor's orientation on the board (rad). Ours.
        unevenness: Distance (m) from the lowest to the highest taxel of an average unit's surface, which has 0.5 to 1.5
            times as much. Ours, and the size of GCS's bumps; the paper reports uneven pads without a figure. It changes
            no readings: set `MagneticPad.heights` in the simulator.
        earth: Flux density of the earth's field (T), with a random direction for each unit. 25 to 65 uT by location.

    Raises:
        InvalidValueError: A length, remanence, volume or range is not positive, the magnets are not inside the gel, the
            gel is not a `Layer` that is bonded to its base, or the unevenness is not from 0 to 0.5 mm.
    """

    layer: Layer = LAYER
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
    unevenness: float = 0.2e-3
    earth: float = 50e-6

    def __post_init__(self) -> None:
        """Check the values."""
        if not isinstance(self.layer, Layer):
            raise InvalidValueError(f"expected a paxisim.Layer as the gel, got {self.layer!r}")
        if not self.layer.bonded:
            raise InvalidValueError("a magnetic pad needs a bonded layer: nothing holds another against a shear force")
        for name in ("magnet_depth", "sensor_gap", "remanence", "magnet_volume", "range"):
            if not 0 < getattr(self, name) < np.inf:
                raise InvalidValueError(f"{name} must be positive, got {getattr(self, name)!r}")
        if not 0 <= self.unevenness <= MAX_UNEVENNESS:
            raise InvalidValueError(f"unevenness must be from 0 to {MAX_UNEVENNESS:g} m, got {self.unevenness!r}")
        if not self.magnet_depth < self.layer.thickness:
            raise InvalidValueError(
                f"magnet_depth must be less than the thickness of the gel, {self.layer.thickness:g} m, got "
                f"{self.magnet_depth:g}"
            )

    @classmethod
    def for_layout(cls, layout: TaxelLayout) -> PadParameters:
        """Return the default parameters with all lengths scaled to the taxel size of a layout.

        The unevenness is that of the mould and stays the same.
        """
        scale = size_of(layout) ** 0.5
        lengths = ("magnet_depth", "sensor_gap", "place_spread")
        values = {name: scale * getattr(cls, name) for name in lengths}
        layer = replace(LAYER, thickness=scale * LAYER.thickness)
        return cls(layer, magnet_volume=scale**3 * cls.magnet_volume, **values)

    @property
    def moment(self) -> float:
        """Magnetic moment of a magnet (A m^2)."""
        return self.remanence * self.magnet_volume / VACUUM

    @property
    def distance(self) -> float:
        """Distance from a magnet at rest to the Hall sensor below it (m)."""
        return self.layer.thickness - self.magnet_depth + self.sensor_gap


def size_of(layout: TaxelLayout) -> float:
    """Return the area of a taxel relative to that of the default design."""
    return math.prod(layout.pitch) / math.prod(PITCH)


@dataclass(frozen=True)
class GelMemory:
    """Relaxation and internal friction of a gel; see `paxisim.reference.memory`.

    Silicones relax by a few per cent in seconds to minutes, and dissipate part of the work of each cycle, even of slow
    ones. No values were found for the gel of such a pad; the defaults are ours.

    Attributes:
        shares: Stiffness of each relaxing arm, relative to the modulus, which is the modulus at rest. Ours.
        times: Relaxation time of each arm (s). Ours.
        friction: Stiffness of the spring behind the slider, relative to the modulus. Ours.
        slip: Stress (Pa) on a taxel whose deformation of the gel at rest makes the slider slip. Ours.

    Raises:
        InvalidValueError: A share or the friction is negative or not finite, a time or the slip is not positive, or the
            numbers of shares and times differ.
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
