"""MeshObject: the convex parts of an object's mesh file, around the centre of its bounding box.

MuJoCo touches the convex hull of a mesh only, so a hollow object is cut into convex parts (V-HACD, by the package
vhacdx). Lengths in m.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.models.load import one_line

if TYPE_CHECKING:
    import trimesh

SUFFIXES = (".stl", ".obj", ".ply")
"""Formats of mesh files."""
_MOST_BYTES = 100 << 20
_MOST_FACES = 500_000
_MOST_PARTS = 32
_CONVEX = 0.98  # a mesh that fills this share of its convex hull is convex
_LONGEST = 1.0  # m; a file whose object is longer is in mm


@dataclass(frozen=True, eq=False)
class MeshObject:
    """The shape of a rigid object.

    Attributes:
        parts: Corners of its convex parts, each ``(n, 3)``, around the centre of its bounding box.
        volumes: Volumes of the parts (m3).
        size: ``(3,)`` lengths of its bounding box.
        report: In what unit it was read, its size, and how it was made convex.
    """

    parts: tuple[NDArray[np.float64], ...]
    volumes: tuple[float, ...]
    size: NDArray[np.float64]
    report: str


def load_mesh(path: Path) -> MeshObject:
    """Load the mesh of an object.

    A file states no unit. An object is 1 mm to 1 m long, so one that would be longer in m is in mm.

    Raises:
        InvalidValueError: The file is no mesh, is too large or has no volume.
        FileNotFoundError: The file does not exist.
    """
    import trimesh

    if path.suffix.lower() not in SUFFIXES:
        raise InvalidValueError(f"the mesh of an object must be a file {', '.join(SUFFIXES)}, got {path}")
    if path.stat().st_size > _MOST_BYTES:
        raise InvalidValueError(f"{path} has more than {_MOST_BYTES >> 20} MiB: simplify the mesh")
    try:
        mesh = trimesh.load(path, force="mesh", skip_materials=True)
    except Exception as error:  # a damaged file can raise anything in its parser
        raise InvalidValueError(f"{path} is not a mesh that can be read: {one_line(error)}") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise InvalidValueError(f"{path} is not a mesh that can be read: expected faces with finite corners")
    corners, faces = np.asarray(mesh.vertices), len(mesh.faces)
    if faces > _MOST_FACES:
        raise InvalidValueError(f"{path} has {faces} faces, expected at most {_MOST_FACES}: simplify the mesh")
    in_mm = float(np.ptp(corners, axis=0).max()) > _LONGEST
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    mesh.apply_scale(1e-3 if in_mm else 1.0)
    try:
        parts, how = _convex_parts(mesh, mesh.convex_hull)
    except Exception as error:  # of the libraries behind it, for a flat mesh
        raise InvalidValueError(f"{path} has no volume: expected the mesh of a solid object") from error
    read = f"{' x '.join(f'{1e3 * length:.4g}' for length in mesh.extents)} mm, read in {'mm' if in_mm else 'm'}"
    return MeshObject(
        tuple(np.array(part.vertices, dtype=float) for part in parts),
        tuple(float(part.volume) for part in parts),
        np.array(mesh.extents, dtype=float),
        f"{read}; {how}",
    )


def _convex_parts(mesh: trimesh.Trimesh, hull: trimesh.Trimesh) -> tuple[list[trimesh.Trimesh], str]:
    """Return the convex parts of a mesh, and what they are."""
    import trimesh

    if mesh.is_volume and mesh.volume > _CONVEX * hull.volume:
        return [hull], "convex"
    try:
        found = trimesh.decomposition.convex_decomposition(mesh, maxConvexHulls=_MOST_PARTS)
        parts = [trimesh.convex.convex_hull(part["vertices"]) for part in found]
    except ImportError:
        larger = f", {100 * (hull.volume / mesh.volume - 1):.0f} % larger than the mesh" if mesh.is_volume else ""
        return [hull], f"its convex hull{larger}, since vhacdx is not installed: pip install vhacdx keeps its hollows"
    return parts, f"{len(parts)} convex part{'s' * (len(parts) != 1)}"
