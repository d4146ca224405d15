"""Mount: the place of a pad on a gripper, and the geoms that the pad replaces."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.models import names

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True)
class Mount:
    """A place for one pad: a body, the pad frame's pose on it, and the collision geoms the pad replaces.

    Attributes:
        body: Name of the gripper's body that carries the pad.
        pos: Position (m, body frame) of the centre of the sensing surface, which is the origin of the pad frame.
        quat: Orientation of the pad frame in the body frame, (w, x, y, z); normalised on creation. x points along the
            columns, y along the rows, z into the pad, away from the object.
        replaces: Collision geoms to switch off. Each is the name of a geom, on any body; ``"BODY/3"``, the geom with
            index 3 among those of a body in the order of the file; or 3, the same on the mount's own body. A geom whose
            name is ``"BODY/3"`` comes first. The geoms are not deleted and keep their names and appearance.
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

    def __repr__(self) -> str:
        """One line with the values rounded, and without those that are the default."""
        pos, quat = (", ".join(f"{round(v, 6) + 0.0:g}" for v in values) for values in (self.pos, self.quat))
        said = [repr(self.body), f"pos=({pos})", f"quat=({quat})"]
        said += [f"replaces={self.replaces}"] * bool(self.replaces) + [f"name={self.name!r}"] * (self.name != self.body)
        return f"Mount({', '.join(said)})"

    def find_replaced(self, bodies: Iterable[tuple[str, Sequence[str]]]) -> list[tuple[int, int]]:
        """Find the geoms that the mount replaces in a model of any kind.

        Args:
            bodies: Name of each body and the names of its geoms, in the order of the file; without a name, an empty
                text.

        Returns:
            Index of the body, and of the geom among those of the body, for each entry of `replaces`.

        Raises:
            UnknownNameError: There is no such body or geom.
            InvalidValueError: A body has fewer geoms.
        """
        bodies = list(bodies)
        index_of = {name: i for i, (name, _) in enumerate(bodies) if name}
        named = {geom: (i, k) for i, (_, geoms) in enumerate(bodies) for k, geom in enumerate(geoms) if geom}
        found = []
        for geom in self.replaces:
            if geom in named:
                found.append(named[geom])
                continue
            body, number = (self.body, geom) if isinstance(geom, int) else _split(geom, named)
            if body not in index_of:
                raise UnknownNameError("body", body, index_of, f"{geom!r} in replaces is geom {number} of that body")
            count = len(bodies[index_of[body]][1])
            if not 0 <= number < count:
                has = f"body {body!r} has {count} geom{'s' * (count != 1)}, there is no geom {number}"
                raise InvalidValueError(has + (f": the last is {count - 1}" if count else ""))
            found.append((index_of[body], number))
        return found


def _split(geom: str, named: Iterable[str]) -> tuple[str, int]:
    """Split ``"BODY/3"`` into the body and the index."""
    body, slash, digits = geom.rpartition("/")
    if not (slash and is_index(digits)):
        raise UnknownNameError("geom", geom, named)
    return body, int(digits)


def is_index(text: str) -> bool:
    """Tell whether a text is the index of a geom."""
    return text.isascii() and text.isdecimal() and len(text) < 10  # Python refuses to read thousands of digits


def replaced_in_spec(spec: mujoco.MjSpec, mount: Mount) -> list[mujoco.MjsGeom]:
    """Return the geoms of a spec that a mount replaces.

    Raises:
        UnknownNameError: There is no such body or geom.
        InvalidValueError: A body has fewer geoms.
    """
    geoms = [(body.name, list(body.geoms)) for body in spec.bodies]
    found = mount.find_replaced((name, [geom.name for geom in own]) for name, own in geoms)
    return [geoms[body][1][geom] for body, geom in found]


def replaced_in_model(model: mujoco.MjModel, mount: Mount) -> list[int]:
    """Return the ids of the geoms that a mount replaces in a model compiled with all its bodies and geoms.

    Raises:
        UnknownNameError: There is no such body or geom.
        InvalidValueError: A body has fewer geoms.
    """
    first, count = model.body_geomadr.tolist(), model.body_geomnum.tolist()
    found = mount.find_replaced(
        (model.body(body).name, [model.geom(first[body] + k).name for k in range(count[body])])
        for body in range(model.nbody)
    )
    return [first[body] + geom for body, geom in found]


def name_for_replaces(model: mujoco.MjModel, geom: int) -> str:
    """Return the word by which `Mount.replaces` refers to a geom; empty if neither it nor its body has a name."""
    body = int(model.geom_bodyid[geom])
    name, owner = model.geom(geom).name, model.body(body).name
    return name or (f"{owner}/{geom - int(model.body_geomadr[body])}" if owner else "")
