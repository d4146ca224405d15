"""Drive: one recorded stream and the part of the scene that it moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.scene import units

TARGETS = ("joint", "body", "actuator")


@dataclass(frozen=True)
class Drive:
    """What moves one joint, body or actuator of a scene.

    A joint is at ``scale * unit * value + offset``, an actuator's control likewise. One stream may have several drives:
    the opening of a gripper moves each of two fingers by half of it, in opposite directions.

    Attributes:
        stream: Name of the covariate.
        joint: The hinge or slide joint that it moves, or
        body: the body that it poses: a mocap body, or one with a free joint. The stream is then ``(T, 3)``, a position,
            or ``(T, 7)``, a position and a quaternion w x y z, in the world frame; or
        actuator: the actuator whose control it is. Exactly one of the three is given.
        unit: Unit of the values, a key of `paxisim.scene.units.UNITS`; of a body's pose, that of the position.
        scale: Factor; negative where the directions differ. Of a current, the newtons an ampere makes.
        offset: Added last, in m, rad or the control's unit; for a body three numbers, or one for all three.
        column: Which number of a stream ``(T, n)`` it is, as of all joints in one array.
        resolution: Size of the encoder's steps, in `unit`; 0 if there are none. Default: read off the values, which
            shows the steps only where the stream was not interpolated to another clock.

    Raises:
        InvalidValueError: Not exactly one target, or a number that cannot be used.
        UnknownNameError: There is no such unit.
    """

    stream: str
    joint: str = ""
    body: str = ""
    actuator: str = ""
    unit: str = "1"
    scale: float = 1.0
    offset: float | tuple[float, float, float] = 0.0
    column: int | None = None
    resolution: float | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        if not self.stream:
            raise InvalidValueError("a drive needs the name of a stream")
        given = [name for name in TARGETS if getattr(self, name)]
        if len(given) != 1:
            got = " and ".join(given) or "none of them"
            raise InvalidValueError(f"the drive of {self.stream!r} must name one joint, body or actuator, got {got}")
        units.factor(self.unit)
        offset = np.asarray(self.offset, dtype=float)
        if offset.shape not in ((), (3,)) or (offset.shape == (3,) and not self.body) or not np.isfinite(offset).all():
            expected = "one or three finite numbers" if self.body else "a finite number"
            raise InvalidValueError(f"the offset of the drive of {self.stream!r} must be {expected}")
        if not (math.isfinite(self.scale) and self.scale):
            raise InvalidValueError(f"the scale of the drive of {self.stream!r} must be finite and not 0")
        if self.resolution is not None and not 0 <= self.resolution < math.inf:
            raise InvalidValueError(f"the resolution of the drive of {self.stream!r} must be 0 or more")
        if self.column is not None and self.column < 0:
            raise InvalidValueError(f"the column of the drive of {self.stream!r} must be 0 or more, got {self.column}")

    @property
    def kind(self) -> str:
        """``"joint"``, ``"body"`` or ``"actuator"``."""
        return next(name for name in TARGETS if getattr(self, name))

    @property
    def target(self) -> str:
        """Name of the joint, body or actuator."""
        return getattr(self, self.kind)

    @property
    def gain(self) -> float:
        """What one of the stream's unit moves, in SI units."""
        return self.scale * units.factor(self.unit)

    @property
    def source(self) -> str:
        """The stream as messages call it, with its column."""
        return self.stream if self.column is None else f"{self.stream}[{self.column}]"

    def to_scene(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """What the target does for the stream's values; of a pose only the position changes."""
        if not self.body:
            return self.gain * values + np.asarray(self.offset)
        moved = values.copy()
        moved[:, :3] = self.gain * values[:, :3] + np.asarray(self.offset)
        return moved


@dataclass(frozen=True)
class ObjectStart:
    """Where a body with a free joint is when an episode begins.

    Attributes:
        body: The body.
        pos: Position (m) in the world frame.
        quat: Quaternion w x y z.
        stream: A covariate ``(T, 7)`` with position (m) and quaternion, of which each episode takes its first known
            value; instead of `pos` and `quat`.

    Raises:
        InvalidValueError: Neither or both were given, or numbers that are no pose.
    """

    body: str
    pos: tuple[float, float, float] | None = None
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the values."""
        if not self.body or (self.pos is None) == (not self.stream):
            raise InvalidValueError("a start needs a body, and either pos or stream")
        numbers = np.array([*(self.pos or (0, 0, 0)), *self.quat], dtype=float)
        if numbers.shape != (7,) or not np.isfinite(numbers).all() or np.linalg.norm(numbers[3:]) < 1e-9:
            raise InvalidValueError(
                f"the start of {self.body!r} must have a pos of three numbers and a quat of four, not all 0"
            )
