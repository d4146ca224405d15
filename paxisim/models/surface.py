"""Surface: how thick each taxel cube is, so how far it stands out towards the object.

Every function returns heights as cube thickness in m, ``(rows, cols)``, for `Pad(heights=...)` before
compilation or `set_surface` after it. A cube keeps its back; a thicker one stands out further.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

DEVIATION_RANGE = (1.0, 3.0)
"""Range of the bump's deviations, in taxels (paper, Table I)."""


def flat(layout: TaxelLayout, thickness: float = 1e-3) -> NDArray[np.floating]:
    """Every cube `thickness` (m) thick: ``(rows, cols)``."""
    return np.full((layout.rows, layout.cols), float(thickness))


@dataclass(frozen=True)
class GaussianBump:
    """The paper's surface: cube depth grows with the distance from a centre (Method, "Surface with Gaussian Bumps").

    ``h = h_min + D / max(D) * (h_max - h_min)`` with
    ``D = sqrt((g_x - x)^2 / s_x^2 + (g_y - y)^2 / s_y^2)``; then taxels on the grid's edge lose `boundary`.
    Taxel (row, col) has ``x = col + 0.5, y = row + 0.5``, so that [0, cols] x [0, rows] is the paper's
    domain (its [0, 5] x [0, 6] on the 6x5 grid) with the taxels centred in it. As D is divided by its maximum,
    only the ratio of the deviations matters.

    Attributes:
        center: ``(g_x, g_y)`` in taxels, x along the columns.
        deviation: ``(s_x, s_y)`` in taxels.
        h_min: Depth at the centre (m). The paper leaves `h_min`, `h_max` and `boundary` open. Ours: 0.2 mm of
            bump around its nominal 1 mm, of the order of the indentation of the default gel (0.3 mm under 5 N
            on the paper's pad), so that a flat load reaches most taxels, very unevenly.
        h_max: Depth at the taxel furthest from the centre (m).
        boundary: What edge taxels lose (m); half the bump, so that the edge reads less, as the paper observes.
        depth_is: What the paper's "depth" means: ``"thickness"`` of the cube (its cubes are W x H x D), so that
            the centre is a dip, or ``"recess"`` below the highest point, so that the centre is a bump of the
            same range.

    Raises:
        InvalidValueError: A value that is not finite, a depth or deviation that is not positive, `h_max` below
            `h_min`, a `boundary` outside ``[0, h_min)``, or an unknown reading of depth.
    """

    center: tuple[float, float]
    deviation: tuple[float, float] = (2.0, 2.0)
    h_min: float = 0.9e-3
    h_max: float = 1.1e-3
    boundary: float = 0.1e-3
    depth_is: Literal["thickness", "recess"] = "thickness"

    def __post_init__(self) -> None:
        """Check the values."""
        values = [*self.center, *self.deviation, self.h_min, self.h_max, self.boundary]
        if not np.all(np.isfinite(values)):
            raise InvalidValueError(f"a bump's parameters must be finite, got {self}")
        if min(self.deviation) <= 0 or not 0 < self.h_min <= self.h_max:
            raise InvalidValueError(
                f"a bump needs positive deviations and 0 < h_min <= h_max, got {self.deviation}, "
                f"{self.h_min:g} and {self.h_max:g}"
            )
        if not 0 <= self.boundary < self.h_min:
            raise InvalidValueError(f"boundary must lie in [0, h_min), got {self.boundary:g}")
        if self.depth_is not in ("thickness", "recess"):
            raise InvalidValueError(f"depth_is must be 'thickness' or 'recess', got {self.depth_is!r}")

    @classmethod
    def sample(cls, layout: TaxelLayout, rng: np.random.Generator, **fixed) -> GaussianBump:
        """Draw a bump as the paper does: the centre uniform over the grid, the deviations from U(1, 3) (Table I).

        Args:
            layout: The taxels.
            rng: Source of randomness.
            **fixed: Fields to set instead, e.g. ``h_max=1.2e-3``.
        """
        drawn = {
            "center": tuple(rng.uniform(0, [layout.cols, layout.rows])),
            "deviation": tuple(rng.uniform(*DEVIATION_RANGE, size=2)),
        }
        return cls(**(drawn | fixed))

    def heights(self, layout: TaxelLayout) -> NDArray[np.floating]:
        """Cube thickness (m), ``(rows, cols)``.

        Layouts without a grid use their positions, in units of the pitch from the upper left corner, and have
        no boundary.
        """
        is_grid = layout.rows > 1 and layout.cols > 1
        x, y = _taxel_coordinates(layout, is_grid)
        (gx, gy), (sx, sy) = self.center, self.deviation
        distance = np.sqrt((gx - x) ** 2 / sx**2 + (gy - y) ** 2 / sy**2)
        furthest = distance.max()
        share = distance / furthest if furthest > 0 else np.zeros_like(distance)
        depth = self.h_min + share * (self.h_max - self.h_min)
        if is_grid:
            edge = np.ones(depth.shape, dtype=bool)
            edge[1:-1, 1:-1] = False
            depth[edge] -= self.boundary
        if self.depth_is == "thickness":
            return depth
        return self.h_min + self.h_max - depth


