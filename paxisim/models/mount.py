"""Mount: the place of a pad on a gripper."""

from __future__ import annotations

import operator
from dataclasses import dataclass

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.models import names


@dataclass(frozen=True)
class Mount:
    """A place for one pad: a body, the pad frame's pose on it, and the collision geoms the pad replaces.

    Attributes:
        body: Name of the gripper's body that carries the pad.
        pos: Position (m, body frame) of the centre of the sensing surface, which is the origin of the pad frame.
        quat: Orientation of the pad frame in the body frame, (w, x, y, z); normalised on creation. x points along the
            columns, y along the rows, z into the pad, away from the object.
        replaces: Collision geoms to switch off, by name (on any body) or, if unnamed, by index among the body's own
            geoms. They are not deleted and keep their names and appearance.
        name: Name of the pad; default: the name of the body.

    Raises:
        InvalidValueError: The position or quaternion is not finite or has the wrong length, or the quaternion is zero.
    """

    body: str
    pos: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    replaces: tuple[str | int, ...] = ()
    name: str = ""

    def __post_init__(self) -> None:
        """Check and normalise."""
        for field, length in (("pos", 3), ("quat", 4)):
            try:
                value = np.asarray(getattr(self, field), dtype=float)
            except (TypeError, ValueError):
                value = np.array(np.nan)
            if value.shape != (length,) or not np.all(np.isfinite(value)):
                raise InvalidValueError(
                    f"a mount's {field} must be {length} finite numbers, got {getattr(self, field)!r}"
                )
            object.__setattr__(self, field, tuple(float(v) for v in value))
        norm = float(np.linalg.norm(self.quat))
        if norm < 1e-9:
            raise InvalidValueError("a mount's quat must not be zero")
        object.__setattr__(self, "quat", tuple(v / norm for v in self.quat))
        if isinstance(self.replaces, str):
            raise InvalidValueError(f"a mount's replaces must be a sequence of geoms, got {self.replaces!r}")
        replaces = (geom if isinstance(geom, str) else operator.index(geom) for geom in self.replaces)
        object.__setattr__(self, "replaces", tuple(replaces))
        if not self.name:
            object.__setattr__(self, "name", self.body)
        names.check("a mount's name", self.name)
