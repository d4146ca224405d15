"""MagneticSensor: the pads of a manufactured sensor as a transform, wherever a chain stands for the real one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from paxisim.augment.parameter_spec import namespace
from paxisim.augment.transform import Covariates, State, Transform
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.reference import memory as gel
from paxisim.reference.neighbour import Facing
from paxisim.reference.pad import MagneticPad, calibration
from paxisim.reference.parameters import GelMemory, PadParameters
from paxisim.reference.stack import Stack

OPENING = "gripper_opening"
"""The covariate that a sensor with its neighbour's magnets needs."""
_UNITS = 1000  # pads of one sensor at most


@dataclass(frozen=True, eq=False)
class MagneticSensor(Transform):
    """What the pads of unit number `unit` read of the forces on them, without noise.

    Example::

        real = paxisim.Chain([MagneticSensor(layout, unit=7), paxisim.augment.Firmware()])

    Attributes:
        layout: The taxels of each pad; a flat grid.
        unit: Number of the manufactured sensor; each of its pads differs.
        parameters: The nominal design. Default: that for the layout, `PadParameters.for_layout`.
        memory: What the gel remembers of earlier loads. Default: nothing.
        covariate: Name of the covariate with the distance (m) between the surfaces of two pads that face each other,
            such as ``"gripper_opening"``; each then reads the other's magnets, too. Default: it does not.
        zeroed_at: The distance (m) at which the sensor was zeroed. Default: far apart.
    """

    layout: TaxelLayout
    unit: int
    parameters: PadParameters = None  # type: ignore[assignment]
    memory: GelMemory | None = None
    covariate: str = ""
    zeroed_at: float = math.inf
    _stacks: dict[int, tuple[Stack, Facing | None]] = field(default_factory=dict, init=False, repr=False)

    stage: ClassVar[str] = "gel"

    def __post_init__(self) -> None:
        """Check the values."""
        super().__post_init__()
        if self.unit < 0:
            raise InvalidValueError(f"unit must be a number of at least 0, got {self.unit!r}")
        if not self.zeroed_at >= 0:
            raise InvalidValueError(f"zeroed_at must be a distance of 0 or more (m), got {self.zeroed_at!r}")
        if self.parameters is None:
            object.__setattr__(self, "parameters", PadParameters.for_layout(self.layout))
        self.pads(1)  # a layout that it cannot have is refused here

    @property
    def has_memory(self) -> bool:  # type: ignore[override]
        """Whether its gel remembers earlier loads."""
        return self.memory is not None

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
        stack, facing = self._stack(x.shape[-4])
        if facing is None:
            return stack.joined(stack.read(stack.change(stack.split(x))), x)
        xp, opening = namespace(x), self.broadcast_covariate(self.covariate, covariates, x)
        batch = np.broadcast_shapes(tuple(opening.shape[:-4]), tuple(x.shape[:-4]))
        opening = xp.broadcast_to(opening[..., 0, 0, 0, 0], batch)
        x = xp.broadcast_to(x, (*batch, *x.shape[-4:]))
        change = stack.change(stack.split(x)) + facing.change(opening.reshape(-1))
        return stack.joined(stack.read(change), x)

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """The state of a gel that has carried the first frame for long; see `paxisim.reference.memory.at_rest`."""
        return () if self.memory is None else gel.at_rest(self.memory, math.prod(self.layout.pitch), x)

    def step(self, x: Any, state: State, dt: Any, covariates: Covariates | None = None) -> tuple[Any, State]:
        """See `Transform.step`."""
        self._check_dt(dt)
        self._check_frame(x)
        if self.memory is not None:
            x, state = gel.step(self.memory, math.prod(self.layout.pitch), x, state, dt)  # type: ignore[arg-type]
        return self.apply(x, covariates or {}), state

    def _stack(self, count: int) -> tuple[Stack, Facing | None]:
        """The pads as one, built when they are first needed."""
        if count not in self._stacks:
            made = [pad.made for pad in self.pads(count)]
            stack = Stack(made, calibration(self.layout, self.parameters), self.parameters.thickness)
            self._stacks[count] = stack, Facing(made, self.zeroed_at) if self.covariate else None
        return self._stacks[count]


def reference_sensor(text: str) -> Callable[..., MagneticSensor]:
    """What makes the sensor that a text names, as ``--reference`` and ``--sensor`` take it.

    Args:
        text: ``unit:7``; with ``+memory`` its gel has memory, and with ``+neighbour`` two pads read each other's
            magnets, by the covariate ``gripper_opening`` (m).

    Returns:
        A function of the pads' layout and the other arguments of `MagneticSensor`.

    Raises:
        InvalidValueError: The text names none.
    """
    name, *with_ = text.split("+")
    number = name.removeprefix("unit:")
    known = {"memory", "neighbour"}
    if number == name or not (number.isascii() and number.isdigit()) or not known.issuperset(with_):
        raise InvalidValueError(
            f"a reference sensor is named unit:N, as unit:7 or unit:7+memory+neighbour, got {text!r}"
        )
    options: dict[str, Any] = {"unit": int(number)}
    if "memory" in with_:
        options["memory"] = GelMemory()
    if "neighbour" in with_:
        options["covariate"] = OPENING
    return lambda layout, **others: MagneticSensor(layout, **{**options, **others})
