"""Tabletop: a table, and objects given as text, put into a spec.

Lengths in m, masses in kg, world frame.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.models.mesh_object import MeshObject, load_mesh

SYNTAX = (
    "box:AxBxCmm:MASSkg, cylinder:DIAMETERxHEIGHTmm:MASSkg, ball:DIAMETERmm:MASSkg or mesh:FILE:MASSkg, with @X,Y,Z "
    "(m) behind it"
)
"""How an object is given."""

_TABLE = (0.6, 0.6, 0.02)  # m, its width, depth and thickness
_GAP = 0.02  # m between two objects on the table
_SIZES = (1e-3, 1.0)  # m
_MASSES = (1e-4, 100.0)  # kg
_NUMBER = r"\d+(?:\.\d+)?"
_OBJECT = re.compile(
    rf"(?:(?P<shape>[a-z]+):(?P<size>{_NUMBER}(?:x{_NUMBER})*)mm|mesh:(?P<file>.+)):(?P<mass>{_NUMBER})kg"
    r"(?:@(?P<pos>[^@]*))?",
    re.ASCII,
)
_LENGTHS = {"box": 3, "cylinder": 2, "ball": 1}
_GEOMS = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "ball": mujoco.mjtGeom.mjGEOM_SPHERE,
    "mesh": mujoco.mjtGeom.mjGEOM_MESH,
}
# the model's defaults apply to whatever is not given here
_PLAIN = {"friction": [1, 0.005, 1e-4], "condim": 4, "priority": 0, "solmix": 1, "margin": 0, "gap": 0, "group": 0}


@dataclass(frozen=True, eq=False)
class TableObject:
    """A rigid object.

    Attributes:
        shape: ``"box"``, ``"cylinder"``, ``"ball"`` or ``"mesh"``.
        name: The name it is given, if that is free.
        size: Its lengths along x, y and z; a diameter and a height; or a diameter.
        mass: Its mass.
        pos: Its centre, for a mesh that of its bounding box; None: on the table.
        text: What it was given as.
        mesh: Its mesh, if it has one.
    """

    shape: str
    name: str
    size: tuple[float, ...]
    mass: float
    pos: tuple[float, float, float] | None
    text: str
    mesh: MeshObject | None = None

    @property
    def height(self) -> float:
        """Its length along z."""
        return self.size[-1]

    @property
    def across(self) -> float:
        """Diameter of the circle around it, seen from above."""
        return math.hypot(*self.size[:2]) if len(self.size) == 3 else self.size[0]


def parse_object(text: str) -> TableObject:
    """Parse an object.

    Raises:
        InvalidValueError: The text does not follow `SYNTAX`, a number is out of range, or the mesh cannot be used.
        FileNotFoundError: The mesh does not exist.
    """
    match = _OBJECT.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise InvalidValueError(f"an object must be {SYNTAX}, got {text!r:.80}")
    mesh, shape, name = None, match["shape"], match["shape"]
    if match["file"] is None:
        size = tuple(1e-3 * float(length) for length in match["size"].split("x"))
        if len(size) != _LENGTHS.get(shape):
            raise InvalidValueError(f"an object must be {SYNTAX}, got {text!r:.80}")
    else:
        mesh, shape = load_mesh(Path(match["file"])), "mesh"
        size, name = tuple(mesh.size.tolist()), re.sub(r"\W+", "_", Path(match["file"]).stem)
    mass = float(match["mass"])
    if not all(_SIZES[0] <= length <= _SIZES[1] for length in size):
        raise InvalidValueError(f"the lengths of an object must lie between 1 and 1000 mm, got {text!r:.80}")
    if not _MASSES[0] <= mass <= _MASSES[1]:
        raise InvalidValueError(f"the mass of an object must lie between 0.0001 and 100 kg, got {text!r:.80}")
    pos = None if match["pos"] is None else parse_point(match["pos"], text)
    return TableObject(shape, name, size, mass, pos, text, mesh)


def parse_point(text: str, where: str) -> tuple[float, float, float]:
    """Parse ``X,Y,Z`` in m.

    Args:
        text: The point.
        where: What it is part of, for the message.

    Raises:
        InvalidValueError: It is not three numbers up to 100 m.
    """
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    return check_point((x, y, z), f"{where!r:.80}")


def check_point(point: Sequence[float], got: str) -> tuple[float, float, float]:
    """Return a point as three floats.

    Raises:
        InvalidValueError: It is not three numbers up to 100 m.
    """
    try:
        values = np.asarray(point, dtype=float)
    except (TypeError, ValueError):
        values = np.zeros(0)
    if values.shape != (3,) or not np.all(np.abs(values) <= 100):
        raise InvalidValueError(f"a place must be X,Y,Z, three numbers up to 100 m, got {got}")
    return (float(values[0]), float(values[1]), float(values[2]))


def place_on_table(
    objects: Sequence[TableObject], table: tuple[float, float, float] | None
) -> list[tuple[float, float, float]]:
    """Return the centre of each object; those without a place stand in a row along y through the table's centre.

    Raises:
        InvalidValueError: An object needs a table and there is none, or the row is longer than the table.
    """
    row = [one for one in objects if one.pos is None]
    if row and table is None:
        raise InvalidValueError(f"{row[0].text} needs a place: give a table (--table X,Y,Z), or its centre as @X,Y,Z")
    length = sum(one.across for one in row) + _GAP * max(len(row) - 1, 0)
    if length > _TABLE[1] or any(one.across > _TABLE[0] for one in row):
        raise InvalidValueError(
            f"the objects need {length:.2f} m on a table of {_TABLE[0]:g} x {_TABLE[1]:g} m: leave some out, or give "
            "their centres as @X,Y,Z"
        )
    centres, y = [], -length / 2
    for one in objects:
        if one.pos is not None or table is None:
            centres.append(one.pos)
            continue
        centres.append((table[0], table[1] + y + one.across / 2, table[2] + one.height / 2))
        y += one.across + _GAP
    return centres


def add_table(spec: mujoco.MjSpec, name: str, top: tuple[float, float, float], bits: int) -> None:
    """Add a table.

    Args:
        spec: Spec to add it to.
        name: Name of its body and its geom.
        top: Middle of its top.
        bits: Contact bits.
    """
    half = np.array(_TABLE) / 2
    body = spec.worldbody.add_body(name=name, pos=np.subtract(top, [0, 0, half[2]]))
    _add_geom(body, name, "box", half, 0.0, bits, [0.55, 0.45, 0.35, 1])


def add_object(spec: mujoco.MjSpec, name: str, one: TableObject, centre: tuple[float, float, float], bits: int) -> None:
    """Add an object with a free joint.

    Args:
        spec: Spec to add it to.
        name: Name of its body, joint and geom; those of the parts of a mesh are numbered.
        one: The object.
        centre: Its centre.
        bits: Contact bits.
    """
    body = spec.worldbody.add_body(name=name, pos=centre)
    body.add_freejoint(name=name)
    rgba = [0.25, 0.5, 0.75, 1]
    if one.mesh is None:
        # a cylinder has its radius and half its length, the others half their lengths
        _add_geom(body, name, one.shape, np.array(one.size) / 2, one.mass, bits, rgba)
        return
    whole = sum(one.mesh.volumes)
    for i, (corners, volume) in enumerate(zip(one.mesh.parts, one.mesh.volumes, strict=True)):
        part = name if len(one.mesh.parts) == 1 else f"{name}/{i}"
        spec.add_mesh(name=part, uservert=corners.ravel())
        _add_geom(body, part, "mesh", (), one.mass * volume / whole, bits, rgba, meshname=part)


def _add_geom(
    body: mujoco.MjsBody, name: str, shape: str, half, mass: float, bits: int, rgba: list[float], **more: str
) -> None:
    size = np.zeros(3)
    size[: len(half)] = half
    kind = _GEOMS[shape]
    body.add_geom(
        name=name, type=kind, size=size, mass=mass, contype=bits, conaffinity=bits, rgba=rgba, **_PLAIN, **more
    )
