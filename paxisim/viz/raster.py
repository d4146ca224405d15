"""Raster: picture of a model's geoms from one direction, shaded and with depth, without a graphics driver.

Lengths in m. A view is a ``(3, 3)`` matrix whose rows point right, up and towards the viewer in the world frame; depth
grows towards the viewer. The projection is orthographic.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.models.surfaces import shape_of

_GREY, _INK = np.array([0.80, 0.82, 0.86]), np.array([0.25, 0.27, 0.3])
_LIGHT = np.array([-0.35, 0.55, 0.76])  # right, up, towards the viewer
_AT_ONCE = 2_000_000  # pairs of a triangle and a pixel
_SHOWN = 3  # groups of geoms below this one are shown by default
_FLAT = 1e-9  # square pixels; triangles seen edge-on cover nothing
_EDGE = 0.012  # jump in depth that is drawn as a line, as a share of the picture's size


@dataclass(frozen=True, eq=False)
class Picture:
    """Shaded picture of triangles.

    Attributes:
        view: ``(3, 3)`` view.
        center: ``(2,)`` right and up of the middle.
        half: Half the width and height.
        rgba: ``(pixels, pixels, 4)`` colours in 0..1, lowest row first; transparent where there is nothing.
        depth: ``(pixels, pixels)`` depth; -inf where there is nothing.
    """

    view: NDArray[np.float64]
    center: NDArray[np.float64]
    half: float
    rgba: NDArray[np.float64]
    depth: NDArray[np.float64]

    def covered(self, points: NDArray[np.float64], margin: float) -> NDArray[np.bool_]:
        """Tell which points, ``(N, 3)`` in the world frame, lie more than `margin` behind what is drawn."""
        pixels = len(self.depth)
        at = ((points @ self.view[:2].T - self.center) / self.half + 1) / 2 * pixels
        column, row = np.clip(at.astype(int), 0, pixels - 1).T
        return self.depth[row, column] > points @ self.view[2] + margin


def triangles_of(
    model: mujoco.MjModel, data: mujoco.MjData, *, without: Collection[int], replaced: Collection[int]
) -> NDArray[np.float64]:
    """Return the corners of everything visible, ``(n, 3, 3)`` in the world frame.

    A body that has meshes which touch nothing, only for looks, is drawn with these instead of its collision geoms. A
    collision geom is drawn with them if it is for looks too: if MuJoCo shows its group and it has its own material.

    Args:
        model: Compiled model.
        data: Its data, with the kinematics computed.
        without: Ids of bodies to omit.
        replaced: Ids of geoms that collide no longer, since pads replace them.
    """
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0) | np.isin(np.arange(model.ngeom), [*replaced])
    is_mesh = model.geom_type == int(mujoco.mjtGeom.mjGEOM_MESH)
    looks = is_mesh & ~collides
    dressed = np.isin(model.geom_bodyid, model.geom_bodyid[looks])
    worn = set(zip(model.geom_bodyid[looks].tolist(), model.geom_matid[looks].tolist(), strict=True))
    wears = zip(model.geom_bodyid.tolist(), model.geom_matid.tolist(), strict=True)
    own = np.array([material >= 0 and (body, material) not in worn for body, material in wears], dtype=bool)
    drawn = ~(collides & dressed & ~(own & (model.geom_group < _SHOWN))) & ~np.isin(model.geom_bodyid, [*without])
    triangles = [np.zeros((0, 3, 3))]
    for geom in np.flatnonzero(drawn):
        shape = _mesh(model, int(model.geom_dataid[geom])) if is_mesh[geom] else shape_of(model, int(geom))
        if shape is not None:
            vertices, faces = shape
            triangles.append((vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])[faces])
    return np.concatenate(triangles)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    return np.array(model.mesh_vert[vertices], dtype=float), np.array(model.mesh_face[faces], dtype=np.int64)


def render(
    triangles: NDArray[np.float64],
    view: NDArray[np.float64],
    center: NDArray[np.float64],
    half: float,
    pixels: int,
    nearest: float = np.inf,
) -> Picture:
    """Draw triangles with a depth buffer.

    Args:
        triangles: ``(n, 3, 3)`` corners, world frame.
        view: ``(3, 3)`` view.
        center: ``(2,)`` right and up of the middle.
        half: Half the width and height.
        pixels: Width and height in pixels.
        nearest: Largest depth that is drawn.
    """
    seen = triangles @ view.T
    corners = ((seen[:, :, :2] - center) / half + 1) / 2 * pixels - 0.5  # in pixels, whole at their middles
    low = np.maximum(np.ceil(corners.min(axis=1)), 0).astype(int)
    high = np.minimum(np.floor(corners.max(axis=1)), pixels - 1).astype(int)
    extent = high - low + 1
    kept = np.flatnonzero(np.all(extent > 0, axis=1))
    depth, owner = np.full(pixels * pixels, -np.inf), np.full(pixels * pixels, -1)
    count = np.prod(extent[kept], axis=1)
    for part in np.split(kept, np.flatnonzero(np.diff(np.cumsum(count) // _AT_ONCE)) + 1):
        _draw(part, corners, seen[:, :, 2], low, extent, pixels, nearest, depth, owner)
    return Picture(view, center, half, _shade(seen, owner, depth, half, pixels), depth.reshape(pixels, pixels))


def _draw(part, corners, depths, low, extent, pixels, nearest, depth, owner) -> None:
    """Draw the triangles of one part into the buffers `depth` and `owner`, ``(pixels ** 2,)``."""
    # twice the area of the triangles
    a, b, c = (corners[part, i] for i in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    part, area = part[np.abs(area) > _FLAT], area[np.abs(area) > _FLAT]
    size = extent[part]
    each = np.prod(size, axis=1)
    which = np.repeat(np.arange(len(part)), each)
    step = np.arange(len(which)) - np.repeat(np.cumsum(each) - each, each)
    width = size[which, 0]
    x, y = low[part, 0][which] + step % width, low[part, 1][which] + step // width
    # weights of the second and third corner and the depth are linear in x and y
    a, b, c = (corners[part, i] for i in range(3))
    first, second = b - a, c - a
    v = np.stack([second[:, 1], -second[:, 0]], axis=1) / area[:, None]
    w = np.stack([-first[:, 1], first[:, 0]], axis=1) / area[:, None]
    rise = depths[part, 1:] - depths[part, :1]
    slope = v * rise[:, :1] + w * rise[:, 1:]
    for gradient, constant in ((v, 0), (w, 0), (-v - w, 1)):
        offset = constant - np.sum(gradient * a, axis=1)
        inside = gradient[which, 0] * x + gradient[which, 1] * y + offset[which] >= 0
        x, y, which = x[inside], y[inside], which[inside]
    z = depths[part, 0][which] + slope[which, 0] * (x - a[which, 0]) + slope[which, 1] * (y - a[which, 1])
    seen = z <= nearest
    pixel, z, which = (y * pixels + x)[seen], z[seen], part[which[seen]]
    np.maximum.at(depth, pixel, z)
    front = z == depth[pixel]
    owner[pixel[front]] = which[front]


def _shade(seen, owner, depth, half, pixels) -> NDArray[np.float64]:
    rgba = np.zeros((pixels * pixels, 4))
    filled = np.flatnonzero(owner >= 0)
    corners = seen[owner[filled]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20)
    normal *= np.where(normal[:, 2:] < 0, -1, 1)  # some meshes have faces that point inwards
    bright = 0.5 + 0.5 * np.clip(normal @ _LIGHT, 0, 1)
    rgba[filled, :3], rgba[filled, 3] = _GREY * bright[:, None], 1
    grid = np.where(np.isinf(depth), -1e3, depth).reshape(pixels, pixels)
    behind = np.zeros_like(grid)
    behind[:, 1:] = np.maximum(behind[:, 1:], grid[:, 1:] - grid[:, :-1])
    behind[:, :-1] = np.maximum(behind[:, :-1], grid[:, :-1] - grid[:, 1:])
    behind[1:] = np.maximum(behind[1:], grid[1:] - grid[:-1])
    behind[:-1] = np.maximum(behind[:-1], grid[:-1] - grid[1:])
    edges = (behind > _EDGE * half).reshape(-1) & (owner >= 0)
    rgba[edges, :3] = _INK
    return rgba.reshape(pixels, pixels, 4)
