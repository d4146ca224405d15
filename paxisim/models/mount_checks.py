"""Checks for implausible mounts: pads inside one another, beyond, behind or far from their finger, or in a wrong unit.

The finger of a pad is the body that it is mounted on together with the bodies welded to it. If that body cannot move,
the finger is its ancestors. Meshes are represented by MuJoCo's convex hulls. Lengths in m.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout
from paxisim.models import names
from paxisim.models.faces import ROOM
from paxisim.models.links import bodies_above
from paxisim.models.mount import Mount, name_for_replaces, replaced_in_model
from paxisim.models.pads import Pads, half_thickness
from paxisim.models.surface import first_facing
from paxisim.models.surfaces import planes, shape_of, surface_of

MAX_PITCH = 0.05
"""Largest plausible pitch of a taxel; a larger pitch suggests a wrong unit."""
MAX_MOUNT_DISTANCE = 0.1
"""Largest distance of a pad's centre from its finger."""
MAX_TAXEL_DISTANCE = 0.01
"""Largest distance of a taxel from the finger's surface behind it; beyond, it hangs in the air."""
MAX_GAP_IN_FRONT = 0.01
"""Largest gap between a pad and a geom of its finger in front of it; beyond, an object can come between them."""
MAX_CURVE_DISTANCE = 2e-3
"""Largest distance of a curved pad from the surface that it lies on."""
MAX_OVERHANG_SHARE = 0.25
"""Largest share of taxels that may hang in the air or leave the surface, as at the rim of a round finger."""
MIN_OVERLAP = 0.1e-3
"""Smallest overlap of two pads that counts, since pads side by side touch."""
MIN_BARE = 2e-3
"""Smallest length of a finger that a pad replaces without covering it, and that `attach` reports."""
MAX_BARE_SHARE = 1.5
"""Largest such length without a warning, over the length of the pad."""
_INSIDE = 1e-3  # a point this near to a geom counts as part of it
MAX_CHECKED_TAXELS = 200
"""Largest number of taxels to check per pad."""

AWAY = "pads away from the body they are mounted on (a mount's pos is in m, in the frame of its body)"
LARGE = "pads larger than what they sit on"
CURVED = "curved pads that do not follow the surface they sit on (paxisim.conform lays a pad onto a finger)"
HIDDEN = "pads behind other geoms, or level with them, which take their load (add these to replaces of the mount)"
INSIDE = "pads inside one another (use smaller pads or other mounts)"
BARE = (
    "fingers that no longer collide far beyond the pad, since it replaces whole geoms (use a larger pad, or leave "
    "geoms out of replaces)"
)
HUGE = "taxels larger than those of any sensor (lengths are in m)"
_OF_ONE_NUMBER = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


def doubts(model: mujoco.MjModel, pads: Pads, mounts: tuple[Mount, ...], bare: Sequence[float]) -> list[str]:
    """Return a sentence for each kind of implausible mount.

    Args:
        model: Model compiled with all its bodies and geoms, also those that touch nothing.
        pads: Pads of the model.
        mounts: Mount of each pad.
        bare: Result of `bare_lengths`.
    """
    height, width = (1e3 * length for length in pads.layout.pitch)
    found: dict[str, list[str]] = {}
    if max(height, width) > 1e3 * MAX_PITCH:
        found[HUGE] = [f"{height:g} x {width:g} mm"]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    for pad, mount in enumerate(mounts):
        finger = _finger(model, data, int(pads.bodies[pad]), mount)
        kind, how = ("", "") if finger is None else _on_finger(finger, pads.layouts[pad])
        if kind:
            found.setdefault(kind, []).append(f"{pads.names[pad]!r} on {mount.body!r}, {how}")
    touches = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    for pad, geoms in enumerate(hiding_geoms(model, pads, touches)):
        if geoms:
            words = ",".join(_word(model, geom) for geom in geoms)
            found.setdefault(HIDDEN, []).append(f"{pads.names[pad]!r} on {mounts[pad].body!r} by {words}")
    for pad, length in enumerate(bare):
        own = max(pads.layouts[pad].size)
        if length > MAX_BARE_SHARE * own:
            how = f"{1e3 * length:.0f} mm, and the pad is {1e3 * own:.0f} mm long"
            found.setdefault(BARE, []).append(f"{pads.names[pad]!r} on {mounts[pad].body!r}, {how}")
    for (first, second), depth in _overlaps(model, data, pads).items():
        both = f"{pads.names[first]!r} and {pads.names[second]!r}"
        found.setdefault(INSIDE, []).append(f"{both}, by {1e3 * depth:.1f} mm")
    return [f"{kind}: {'; '.join(where)}" for kind, where in found.items()]


def _word(model: mujoco.MjModel, geom: int) -> str:
    """Return how to refer to a geom in `Mount.replaces`."""
    word = name_for_replaces(model, geom)
    return repr(word) if word else "a geom that has no name, nor has its body: name it"


