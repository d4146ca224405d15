"""Drive: a recorded stream and the part of the scene that it moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.scene import units
from paxisim.scene.poses import ORDERS, as_poses

TARGETS = ("joint", "body", "actuator")


@dataclass(frozen=True)
class Drive:
    """A recorded stream that moves one joint, body or actuator of a scene.

    The position of a joint, or the control of an actuator, is ``scale * unit * value + offset``. One stream may have
    several drives: the opening of a gripper moves each of two fingers by half of it, in opposite directions. With a
    `curve`, this value is only what the curve begins with.

    Attributes:
        stream: Name of the covariate.
        joint: Name of the hinge or slide joint to move. Exactly one of `joint`, `body` and `actuator` must be given.
        body: Name of the body to pose: a mocap body, or one with a free joint. The stream is then a position ``(T, 3)``
            or a pose (`paxisim.scene.poses`), in the world frame.
        actuator: Name of the actuator whose control the stream sets.
        unit: Unit of the values, a key of `paxisim.scene.units.UNITS`; for a body's pose, the unit of the position.
        scale: Scale factor; negative if the directions differ. For a current, the force in newtons per ampere.
        offset: Offset added last, in m, rad or the control's unit; for a body three numbers, or one for all three.
        column: Column of a stream ``(T, n)`` to use, e.g. if all joints are in one array.
        resolution: Step size of the encoder, in `unit`; 0 if there is none. Default: estimated from the values, which
            works only if the stream was not interpolated to another clock.
        curve: Points ``(value, position)`` of a smooth monotonic curve, for a joint that does not move in proportion to
            the stream, such as that of a gripper whose fingers hang on four-bar linkages. The values increase; they are
            what `scale`, `unit` and `offset` give, e.g. the opening in m.
        quaternion: Order of the quaternions of a pose ``(T, 7)``, ``"wxyz"`` or ``"xyzw"``.

    Raises:
        InvalidValueError: Not exactly one target is given, or a number or the curve cannot be used.
        UnknownNameError: The unit or the order of quaternions does not exist.
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
    curve: tuple[tuple[float, float], ...] = ()
    quaternion: str = "wxyz"

    def __post_init__(self) -> None:
        """Check the values."""
        if not self.stream:
            raise InvalidValueError("a drive needs the name of a stream")
        given = [name for name in TARGETS if getattr(self, name)]
        if len(given) != 1:
            got = " and ".join(given) or "none of them"
            raise InvalidValueError(f"the drive of {self.stream!r} must name one joint, body or actuator, got {got}")
        units.factor(self.unit)
        _check_order(self.quaternion)
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
        if len(self.curve):
            object.__setattr__(self, "curve", self._checked_curve())

    def _checked_curve(self) -> tuple[tuple[float, float], ...]:
        try:
            points = np.array([(float(value), float(position)) for value, position in self.curve])
        except (TypeError, ValueError):
            points = np.zeros((0, 2))
        steps = np.diff(points, axis=0)
        rises = len(steps) > 0 and np.isfinite(points).all() and np.all(steps[:, 0] > 0)
        if self.body or not rises or not (np.all(steps[:, 1] > 0) or np.all(steps[:, 1] < 0)):
            raise InvalidValueError(
                f"the curve of the drive of {self.stream!r} must have two or more points (value, position) with "
                "increasing values and positions that all increase or all decrease, for a joint or an actuator"
            )
        return tuple((value, position) for value, position in points.tolist())

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
        """Motion of the target in SI units per unit of the stream; with a curve, that of the curve's values."""
        return self.scale * units.factor(self.unit)

    @property
    def source(self) -> str:
        """Name of the stream, with its column if given."""
        return self.stream if self.column is None else f"{self.stream}[{self.column}]"

    def scaled(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert values of the stream to SI units with the offset, as a curve takes them; not for quaternions."""
        return self.gain * values + np.asarray(self.offset)

    def to_scene(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert known values of the stream to the target's motion in SI units.

        Returns:
            ``(T,)``; for a body positions ``(T, 3)``, or positions and quaternions w x y z ``(T, 7)``.

        Raises:
            InvalidValueError: The values are no poses.
        """
        if self.body:
            poses = as_poses(values, self.quaternion, self.stream)
            return np.hstack([self.scaled(poses[:, :3]), poses[:, 3:]])
        return PchipInterpolator(*np.transpose(self.curve))(self.scaled(values)) if self.curve else self.scaled(values)


@dataclass(frozen=True)
class ObjectStart:
    """Start pose of a body with a free joint at the beginning of an episode.

    Attributes:
        body: Name of the body.
        pos: Position (m) in the world frame.
        quat: Quaternion w x y z.
        stream: Covariate with poses (m) as in `paxisim.scene.poses`, used instead of `pos` and `quat`; each episode
            takes its first known value.
        quaternion: Order of the quaternions of a stream ``(T, 7)``, ``"wxyz"`` or ``"xyzw"``.

    Raises:
        InvalidValueError: Neither or both of `pos` and `stream` are given, or the numbers are not a pose.
        UnknownNameError: The order of quaternions does not exist.
    """

    body: str
    pos: tuple[float, float, float] | None = None
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    stream: str = ""
    quaternion: str = "wxyz"

    def __post_init__(self) -> None:
        """Check the values."""
        _check_order(self.quaternion)
        if not self.body or (self.pos is None) == (not self.stream):
            raise InvalidValueError("a start needs a body, and either pos or stream")
        numbers = np.array([*(self.pos or (0, 0, 0)), *self.quat], dtype=float)
        if numbers.shape != (7,) or not np.isfinite(numbers).all() or np.linalg.norm(numbers[3:]) < 1e-9:
            raise InvalidValueError(
                f"the start of {self.body!r} must have a pos of three numbers and a quat of four, not all 0"
            )


def _check_order(quaternion: str) -> None:
    if quaternion not in ORDERS:
        raise UnknownNameError("order of quaternions", quaternion, ORDERS)