def _taxel_coordinates(layout: TaxelLayout, is_grid: bool) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    if is_grid:
        rows, cols = np.indices((layout.rows, layout.cols))
        return cols + 0.5, rows + 0.5
    corner = layout.positions.min(axis=0)
    x, y = ((layout.positions - corner)[:, :2] / [layout.pitch[1], layout.pitch[0]] + 0.5).T
    shape = (layout.rows, layout.cols)
    return x.reshape(shape), y.reshape(shape)


def measured(layout: TaxelLayout, height_map: ArrayLike, thickness: float = 1e-3) -> NDArray[np.floating]:
    """Cube thickness (m), ``(rows, cols)``, from a measured height map of the sensing surface.

    Args:
        layout: The taxels, a grid.
        height_map: ``(H, W)`` heights (m) that cover the pad's extent, first row at the top, first column at
            the left, larger towards the object; H, W at least rows, cols. Averaged over each taxel's area;
            only differences matter, the mean becomes `thickness`.
        thickness: Mean thickness (m).

    Raises:
        InvalidValueError: A map that is not finite, not 2-D, coarser than the grid, or so uneven that a cube
            would vanish.
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


def _area_means(values: NDArray[np.floating], bins: int) -> NDArray[np.floating]:
    """Means of ``(n, ...)`` over `bins` equal stretches of the first axis, fractions of a sample included."""
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    edges = np.linspace(0, len(values), bins + 1)
    whole = np.minimum(edges.astype(int), len(values) - 1)
    at_edges = total[whole] + (edges - whole)[:, None] * values[whole]
    return np.diff(at_edges, axis=0) / (len(values) / bins)


def conform(layout: TaxelLayout, mesh, *, max_angle: float = 75.0) -> TaxelLayout:
    """The layout laid onto a curved surface: taxels projected along z, each facing along the surface's normal.

    Args:
        layout: A flat layout.
        mesh: The finger's surface in the pad frame (m): a ``trimesh.Trimesh`` or the path of a mesh file. Each
            taxel is projected along +z (into the pad) onto the first surface that faces the object.
        max_angle: Largest angle (deg) between a taxel's normal and the pad's; beyond it the surface cannot be
            pressed from the front.

    Returns:
        A layout of the same rows, columns and pitch with explicit positions and normals, in the pad frame.

    Raises:
        InvalidValueError: The file cannot be read, or a taxel misses the surface or meets it too steeply.
    """
    import trimesh

    if isinstance(mesh, (str, Path)):
        try:
            mesh = trimesh.load_mesh(mesh)
        except Exception as error:  # trimesh raises whatever the format's parser does
            raise InvalidValueError(f"cannot read the mesh {mesh}: {error}") from error
    depth, triangles = _first_facing(layout.positions[:, :2], mesh)
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
    return TaxelLayout(layout.rows, layout.cols, layout.pitch, positions, normals, layout.vendor_order)


def _first_facing(points: NDArray[np.floating], mesh) -> tuple[NDArray[np.floating], NDArray[np.int64]]:
    """Where rays along +z through ``(N, 2)`` points first meet a triangle that faces them.

    Returns:
        Depth z ``(N,)`` (m) and triangle ``(N,)``, -1 where there is none.
    """
    facing = np.flatnonzero(mesh.face_normals[:, 2] < -1e-6)
    corners = mesh.triangles[facing]
    a, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    depth, triangle = np.zeros(len(points)), np.full(len(points), -1)
    for index, point in enumerate(points):  # one at a time: points x triangles may not fit the memory
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
    """Normals interpolated between a triangle's corners, so that a coarse mesh does not show as steps."""
    import trimesh

    weights = trimesh.triangles.points_to_barycentric(mesh.triangles[triangles], points)
    normals = np.einsum("nk,nki->ni", weights, mesh.vertex_normals[mesh.faces[triangles]])
    # across a sharp edge the corners' normals lie, the face's own does not
    flat_normals = mesh.face_normals[triangles]
    sharp = np.sum(normals * flat_normals, axis=1) < np.cos(np.radians(30)) * np.linalg.norm(normals, axis=1)
    normals[sharp] = flat_normals[sharp]
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)