def _finger(model: mujoco.MjModel, data: mujoco.MjData, pad: int, mount: Mount) -> NDArray[np.float64] | None:
    """Return the triangles of the finger under a pad, ``(n, 3, 3)`` in the pad frame; None if it has no surface.

    They belong to the collision geoms, including those that the pad replaces.
    """
    weld = int(model.body_weldid[pad])
    welded = np.flatnonzero(model.body_weldid == weld).tolist() if weld else bodies_above(model, pad)
    touches = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    touches[replaced_in_model(model, mount)] = True
    own = [body for body in welded if not _is_pad(model, body)]
    triangles = []
    for geom in np.flatnonzero(touches & np.isin(model.geom_bodyid, own)):
        shape = shape_of(model, int(geom))
        if shape is not None:
            vertices, faces = shape
            world = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            triangles.append(((world - data.xpos[pad]) @ data.xmat[pad].reshape(3, 3))[faces])
    return np.concatenate(triangles) if triangles else None


def _is_pad(model: mujoco.MjModel, body: int) -> bool:
    return mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, names.gel(model.body(body).name)) >= 0


def _on_finger(finger: NDArray[np.float64], layout: TaxelLayout) -> tuple[str, str]:
    """Return what is wrong with a pad on its finger, and by how much; both empty if nothing is wrong."""
    import trimesh

    mesh = trimesh.Trimesh(finger.reshape(-1, 3), np.arange(3 * len(finger)).reshape(-1, 3), process=False)
    middle = layout.positions.mean(axis=0)
    offsets = middle - trimesh.triangles.closest_point(finger, np.tile(middle, (len(finger), 1)))
    distances = np.linalg.norm(offsets, axis=1)
    nearest = int(distances.argmin())
    if (
        distances[nearest] > MAX_MOUNT_DISTANCE and offsets[nearest] @ mesh.face_normals[nearest] > 0
    ):  # not inside the finger
        return AWAY, f"{1e3 * distances[nearest]:.0f} mm"
    looked_at = layout.positions[_sample(layout.taxels)]
    depth, triangle = first_facing(looked_at[:, :2], mesh)
    behind = depth - looked_at[:, 2]
    hangs = (triangle < 0) | (behind > MAX_TAXEL_DISTANCE)
    if hangs.all():  # the pad sits on something without geoms
        return "", ""
    if hangs.mean() > MAX_OVERHANG_SHARE:
        height, width = (1e3 * length for length in layout.size)
        return LARGE, f"{hangs.mean():.0%} of its {height:.3g} x {width:.3g} mm in the air"
    leaves = behind[~hangs].max() - behind[~hangs]  # the outermost taxel lies on the surface
    if not layout.is_grid and (leaves > MAX_CURVE_DISTANCE).mean() > MAX_OVERHANG_SHARE:
        return CURVED, f"by up to {1e3 * leaves.max():.1f} mm"
    return "", ""


def bare_lengths(model: mujoco.MjModel, pads: Pads, mounts: tuple[Mount, ...]) -> list[float]:
    """Return how far beyond the edges of each pad the geoms that it replaces reach where nothing collides any longer.

    Args:
        model: Model compiled with all its bodies and geoms, also those that touch nothing.
        pads: Pads of the model.
        mounts: Mount of each pad.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    touches = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    touches[pads.geoms] = False
    link = model.body_weldid[model.geom_bodyid]
    lengths = []
    for body, layout, mount in zip(map(int, pads.bodies), pads.layouts, mounts, strict=True):
        replaced = replaced_in_model(model, mount)
        if not len(replaced):
            lengths.append(0.0)
            continue
        surface = surface_of(model, data, replaced, body, cells=20)
        points = np.unique(surface.triangles.reshape(-1, 3), axis=0)
        middle = (layout.positions.min(axis=0) + layout.positions.max(axis=0))[:2] / 2
        beyond = (np.abs(points[:, :2] - middle) - np.array(layout.size[::-1]) / 2).max(axis=1)
        bare = beyond > MIN_BARE
        world = points @ data.xmat[body].reshape(3, 3).T + data.xpos[body]
        for geom in np.flatnonzero(touches & (link == model.body_weldid[body])):
            away = np.linalg.norm(world - data.geom_xpos[geom], axis=1)
            close = np.flatnonzero(bare & (away < model.geom_rbound[geom] + _INSIDE))
            shape = shape_of(model, int(geom)) if len(close) else None
            if shape is not None:
                own = (world[close] - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)
                bare[close] = ~_near(shape, own)
        lengths.append(float(beyond[bare].max(initial=0.0)))
    return lengths


def _near(shape: tuple[NDArray[np.float64], NDArray[np.int64]], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which points lie inside a convex solid or within `_INSIDE` of its faces."""
    normals, offsets = planes(*shape)
    return np.all(points @ normals.T <= offsets + _INSIDE, axis=1)


