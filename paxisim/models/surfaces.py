"""Surfaces: the collision surface of a link, as small triangles.

MuJoCo collides every mesh as its convex hull, so this uses the hull too. Lengths in m; points and normals in the frame
of the link, which is a body together with the bodies welded to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull


@dataclass(frozen=True, eq=False)
class Surface:
    """Collision surface of a link as small triangles.

    Attributes:
        triangles: ``(N, 3, 3)`` corners, link frame.
        normals: ``(N, 3)`` unit normals pointing out of the geom, link frame.
        geoms: ``(N,)`` geom id of each triangle.
        edge: Longest edge of a triangle.
    """

    triangles: NDArray[np.float64]
    normals: NDArray[np.float64]
    geoms: NDArray[np.int64]
    edge: float

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """Centres of the triangles, ``(N, 3)``."""
        return self.triangles.mean(axis=1)


def surface_of(model: mujoco.MjModel, data: mujoco.MjData, geoms: Sequence[int], link: int, cells: int = 80) -> Surface:
    """Return the surface of `geoms` in the frame of body `link`.

    Args:
        model: Compiled model.
        data: Data of the model, with the kinematics computed.
        geoms: Geom ids; planes and height fields are ignored.
        link: Body id of the link.
        cells: Number of triangle edges along the largest dimension of the link; edges are at least 0.5 mm long.
    """
    import trimesh

    meshes = [(g, shape) for g in geoms if (shape := shape_of(model, g)) is not None]
    origin, axes = data.xpos[link], data.xmat[link].reshape(3, 3)
    placed = []
    for geom, (vertices, faces) in meshes:
        world = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        placed.append((geom, (world - origin) @ axes, faces))
    if not placed:
        empty = np.zeros((0, 3))
        return Surface(np.zeros((0, 3, 3)), empty, np.zeros(0, dtype=np.int64), 1e-3)
    everything = np.concatenate([v for _, v, _ in placed])
    edge = max(float(np.ptp(everything, axis=0).max()) / cells, 0.5e-3)
    triangles, ids = [], []
    for geom, vertices, faces in placed:
        fine_v, fine_f = trimesh.remesh.subdivide_to_size(vertices, faces, edge, max_iter=30)  # type: ignore[misc]
        triangles.append(fine_v[fine_f])
        ids.append(np.full(len(fine_f), geom, dtype=np.int64))
    corners, owner = np.concatenate(triangles), np.concatenate(ids)
    normals, whole = trimesh.triangles.normals(corners)
    return Surface(corners[whole], normals, owner[whole], edge)


def shape_of(model: mujoco.MjModel, geom: int) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    """Return vertices and outward faces of a geom in its own frame, or None if it has no closed surface."""
    from trimesh import creation

    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    kinds = mujoco.mjtGeom
    if kind == int(kinds.mjGEOM_MESH):
        mesh = int(model.geom_dataid[geom])
        first = int(model.mesh_vertadr[mesh])
        vertices = np.array(model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])], dtype=float)
        return hull(vertices)
    if kind == int(kinds.mjGEOM_BOX):
        solid = creation.box(extents=2 * size)
    elif kind == int(kinds.mjGEOM_SPHERE):
        solid = creation.icosphere(subdivisions=4, radius=float(size[0]))
    elif kind == int(kinds.mjGEOM_ELLIPSOID):
        solid = creation.icosphere(subdivisions=4, radius=1.0)
        solid.apply_scale(size)
    elif kind == int(kinds.mjGEOM_CYLINDER):
        # space the rings like the sections: long thin triangles would be split into very many
        radius, half = float(size[0]), float(size[1])
        rings = np.linspace(-half, half, int(np.clip(2 * half * 64 / (2 * np.pi * radius), 1, 200)) + 1)
        outline = np.vstack([[0.0, -half], np.column_stack([np.full_like(rings, radius), rings]), [0.0, half]])
        solid = creation.revolve(outline, sections=64)
    elif kind == int(kinds.mjGEOM_CAPSULE):
        solid = creation.capsule(height=float(2 * size[1]), radius=float(size[0]), count=[64, 64])
        solid.apply_translation(-solid.bounds.mean(axis=0))
    else:
        return None
    return np.asarray(solid.vertices, dtype=float), np.asarray(solid.faces, dtype=np.int64)


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale a vector to unit length; zero stays zero."""
    return vector / max(float(np.linalg.norm(vector)), 1e-12)


def planes(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit normals n and offsets d of a convex solid's faces: a point x is inside if x @ n <= d for all."""
    from trimesh.triangles import normals

    corners = vertices[faces]
    outward, whole = normals(corners)
    return outward, np.sum(outward * corners[whole, 0], axis=1)


def hull(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices and outward faces of the convex hull of ``(N, 3)`` points."""
    from trimesh.triangles import cross

    hull = ConvexHull(vertices, qhull_options="QJ Pp")
    faces = hull.simplices.astype(np.int64)
    corners = vertices[faces]
    inward = np.sum(cross(corners) * hull.equations[:, :3], axis=1) < 0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces
