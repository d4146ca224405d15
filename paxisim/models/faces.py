"""Faces: find the flat part of a finger that faces a given direction, on its collision geoms.

The collision surface of a link is a set of small triangles (`paxisim.models.surfaces`). Seen from one direction, only
the foremost triangle of each cell counts, as in a depth image, and the face is the plane with the largest area within
`FACE_DEPTH` of it, in one piece or in pieces near one another (`find_face`).

Conventions: lengths in m; points and normals in the frame of the link, which is a body together with the bodies
welded to it; "height" is measured along the face's outward normal.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import ConvexHull

from paxisim.models.surfaces import Surface, hull, unit

FACE_DEPTH = 1e-3
"""Depth (m) within which a curved surface counts as one face."""
ROOM = 3.5e-3
"""Room (m) that a pad needs behind its plane: the thickness of the default gel, into which an object may sink, and the
bumps of its surface."""
STEPS = 2.5e-3
"""Largest depth (m) of the steps of one face."""

_STEP = 0.15e-3  # a parallel surface further back belongs to another face
_COS_PARALLEL = np.cos(np.radians(3))
_SHARE = 0.2  # the face is the foremost plane with at least this share of the largest plane's area
_FILL = 0.6  # a face fills at least this share of its rectangle, or it scores less
_PATCHES = 0.45  # patches of one face fill at least this share of theirs, as four boxes at its corners do
_SQUARE = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
_COS_TILT = np.cos(np.radians(40))  # a triangle tilted more does not belong to the face
_COS_STEP = np.cos(np.radians(15))  # and the same for a stepped face
_COS_SEARCH = np.cos(np.radians(55))  # largest angle between a face's normal and the requested direction


@dataclass(frozen=True, eq=False)
class Face:
    """A face of a link.

    Attributes:
        center: Centre of the face on its plane, link frame.
        frame: ``(3, 3)`` columns x, y, z of the pad frame in the link frame; z points into the link.
        size: Extent along y and along x.
        fill: Share of that rectangle that lies within `FACE_DEPTH` of the plane.
        flatness: Largest distance of the face behind its plane, at most `FACE_DEPTH`, or `STEPS` if it has steps.
        geoms: Geoms that would shadow a pad on the face (`shadowing`): first the visible ones, by decreasing area,
            then those hidden closely behind.
    """

    center: NDArray[np.float64]
    frame: NDArray[np.float64]
    size: tuple[float, float]
    fill: float
    flatness: float
    geoms: tuple[int, ...]


def find_face(
    surface: Surface,
    direction: NDArray[np.float64],
    base: NDArray[np.float64],
    where: NDArray[np.bool_] | None = None,
    steps: bool = False,
) -> Face | None:
    """Find the face of `surface` that faces `direction`.

    The candidates are directions within 55 degrees of `direction` in which the surface or its convex hull has area: a
    flat object rests on the hull, also where the surface is stepped. The face is the candidate whose plane has the
    largest area, in one piece or in pieces near one another. Area counts more with its distance from the finger's base,
    and is weighted by the squared cosine of the angle to `direction`. A bonus for `direction` itself decides on round
    fingers. Finally, the normal is refined to the mean normal of that area.

    Args:
        surface: Surface of the link.
        direction: ``(3,)`` direction of the outward normal, link frame; need not be of unit length.
        base: ``(3,)`` point at the base of the finger: y points from there to the face.
        where: ``(N,)`` triangles that may belong to the face; default: all.
        steps: Whether the face may have steps along the finger: its plane then rests on their edges.

    Returns:
        The face, or None if no part of the surface faces that way.
    """
    goal = unit(direction)
    part = surface if where is None else _part(surface, where)
    if not len(part.normals):
        return None
    distance = np.linalg.norm(part.points - base, axis=1)
    weights = 0.1 + (distance - distance.min()) / max(float(np.ptp(distance)), 1e-9)
    regions = [
        (region.score(float(normal @ goal)) * (1.0 if k == 0 else 0.8), k, normal, stepped, region)
        for k, (normal, stepped) in enumerate(_candidates(part, goal, base if steps else None))
        if (region := _region(part, normal, weights, STEPS if stepped else None)) is not None
    ]
    if not regions:
        return None
    score, _, normal, stepped, region = max(regions, key=lambda r: (r[0], -r[1]))
    for _ in range(0 if stepped else 6):
        mean = unit(part.normals[region.members].mean(axis=0))
        refined = _region(part, mean, weights, None)
        if refined is None or refined.score(float(mean @ goal)) < 0.7 * score:
            break
        converged = float(mean @ normal) > np.cos(np.radians(0.05))
        normal, region = mean, refined
        score = max(score, region.score(float(mean @ goal)))
        if converged:
            break
    return _fit(part, normal, region, base, surface, stepped)


@dataclass(frozen=True, eq=False)
class _Region:
    """Triangles of a depth image that form one plane.

    Attributes:
        members: Indices of the triangles.
        area: Their weighted area.
        fill: Share of the smallest rectangle around them that they fill.
        height: Height of the plane.
    """

    members: NDArray[np.int64]
    area: float
    fill: float
    height: float

    def score(self, cosine: float) -> float:
        """Return how well the region serves as a face, if its normal has this cosine to the wanted one."""
        return self.area * cosine**2 * min(1.0, self.fill / _FILL)


def _part(surface: Surface, keep: NDArray[np.bool_]) -> Surface:
    return replace(surface, triangles=surface.triangles[keep], normals=surface.normals[keep], geoms=surface.geoms[keep])


def _candidates(
    surface: Surface, goal: NDArray[np.float64], base: NDArray[np.float64] | None, most: int = 10
) -> Iterator[tuple[NDArray[np.float64], bool]]:
    """Yield `goal` and the normals of the largest facets within 55 degrees of it, some degrees apart.

    The facets are those of the surface. If `base` is given, the point from which the finger reaches out, those of its
    convex hull follow with True: the hull rests on the edges of steps along the finger.
    """
    yield goal, False
    seen: list[NDArray[np.float64]] = []
    facets = [(surface.triangles, False)]
    if base is not None:
        vertices, faces = hull(surface.triangles.reshape(-1, 3))
        facets.append((vertices[faces], True))
    for triangles, stepped in facets:
        normals, weights = _facets(triangles, goal)
        if stepped and base is not None:
            normals = _without(normals, unit(np.cross(goal, surface.points.mean(axis=0) - base)))
        apart = np.cos(np.radians(3 if stepped else 8))
        for mean in seen:
            normals, weights = _apart(mean, normals, weights, apart)
        for _ in range(most):
            if not weights.sum() > 0:
                break
            mean = _largest_facet(normals, weights)
            seen.append(mean)
            yield mean, stepped
            normals, weights = _apart(mean, normals, weights, apart)


def _facets(
    triangles: NDArray[np.float64], goal: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the normals and areas of the triangles within 55 degrees of `goal`."""
    from trimesh.triangles import area, cross, normals

    crosses = cross(triangles)
    found, whole = normals(crosses=crosses)
    facing = found @ goal > _COS_SEARCH
    return found[facing], area(crosses=crosses[whole])[facing]


