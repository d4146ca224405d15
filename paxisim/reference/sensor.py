"""MagneticSensor: the pads of a manufactured sensor as a transform, wherever a chain stands for the real one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from paxisim.augment.parameter import namespace
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.reference.pad import MagneticPad
from paxisim.reference.parameters import PadParameters

_UNITS = 1000  # pads of one sensor at most


@dataclass(frozen=True, eq=False)
class MagneticSensor(Transform):
    """What the pads of unit number `unit` read of the forces on them, without noise.

    Example::

        real = paxisim.Chain([MagneticSensor(layout, unit=7), paxisim.augment.Firmware()])

    Attributes:
        layout: The taxels of each pad; a flat grid.
        unit: Number of the manufactured sensor; each of its pads differs.
        parameters: The nominal design.
    """

    layout: TaxelLayout
    unit: int
    parameters: PadParameters = field(default_factory=PadParameters)
    _pads: list[MagneticPad] = field(default_factory=list, init=False, repr=False)

    stage: ClassVar[str] = "gel"

    def __post_init__(self) -> None:
        """Check the number, and build the first pad."""
        super().__post_init__()
        if self.unit < 0:
            raise InvalidValueError(f"unit must be a number of at least 0, got {self.unit!r}")
        self.pads(1)

    def pads(self, count: int) -> list[MagneticPad]:
        """The first pads of the sensor, built when they are first needed.

        Raises:
            InvalidValueError: More than 1000.
        """
        if count > _UNITS:
            raise InvalidValueError(f"a sensor has at most {_UNITS} pads, got {count}")
        while len(self._pads) < count:
            seed = self.unit * _UNITS + len(self._pads)
            self._pads.append(MagneticPad.unit(self.layout, seed, self.parameters))
        return self._pads[:count]

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        readings = [pad.read(x[..., i, :, :, :]) for i, pad in enumerate(self.pads(x.shape[-4]))]
        return namespace(x).stack(readings, axis=-4)
