"""MagneticSensor: the pads of a manufactured sensor as a transform, wherever a chain stands for the real one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.reference.pad import MagneticPad, calibration
from paxisim.reference.parameters import PadParameters
from paxisim.reference.stack import Stack

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
    _stacks: dict[int, Stack] = field(default_factory=dict, init=False, repr=False)

    stage: ClassVar[str] = "gel"

    def __post_init__(self) -> None:
        """Check the number, and build the first pad."""
        super().__post_init__()
        if self.unit < 0:
            raise InvalidValueError(f"unit must be a number of at least 0, got {self.unit!r}")
        self.pads(1)  # a layout that it cannot have is refused here

    def pads(self, count: int) -> list[MagneticPad]:
        """The first pads of the sensor.

        Raises:
            InvalidValueError: More than 1000.
        """
        if not 0 <= count <= _UNITS:
            raise InvalidValueError(f"a sensor has at most {_UNITS} pads, got {count}")
        return [MagneticPad.unit(self.layout, self.unit * _UNITS + i, self.parameters) for i in range(count)]

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        self.layout.check(x)
        stack = self._stack(x.shape[-4])
        return stack.joined(stack.read(stack.change(stack.split(x))), x)

    def _stack(self, count: int) -> Stack:
        """The pads as one, built when they are first needed."""
        if count not in self._stacks:
            made = [pad.made for pad in self.pads(count)]
            self._stacks[count] = Stack(made, calibration(self.layout, self.parameters), self.parameters.thickness)
        return self._stacks[count]
