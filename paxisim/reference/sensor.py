"""MagneticSensor: the pads of a manufactured sensor as a transform, for chains that stand for the real sensor."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

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
"""Name of the covariate that a sensor with a neighbour needs."""
_UNITS = 1000  # maximum number of pads of one sensor


@dataclass(frozen=True, eq=False)
class MagneticSensor(Transform):
    """Readings of the pads of a manufactured sensor, without noise.

    Example::

        real = paxisim.Chain([MagneticSensor(layout, unit=7), paxisim.augment.Firmware()])

    The pads' surfaces are uneven. A transform cannot change what presses on them: give `heights` to the simulator.

    Attributes:
        layout: Layout of each pad, a flat grid.
        unit: Number of the manufactured sensor; its pads differ from each other.
        parameters: Nominal design. Default: `PadParameters.for_layout` of the layout.
        memory: Relaxation and friction of the gel. Default: none.
        covariate: Name of the covariate with the distance (m) between the surfaces of two pads that face each other,
            such as ``"gripper_opening"``; each pad then also reads the other's magnets. Default: no neighbour.
        zeroed_at: Distance (m) at which the sensor was zeroed. Default: far apart.
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
        self.pads(1)  # raises if the layout is not supported

    @property
    def has_memory(self) -> bool:  # type: ignore[override]
        """Whether the gel has a memory of earlier loads."""
        return self.memory is not None

    def pads(self, count: int) -> list[MagneticPad]:
        """Return the first `count` pads of the sensor.

        Raises:
            InvalidValueError: The number is not from 0 to 1000.
        """
        if not 0 <= count <= _UNITS:
            raise InvalidValueError(f"a sensor has at most {_UNITS} pads, got {count}")
        return [MagneticPad.unit(self.layout, self.unit * _UNITS + i, self.parameters) for i in range(count)]

    def heights(self, count: int) -> NDArray[np.float64]:
        """Return the uneven surfaces of the first `count` pads, ``(count, rows, cols)`` m, for `paxisim.set_surface`.

        Raises:
            InvalidValueError: The number is not from 0 to 1000.
        """
        return np.array([pad.heights for pad in self.pads(count)]).reshape(count, self.layout.rows, self.layout.cols)

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
        """Return the state after carrying the first frame for a long time; see `paxisim.reference.memory.at_rest`."""
        return () if self.memory is None else gel.at_rest(self.memory, math.prod(self.layout.pitch), x)

    def step(self, x: Any, state: State, dt: Any, covariates: Covariates | None = None) -> tuple[Any, State]:
        """See `Transform.step`."""
        self._check_dt(dt)
        self._check_frame(x)
        if self.memory is not None:
            x, state = gel.step(self.memory, math.prod(self.layout.pitch), x, state, dt)  # type: ignore[arg-type]
        return self.apply(x, covariates or {}), state

    def _stack(self, count: int) -> tuple[Stack, Facing | None]:
        """Return the pads as one stack, built on first use."""
        if count not in self._stacks:
            made = [pad.made for pad in self.pads(count)]
            stack = Stack(made, calibration(self.layout, self.parameters), self.parameters.layer.thickness)
            self._stacks[count] = stack, Facing(made, self.zeroed_at) if self.covariate else None
        return self._stacks[count]


def reference_sensor(text: str) -> Callable[..., MagneticSensor]:
    """Return a function that makes the sensor a text names, as ``--reference`` and ``--sensor`` accept it.

    Args:
        text: Name such as ``unit:7``. With ``+memory``, its gel has a memory. With ``+neighbour``, two pads read each
            other's magnets, with the covariate ``gripper_opening`` (m).

    Returns:
        A function of the layout of the pads and the other arguments of `MagneticSensor`.

    Raises:
        InvalidValueError: The text is not the name of a reference sensor.
    """
    name, *with_ = text.split("+")
    number = name.removeprefix("unit:")
    known = {"memory", "neighbour"}
    if number == name or not (number.isascii() and number.isdigit()) or not known.issuperset(with_):
        raise InvalidValueError(
            f"a reference sensor is named unit:N, such as unit:7 or unit:7+memory+neighbour, got {text!r}"
        )
    options: dict[str, Any] = {"unit": int(number)}
    if "memory" in with_:
        options["memory"] = GelMemory()
    if "neighbour" in with_:
        options["covariate"] = OPENING
    return lambda layout, **others: MagneticSensor(layout, **{**options, **others})