def hiding_geoms(model: mujoco.MjModel, pads: Pads, candidates: NDArray[np.bool_]) -> list[list[int]]:
    """Return the geoms that take load from each pad, because they lie in front of its surface or level with it.

    On the pad's own finger, a geom may lie up to `MAX_GAP_IN_FRONT` before the surface or reach into the `ROOM` behind
    it. A geom of another link of the gripper must reach the surface itself, in every pose.

    Args:
        model: The compiled model.
        pads: Pads of the model.
        candidates: ``(ngeom,)`` geoms that objects can touch; those of pads do not count.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    of_pads = np.isin(model.geom_bodyid, [body for body in range(model.nbody) if _is_pad(model, body)])
    tree, link = model.body_rootid[model.geom_bodyid], model.body_weldid[model.geom_bodyid]
    hiding = []
    for body, taxels in zip(pads.bodies, pads.geoms[:, _sample(pads.layout.taxels)], strict=True):
        near = candidates & ~of_pads & (tree == model.body_rootid[body])
        own = near & (link == model.body_weldid[body])
        found = _in_front(model, data, taxels, np.flatnonzero(own), MAX_GAP_IN_FRONT, ROOM)
        others = np.flatnonzero(near & ~own).tolist()
        for _ in _poses(model, data):
            others = _in_front(model, data, taxels, others, 0.0, MIN_OVERLAP)
        hiding.append(sorted(found + others))
    return hiding


def _in_front(
    model: mujoco.MjModel, data: mujoco.MjData, taxels: NDArray[np.int64], geoms: Iterable[int], gap: float, room: float
) -> list[int]:
    """Return the geoms that begin less than `room` behind the surface of taxels and end at most `gap` before it.

    They are seen along the normals through the middles of the taxels.
    """
    inward = data.geom_xmat[taxels].reshape(-1, 3, 3)[:, :, 2]
    points = data.geom_xpos[taxels] - inward * half_thickness(model, taxels)[:, None]
    middle = points.mean(axis=0)
    reach = np.linalg.norm(points - middle, axis=1).max() + max(gap, room)
    found = []
    for geom in map(int, geoms):
        if np.linalg.norm(data.geom_xpos[geom] - middle) > model.geom_rbound[geom] + reach:
            continue
        shape = shape_of(model, geom)
        if shape is not None:
            axes = data.geom_xmat[geom].reshape(3, 3)
            first, last = _crossed(*shape, (points - data.geom_xpos[geom]) @ axes, inward @ axes)
            if np.any((first < last) & (first < room) & (last > -gap)):
                found.append(geom)
    return found


def _crossed(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], points: NDArray[np.float64], lines: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where lines through `points` enter and leave a convex solid; a line that misses it leaves first."""
    normals, offsets = planes(vertices, faces)
    room = offsets - points @ normals.T  # points x faces
    rate = lines @ normals.T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = room / rate
    first = np.where(rate < -1e-9, at, -np.inf).max(axis=1)
    last = np.where(rate > 1e-9, at, np.inf).min(axis=1)
    beside = ((np.abs(rate) <= 1e-9) & (room < 0)).any(axis=1)
    return np.where(beside, np.inf, first), np.where(beside, -np.inf, last)


def _sample(taxels: int) -> NDArray[np.int64]:
    """Return the indices of at most `MAX_CHECKED_TAXELS` taxels."""
    return np.unique(np.linspace(0, taxels - 1, MAX_CHECKED_TAXELS).astype(int))


def _overlaps(model: mujoco.MjModel, data: mujoco.MjData, pads: Pads) -> dict[tuple[int, int], float]:
    """Return the overlap (m) of the pads that overlap in every pose; pads of closing fingers may overlap in some."""
    deep: dict[tuple[int, int], float] = dict.fromkeys(combinations(range(len(pads)), 2), np.inf)
    for _ in _poses(model, data):
        deep = {pair: min(depth, _overlap(model, data, pads, *pair)) for pair, depth in deep.items()}
        deep = {pair: depth for pair, depth in deep.items() if depth > MIN_OVERLAP}
    return deep


def _poses(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[None]:
    """Move the model to its initial pose, and then to that with all joints at the lower and at the upper end."""
    limited = np.flatnonzero(model.jnt_limited)
    limited = limited[np.isin(model.jnt_type[limited], _OF_ONE_NUMBER)]
    for end in (None, 0, 1):
        data.qpos[:] = model.qpos0
        if end is not None:
            data.qpos[model.jnt_qposadr[limited]] = model.jnt_range[limited, end]
        mujoco.mj_kinematics(model, data)
        yield


def _overlap(model: mujoco.MjModel, data: mujoco.MjData, pads: Pads, first: int, second: int) -> float:
    """Return the overlap (m) of the taxels of two pads; 0 if they do not overlap."""
    from scipy.spatial import KDTree

    geoms = [pads.geoms[pad] for pad in (first, second)]
    reach = float(sum(model.geom_rbound[some].max() for some in geoms))
    trees = [KDTree(data.geom_xpos[some]) for some in geoms]
    close = [(i, j) for i, others in enumerate(trees[0].query_ball_tree(trees[1], reach)) for j in others]
    near = [(int(geoms[0][i]), int(geoms[1][j])) for i, j in close]
    return max((-mujoco.mj_geomDistance(model, data, a, b, reach, None) for a, b in near), default=0.0)
