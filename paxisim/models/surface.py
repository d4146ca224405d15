"""Surface: thickness of each taxel cube, and layouts on curved surfaces.

Heights are the thickness of the cubes in m, ``(rows, cols)``, for `Pad(heights=...)` before compilation or
`set_surface` after it. The back of a cube is fixed, so a thicker cube stands out further towards the object.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.bump import GaussianBump as GaussianBump
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

_SHARP_EDGE = 30.0  # deg; an edge between triangles of a mesh with a larger angle is sharp, not rounded


MAX_HEIGHT = 0.1
"""Largest thickness of a taxel (m)."""


def flat(layout: TaxelLayout, thickness: float = 1e-3) -> NDArray[np.floating]:
    """Return the heights of a flat surface, ``(rows, cols)``: every cube is `thickness` (m) thick.

    Raises:
        InvalidValueError: The thickness is not positive and at most `MAX_HEIGHT`.
    """
    return check_heights(np.full((layout.rows, layout.cols), float(thickness)), layout)


def heights_from_map(layout: TaxelLayout, height_map: ArrayLike, thickness: float = 1e-3) -> NDArray[np.floating]:
    """Return cube thickness (m), ``(rows, cols)``, from a measured height map of the sensing surface.

    Args:
        layout: Layout of the taxels, a grid.
        height_map: ``(H, W)`` heights (m) that cover the pad's extent, with the first row at the top and the first
            column at the left; larger values are closer to the object. H and W are at least rows and cols. The heights
            are averaged over the area of each taxel. Only differences matter; the mean becomes `thickness`.
        thickness: Mean thickness (m).

    Raises:
        InvalidValueError: The map is not finite, not 2-D, coarser than the grid, or so uneven that a cube would vanish.
    """
    heights = np.asarray(height_map, dtype=np.float64)
    if heights.ndim != 2 or heights.shape[0] < layout.rows or heights.shape[1] < layout.cols:
        raise InvalidValueError(
            f"expected a height map of at least {layout.rows}x{layout.cols}, got shape {heights.shape}"
        )
    if not np.all(np.isfinite(heights)):
        raise InvalidValueError("a height map must be finite: fill the holes of the measurement first")
    mean = _area_means(_area_means(heights, layout.rows).T, layout.cols).T
    result = mean - mean.mean() + thickness
    if result.min() <= 0:
        raise InvalidValueError(
            f"the height map spans {np.ptp(mean) * 1e3:.3g} mm, more than cubes of {thickness * 1e3:g} mm can show"
        )
    return result


def check_heights(heights: NDArray[np.floating], layout: TaxelLayout) -> NDArray[np.floating]:
    """Return `heights` as ``(..., rows, cols)`` floats (m).

    Raises:
        InvalidValueError: The heights have the wrong shape, or are not positive and at most `MAX_HEIGHT`.
    """
    heights = np.asarray(heights, dtype=np.float64)
    if heights.shape[-2:] != (layout.rows, layout.cols):
        raise InvalidValueError(f"heights must have shape (..., {layout.rows}, {layout.cols}), got {heights.shape}")
    if not np.all(np.isfinite(heights)) or np.any(heights <= 0):
        raise InvalidValueError("heights must be positive and finite: they are the thickness of the cubes in m")
    if heights.size and heights.max() > MAX_HEIGHT:
        raise InvalidValueError(
            f"heights must be in m and at most {MAX_HEIGHT:g}, got {heights.max():g}: were millimetres meant?"
        )
    return heights


def _area_means(values: NDArray[np.floating], bins: int) -> NDArray[np.floating]:
    """Average ``(n, ...)`` over `bins` equal intervals of the first axis, including fractions of a sample."""
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    edges = np.linspace(0, len(values), bins + 1)
    whole = np.minimum(edges.astype(int), len(values) - 1)
    at_edges = total[whole] + (edges - whole)[:, None] * values[whole]
    return np.diff(at_edges, axis=0) / (len(values) / bins)


def conform(layout: TaxelLayout, mesh: Any, *, max_angle: float = 75.0) -> TaxelLayout:
    """Lay a flat layout onto a curved surface: project taxels along z and align them with the surface normals.

    Args:
        layout: A flat layout.
        mesh: Surface of the finger in the pad frame (m): a ``trimesh.Trimesh`` or the path of a mesh file. Each taxel
            is projected along +z (into the pad) onto the first surface that faces the object.
        max_angle: Largest angle (deg) between the normals of a taxel and of the pad. A steeper surface cannot be
            pressed from the front.

    Returns:
        A layout with the same rows, columns and pitch, and explicit positions and normals in the pad frame.

    Raises:
        InvalidValueError: The file cannot be read or has no triangles, a taxel misses the surface, or the surface is
            too steep at a taxel or between two.
    """
    import trimesh

    if isinstance(mesh, (str, Path)):
        try:
            mesh = trimesh.load_mesh(mesh)
        except Exception as error:  # trimesh passes on any error of the format's parser
            raise InvalidValueError(f"cannot read the mesh {mesh}: {error}") from error
    if not len(getattr(mesh, "faces", ())):
        raise InvalidValueError("the mesh has no triangles")
    depth, triangles = first_facing(layout.positions[:, :2], mesh)
    if np.any(triangles < 0):
        missed = int(np.argmin(triangles))
        row, col = divmod(missed, layout.cols)
        x, y = layout.positions[missed, :2] * 1e3
        raise InvalidValueError(
            f"{np.sum(triangles < 0)} of {layout.taxels} taxels miss the mesh, the first at row {row}, column {col} "
            f"(x {x:.2f} mm, y {y:.2f} mm): the mesh must be in the pad frame, in m, and cover the pad"
        )
    positions = np.column_stack([layout.positions[:, :2], depth])
    normals = _smooth_normals(mesh, positions, triangles)
    angle = np.degrees(np.arccos(np.clip(-normals[:, 2], -1, 1)))
    if angle.max() > max_angle:
        row, col = divmod(int(angle.argmax()), layout.cols)
        raise InvalidValueError(
            f"the surface at row {row}, column {col} is {angle.max():.0f} deg steep, more than {max_angle:g}"
        )
    grid = depth.reshape(layout.rows, layout.cols)
    for axis, pitch in enumerate(layout.pitch):
        step = np.abs(np.diff(grid, axis=axis))
        if step.size and step.max() > pitch * np.tan(np.radians(max_angle)):
            row, col = np.unravel_index(int(step.argmax()), step.shape)
            raise InvalidValueError(
                f"the surface steps by {1e3 * step.max():.1f} mm from the taxel at row {row}, column {col} to the next"
            )
    return TaxelLayout(layout.rows, layout.cols, layout.pitch, positions, normals, layout.vendor_order)


def first_facing(points: NDArray[np.floating], mesh) -> tuple[NDArray[np.floating], NDArray[np.int64]]:
    """Find where rays along +z through ``(N, 2)`` points first hit a triangle that faces them.

    Returns:
        Depth z ``(N,)`` (m) and index of the triangle ``(N,)``, or -1 if there is none.
    """
    facing = np.flatnonzero(mesh.face_normals[:, 2] < -1e-6)
    corners = mesh.triangles[facing]
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    depth, triangle = np.zeros(len(points)), np.full(len(points), -1)
    for index, point in enumerate(points):  # one by one: points x triangles may not fit in memory
        to = point - a[:, :2]
        s = (to[:, 0] * v[:, 1] - to[:, 1] * v[:, 0]) / area
        t = (u[:, 0] * to[:, 1] - u[:, 1] * to[:, 0]) / area
        inside = np.flatnonzero((s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9))
        if inside.size:
            z = a[inside, 2] + s[inside] * u[inside, 2] + t[inside] * v[inside, 2]
            nearest = int(z.argmin())
            depth[index], triangle[index] = z[nearest], facing[inside[nearest]]
    return depth, triangle


def _smooth_normals(mesh, points: NDArray[np.floating], triangles: NDArray[np.int64]) -> NDArray[np.floating]:
    """Interpolate normals between the corners of triangles, so that a coarse mesh does not cause steps.

    The normal of a corner is the mean over the triangles that meet there, weighted by their angles. Triangles across a
    sharp edge are excluded, so a flat face stays flat up to its rim.
    """
    import trimesh

    corners = mesh.faces[triangles]
    around = mesh.vertex_faces[corners]  # (taxels, 3, most triangles at a vertex), padded with -1
    at_corner = mesh.faces[around] == corners[:, :, None, None]
    cosine = np.einsum("ncki,ni->nck", mesh.face_normals[around], mesh.face_normals[triangles])
    meets = (around >= 0) & (cosine > np.cos(np.radians(_SHARP_EDGE)))
    angles = np.sum(mesh.face_angles[around] * at_corner, axis=-1) * meets
    of_corners = np.einsum("nck,ncki->nci", angles, mesh.face_normals[around])
    of_corners /= np.linalg.norm(of_corners, axis=-1, keepdims=True)
    weights = trimesh.triangles.points_to_barycentric(mesh.triangles[triangles], points)
    normals = np.einsum("nc,nci->ni", weights, of_corners)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
