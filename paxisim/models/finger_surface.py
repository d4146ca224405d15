"""The surface under a pad on a curved finger, from the gripper's own geoms, and how far taxels are from it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.models.load import compile_whole, load_spec
from paxisim.models.mount import Mount, replaced_in_model
from paxisim.models.surface import conform
from paxisim.models.surfaces import shape_of

if TYPE_CHECKING:
    import trimesh

MIN_CURVE = 0.2e-3
"""Depth (m) over which a surface must vary under a pad for `lay_on_finger` to count it as curved."""


def finger_surface(gripper: mujoco.MjSpec | str | Path, mount: Mount) -> trimesh.Trimesh:
    """Return the geoms that a mount replaces as one mesh in the pad frame, for `conform`.

    Meshes are used as they are, not as the convex hulls that MuJoCo collides.

    Example:
        ```python
        mount = paxisim.find_mounts("hand.xml").mounts[0]
        layout = paxisim.conform(grid, paxisim.finger_surface("hand.xml", mount))
        tactile = paxisim.attach("hand.xml", layout, [mount])
        ```

    Args:
        gripper: A spec, an MJCF file or MJCF text.
        mount: Mount of the pad; its `replaces` are the finger's geoms.

    Raises:
        InvalidValueError: The gripper cannot be read, or the mount replaces no geom that has a surface.
        UnknownNameError: The gripper has no such body or geom.
    """
    model = compile_whole(load_spec(gripper), "the gripper")
    surface = _surface(model, mount, replaced_in_model(model, mount))
    if surface is None:
        raise InvalidValueError(f"the mount on {mount.body!r} replaces no geom that has a surface")
    return surface


def skin_distance(gripper: mujoco.MjSpec | str | Path, mount: Mount, layout: TaxelLayout) -> NDArray[np.floating]:
    """Return how far the taxels of a pad are outside the skin of its finger.

    The skin are the geoms that the mount replaces or, if it replaces none, those of the finger that touch objects.
    Meshes are used as they are, not as the convex hulls that MuJoCo collides.

    Args:
        gripper: The gripper without pads: a spec, an MJCF file or MJCF text.
        mount: Mount of the pad.
        layout: Taxels of the pad.

    Returns:
        Distance of each taxel from the nearest point of the skin (m), ``(N,)`` row-major; negative under the skin.

    Raises:
        InvalidValueError: The gripper cannot be read, or the finger has no geom with a surface.
        UnknownNameError: The gripper has no such body or geom.
    """
    model = compile_whole(load_spec(gripper), "the gripper")
    body = _body(model, mount)
    geoms = replaced_in_model(model, mount)
    if not geoms:
        weld = int(model.body_weldid[body])
        bodies = np.flatnonzero(model.body_weldid == weld) if weld else [body]
        touches = (model.geom_contype | model.geom_conaffinity) != 0
        geoms = np.flatnonzero(touches & np.isin(model.geom_bodyid, bodies)).tolist()
    surface = _surface(model, mount, geoms)
    if surface is None:
        raise InvalidValueError(f"the finger {mount.body!r} has no geom with a surface")
    return _signed_distance(surface.triangles, layout.positions)


def describe_distance(gripper: mujoco.MjSpec, mount: Mount, layout: TaxelLayout) -> str:
    """Return a line that says how far a pad's taxels are from the skin of its finger."""
    pad = f"pad {mount.name} on {mount.body}"
    instead = f", in place of geom {', '.join(map(str, mount.replaces))}" if mount.replaces else ""
    try:
        distance = np.round(1e3 * skin_distance(gripper, mount, layout), 1) + 0.0  # no negative zero
    except InvalidValueError as error:
        return f"{pad}{instead}: distance from the skin unknown: {error}"
    low, high = distance.min(), distance.max()
    under = " (negative: under it)" if low < 0 else ""
    return f"{pad}: taxels within {low:.1f}..{high:.1f} mm of the skin{under}{instead}"


def lay_on_finger(gripper: mujoco.MjSpec, mount: Mount, layout: TaxelLayout) -> TaxelLayout:
    """Lay a flat layout onto the finger under its mount; it stays flat where that surface is.

    Raises:
        InvalidValueError: The layout is not flat, or the finger cannot carry it: taxels miss it or it is too steep.
    """
    if not layout.is_grid:
        raise InvalidValueError("only a flat grid can be laid onto a finger, and these taxels have positions already")
    laid = conform(layout, finger_surface(gripper, mount))
    return laid if np.ptp(laid.positions[:, 2]) > MIN_CURVE else layout


def _body(model: mujoco.MjModel, mount: Mount) -> int:
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, mount.body)
    if body < 0:
        raise UnknownNameError("body", mount.body, [model.body(i).name for i in range(model.nbody)])
    return body


def _surface(model: mujoco.MjModel, mount: Mount, geoms: list[int]) -> trimesh.Trimesh | None:
    """Return geoms as one mesh in the frame of a pad; None if none of them has a surface."""
    import trimesh

    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = _body(model, mount)
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array(mount.quat))
    axes = data.xmat[body].reshape(3, 3)
    origin = data.xpos[body] + axes @ np.array(mount.pos)
    pad_rotation = axes @ rotation.reshape(3, 3)
    parts = []
    for geom in geoms:
        shape = _mesh_of(model, geom) or shape_of(model, geom)
        if shape is not None:
            vertices, faces = shape
            world = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            parts.append(trimesh.Trimesh((world - origin) @ pad_rotation, faces))
    return trimesh.util.concatenate(parts) if parts else None  # type: ignore[return-value]


def _signed_distance(triangles: NDArray[np.floating], points: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return distances of ``(N, 3)`` points from closed surfaces ``(M, 3, 3)``, negative inside them."""
    from trimesh.triangles import closest_point

    distance = np.empty(len(points))
    for index, point in enumerate(points):  # one by one: points x triangles may not fit in memory
        nearest = closest_point(triangles, np.broadcast_to(point, (len(triangles), 3)))
        distance[index] = np.sqrt(np.sum((nearest - point) ** 2, axis=1).min())
        # the solid angles of all triangles add up to 4 pi from inside a closed surface, and to 0 from outside
        a, b, c = np.moveaxis(triangles - point, 1, 0)
        lengths = [np.linalg.norm(corner, axis=1) for corner in (a, b, c)]
        volume = np.sum(a * np.cross(b, c), axis=1)
        products = [np.sum(u * v, axis=1) for u, v in ((a, b), (b, c), (c, a))]
        below = np.prod(lengths, axis=0) + sum(p * lengths[k] for p, k in zip(products, (2, 0, 1), strict=True))
        if np.sum(2 * np.arctan2(volume, below)) > 2 * np.pi:
            distance[index] *= -1
    return distance


def _mesh_of(model: mujoco.MjModel, geom: int) -> tuple[NDArray[np.floating], NDArray[np.int64]] | None:
    if int(model.geom_type[geom]) != int(mujoco.mjtGeom.mjGEOM_MESH):
        return None
    mesh = int(model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = np.array(model.mesh_vert[first : first + count], dtype=float)
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return vertices, np.array(model.mesh_face[first : first + count], dtype=np.int64)