def _largest_facet(normals: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean normal of those that agree to two digits and together weigh most."""
    keys, index = np.unique(np.round(normals, 2), axis=0, return_inverse=True)
    totals = np.bincount(index.ravel(), weights=weights, minlength=len(keys))
    facet = index.ravel() == int(totals.argmax())
    return unit(np.sum(normals[facet] * weights[facet, None], axis=0))


def _without(normals: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit vectors of what is left of `normals` across `axis`."""
    across = normals - np.outer(normals @ axis, axis)
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def _apart(
    mean: NDArray[np.float64], normals: NDArray[np.float64], weights: NDArray[np.float64], cosine: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rest = normals @ mean < cosine
    return normals[rest], weights[rest]


def _plane_axes(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return two unit vectors that span the plane, ``(3, 2)``."""
    a = np.eye(3)[int(np.abs(normal).argmin())]
    u = unit(np.cross(normal, a))
    return np.stack([u, np.cross(normal, u)], axis=1)


def _region(
    surface: Surface, normal: NDArray[np.float64], weights: NDArray[np.float64], depth: float | None
) -> _Region | None:
    """Return the foremost plane normal to `normal` with at least `_SHARE` of the largest plane's visible area.

    A mostly flat plane ends where the surface bends; a curved one reaches `FACE_DEPTH` back. A stepped one reaches
    `depth` back.
    """
    cell = 1.5 * surface.edge
    points = surface.points
    axes = _plane_axes(normal)
    heights, flat = points @ normal, points @ axes
    low, high = flat.min(axis=0), flat.max(axis=0)
    index = np.floor((flat - (low + high) / 2) / cell).astype(np.int64)  # symmetric, so that normals do not drift
    index -= index.min(axis=0)
    shape = (int(index[:, 0].max()) + 1, int(index[:, 1].max()) + 1)
    key = index[:, 0] * shape[1] + index[:, 1]
    order = np.lexsort((heights, key))
    top = order[np.append(np.diff(key[order]) > 0, True)]  # the foremost triangle of each cell
    top = top[surface.normals[top] @ normal > (_COS_TILT if depth is None else _COS_STEP)]
    if not len(top):
        return None
    parallel = surface.normals[top] @ normal > _COS_PARALLEL

    def largest_patch(chosen: NDArray[np.int64]) -> NDArray[np.int64]:
        image = np.zeros(shape)
        image.flat[key[chosen]] = weights[chosen]
        labels, count = ndimage.label(image, structure=np.ones((3, 3)))  # type: ignore[misc]
        labels = np.asarray(labels, dtype=np.int64)
        winner = int(np.argmax(ndimage.sum_labels(image, labels, np.arange(1, count + 1)))) + 1
        return chosen[np.isin(labels.flat[key[chosen]], _near_patches(labels, winner))]

    reach = np.where(parallel, _STEP, FACE_DEPTH) if depth is None else np.full(len(top), depth)

    levels: list[tuple[float, NDArray[np.int64]]] = []  # weighted area and members, foremost first
    most = 0.0
    for ceiling in np.unique(np.ceil(heights[top] / 5e-5))[::-1] * 5e-5:
        behind = ceiling - heights[top]
        inside = top[(behind >= 0) & (behind < reach)]
        if weights[inside].sum() <= most:
            continue
        members = largest_patch(inside)
        area = float(weights[members].sum())
        if area > most * 1.001:
            most = area
            levels.append((area, members))
    members = next(members for area, members in levels if area >= _SHARE * most)
    straight = surface.normals[members] @ normal > _COS_PARALLEL
    if depth is None and straight.mean() > 0.5:
        members = largest_patch(members[straight])
    height = float((surface.triangles[members] @ normal).max())
    around = _smallest_rectangle(surface.triangles[members].reshape(-1, 3) @ axes)
    fill = min(1.0, len(members) * cell**2 / max(around, 1e-12))
    return _Region(members, float(weights[members].sum()) * cell**2, fill, height)


def _smallest_rectangle(points: NDArray[np.float64]) -> float:
    """Return the area of the smallest rectangle around ``(N, 2)`` points."""
    _, spans = _rectangles(points)
    return float(spans.prod(axis=1).min())


def _near_patches(labels: NDArray[np.int64], first: int) -> list[int]:
    """Return the patches of an image that lie no further from `first`, or from one of them, than they are long.

    Together they fill at least `_PATCHES` of the smallest rectangle around them.
    """
    boxes = ndimage.find_objects(labels)
    low = np.array([[side.start for side in box] for box in boxes])
    high = np.array([[side.stop for side in box] for box in boxes])
    chosen, waiting = [first], [first]
    while waiting:
        this = waiting.pop() - 1
        gap = np.linalg.norm(np.maximum(0, np.maximum(low - high[this], low[this] - high)), axis=1)
        reach = np.minimum((high - low).max(axis=1), (high - low)[this].max())
        found = [k + 1 for k in np.flatnonzero(gap <= reach).tolist() if k + 1 not in chosen]
        chosen += found
        waiting += found
    while len(chosen) > 1:
        cells = np.argwhere(np.isin(labels, chosen))
        corners = (cells[:, None] + _SQUARE).reshape(-1, 2).astype(float)
        if len(cells) >= _PATCHES * _smallest_rectangle(corners):
            break
        middle = (low[first - 1] + high[first - 1]) / 2
        chosen.remove(max(chosen[1:], key=lambda k: float(np.linalg.norm((low[k - 1] + high[k - 1]) / 2 - middle))))
    return chosen


def _fit(
    surface: Surface,
    normal: NDArray[np.float64],
    region: _Region,
    base: NDArray[np.float64],
    whole: Surface,
    stepped: bool,
) -> Face:
    """Turn a region into a rectangle with a frame; `whole` is the surface of the link, of which `surface` is a part."""
    corners = surface.triangles[region.members].reshape(-1, 3)
    # edges in the depth image are off by up to a cell: include neighbours on the same plane
    tops = surface.triangles @ normal
    facing = surface.normals @ normal
    depth = STEPS if stepped else np.where(facing > _COS_PARALLEL, _STEP, FACE_DEPTH)
    straight = bool(np.all(facing[region.members] > _COS_PARALLEL))
    level = (facing > (_COS_STEP if stepped else _COS_PARALLEL if straight else _COS_TILT)) & (
        tops.min(axis=1) > region.height - depth
    )
    level &= tops.max(axis=1) < region.height + 1e-9
    axes = _plane_axes(normal)
    flat = corners @ axes
    margin = 1.5 * surface.edge
    inside = np.all(
        np.abs(surface.points @ axes - (flat.max(0) + flat.min(0)) / 2) < np.ptp(flat, axis=0) / 2 + margin, 1
    )
    corners = np.concatenate([corners, surface.triangles[level & inside].reshape(-1, 3)])
    y = _row_axis(corners @ axes, (corners.mean(axis=0) - base) @ axes)
    y = axes @ y
    frame = np.stack([np.cross(y, -normal), y, -normal], axis=1)
    local = corners @ frame
    low, high = local[:, :2].min(axis=0), local[:, :2].max(axis=0)
    extent = high - low
    middle = frame @ np.array([*(low + high) / 2, -region.height])
    size = (float(extent[1]), float(extent[0]))
    seen, areas = np.unique(surface.geoms[region.members], return_counts=True)
    visible = [int(g) for g in seen[np.lexsort((seen, -areas))]]
    hidden = [g for g in shadowing(whole, middle, frame, size) if g not in visible]
    return Face(
        center=middle,
        frame=frame,
        size=size,
        fill=min(1.0, len(region.members) * (1.5 * surface.edge) ** 2 / (size[0] * size[1])),
        flatness=float(region.height - (corners @ normal).min()),
        geoms=(*visible, *hidden),
    )


def _row_axis(flat: NDArray[np.float64], outward: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the axis of the smallest rectangle around `flat` that is within 45 degrees of `outward`.

    If all rectangles are about equally small, this is `outward` itself. If `outward` is very short, it is the longer
    side of the rectangle.
    """
    angles, spans = _rectangles(flat)
    best = int(spans.prod(axis=1).argmin())
    angle, span = angles[best], spans[best]
    length = float(np.linalg.norm(outward))
    if length < 0.2 * float(span.max()):
        angle += np.pi / 2 if span[1] > span[0] else 0.0
        axis = np.array([np.cos(angle), np.sin(angle)])
        return axis if axis @ outward >= 0 else -axis
    if _rectangles(flat, np.linspace(0, np.pi / 2, 16))[1].prod(axis=1).max() < 1.15 * span.prod():
        return outward / length
    along = np.arctan2(outward[1], outward[0])
    angle += np.round((along - angle) / (np.pi / 2)) * np.pi / 2
    return np.array([np.cos(angle), np.sin(angle)])


def _rectangles(
    points: NDArray[np.float64], angles: NDArray[np.float64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the extents ``(n, 2)`` of ``(N, 2)`` points along axes turned by `angles` (rad).

    Default angles: those of the edges of the points' convex hull, one of which belongs to the smallest rectangle.
    """
    outline = points[ConvexHull(points, qhull_options="QJ Pp").vertices]
    if angles is None:
        edges = np.roll(outline, -1, axis=0) - outline
        angles = np.unique(np.round(np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2), 6))
    axes = np.stack([np.cos(angles), np.sin(angles), -np.sin(angles), np.cos(angles)]).T.reshape(-1, 2, 2)
    return angles, np.ptp(axes @ outline.T, axis=-1)


def shadowing(
    surface: Surface,
    center: NDArray[np.float64],
    frame: NDArray[np.float64],
    size: tuple[float, float],
    depth: float = ROOM,
) -> tuple[int, ...]:
    """Return the geoms under the area of a pad that reach to within `depth` behind its plane, or beyond the plane.

    Args:
        surface: Surface of the link.
        center: ``(3,)`` centre of the pad, link frame.
        frame: ``(3, 3)`` pad frame in the link frame, columns x, y, z.
        size: Extent of the pad along y and along x.
        depth: Room that a pad needs behind its plane, for the gel and the bumps of its surface.

    Returns:
        Geom ids in ascending order.
    """
    local = (surface.triangles.reshape(-1, 3) - center) @ frame
    hit = (np.abs(local[:, 0]) < size[1] / 2) & (np.abs(local[:, 1]) < size[0] / 2) & (local[:, 2] < depth)
    return tuple(int(g) for g in np.unique(surface.geoms[hit.reshape(-1, 3).any(axis=1)]))
