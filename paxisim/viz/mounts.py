"""plot_mounts: figure of a gripper that shows where its pads are mounted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import MissingExtraError
from paxisim.models.attach import TactileGripper
from paxisim.models.faces import shape_of
from paxisim.models.pads import Pads, find_pads

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_VIEWS = ((20, -60), (15, 30), (75, -90))  # elevation and azimuth (deg)
_LIGHT = np.array([0.4, -0.5, 0.77])
_GREY, _RED = np.array([0.72, 0.74, 0.78]), np.array([0.85, 0.2, 0.18])
_ARROW, _NUMBER = 0.02, 0.026  # m, length of an arrow and distance of a pad's number from the pad
_SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_CIRCLE = np.stack([np.cos(np.linspace(0, 2 * np.pi, 16)), np.sin(np.linspace(0, 2 * np.pi, 16))], axis=1)


def plot_mounts(gripper: TactileGripper, qpos: NDArray[np.floating] | None = None) -> Figure:
    """Draw a gripper from three directions: its geoms in grey, its pads in red.

    Meshes are drawn as the convex hulls that MuJoCo uses for collisions. Each taxel that faces the viewer is drawn at
    its position, on top of anything that hides it. A pad that faces away entirely is drawn as a dashed outline. An
    arrow shows each pad's outward normal; the white taxel is row 0, column 0.

    Args:
        gripper: The gripper with pads, from `attach`.
        qpos: ``(nq,)`` pose to draw. Default: the gripper open.

    Returns:
        A figure that is not shown in a window; use ``figure.savefig("mounts.png")``.

    Raises:
        MissingExtraError: matplotlib is not installed.
        InvalidValueError: MuJoCo cannot compile the gripper.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib", "viz", "plot_mounts") from error
    model = gripper.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = _open_pose(gripper) if qpos is None else qpos
    mujoco.mj_kinematics(model, data)
    pads = find_pads(model)
    triangles = _triangles(model, data, pads)
    figure = Figure(figsize=(12, 5), layout="constrained")
    for index, (elevation, azimuth) in enumerate(_VIEWS):
        ax: Any = figure.add_subplot(1, len(_VIEWS), index + 1)
        ax.set_axis_off()
        ax.set_aspect("equal")
        view = _view(*np.radians([elevation, azimuth]))
        _draw_gripper(ax, triangles, view)
        for pad in range(len(pads)):
            _draw_pad(ax, model, data, pads, pad, view)
        ax.margins(0.04)
        ax.autoscale_view()
    numbered = ", ".join(f"{i + 1} {name}" for i, name in enumerate(pads.names))
    figure.suptitle(
        f"{pads.layout.rows}x{pads.layout.cols} taxels on {numbered}", fontsize=9, wrap=True, parse_math=False
    )
    return figure


def _view(elevation: float, azimuth: float) -> NDArray[np.floating]:
    """Return ``(3, 3)`` rows right, up and towards the viewer, in the world frame, for these viewing angles (rad)."""
    towards = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    return np.stack([right, np.cross(towards, right), towards])


def _open_pose(gripper: TactileGripper) -> NDArray[np.floating]:
    """Return the rest pose with every hand open."""
    model = gripper.compile()
    qpos = model.qpos0.copy()
    for grip in gripper.grips:
        moved = np.abs(grip.qpos[-1] - grip.qpos[0]) > 1e-9
        qpos = np.where(moved, grip.qpos[0], qpos if len(gripper.grips) > 1 else grip.qpos[0])
    return qpos


def _triangles(model: mujoco.MjModel, data: mujoco.MjData, pads: Pads) -> NDArray[np.floating]:
    """Return the ``(n, 3, 3)`` triangle corners (m, world frame) of everything except the pads."""
    triangles = [np.zeros((0, 3, 3))]
    for geom in range(model.ngeom):
        shape = None if int(model.geom_bodyid[geom]) in pads.bodies else shape_of(model, geom)
        if shape is not None:
            vertices, faces = shape
            triangles.append((vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])[faces])
    return np.concatenate(triangles)


def _draw_gripper(ax: Any, triangles: NDArray[np.floating], view: NDArray[np.floating]) -> None:
    from matplotlib.collections import PolyCollection

    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
    # skip triangles that face away, and draw the others from far to near
    seen = np.flatnonzero(normals @ view[2] > 0)
    seen = seen[np.argsort((triangles[seen] @ view[2]).mean(axis=1))]
    colors = _GREY * (0.65 + 0.35 * np.clip(normals[seen] @ _LIGHT, 0, 1))[:, None]
    flat = triangles[seen] @ view[:2].T
    ax.add_collection(PolyCollection(list(flat), facecolors=colors, edgecolors=colors, linewidths=0.3, zorder=1))


def _draw_pad(
    ax: Any, model: mujoco.MjModel, data: mujoco.MjData, pads: Pads, pad: int, view: NDArray[np.floating]
) -> None:
    from matplotlib.collections import PolyCollection
    from scipy.spatial import ConvexHull

    geoms = pads.geoms[pad]
    size, axes = model.geom_size[geoms], data.geom_xmat[geoms].reshape(-1, 3, 3)
    # the outward face of a cube is at -z; a sphere is drawn as a disc
    is_sphere = int(model.geom_type[geoms[0]]) == int(mujoco.mjtGeom.mjGEOM_SPHERE)
    outline, half = (_CIRCLE, size[:, [0, 0, 0]]) if is_sphere else (_SQUARE, size)
    face = np.concatenate([outline, np.full((len(outline), 1), 0.0 if is_sphere else -1.0)], axis=1) * half[:, None]
    corners = face @ axes.transpose(0, 2, 1) + data.geom_xpos[geoms][:, None]
    facing = -axes[:, :, 2] @ view[2]
    colors = np.tile(_RED, (len(geoms), 1))
    colors[0] = 1.0
    flat = corners @ view[:2].T
    if facing.max() > 0:
        seen = np.flatnonzero(facing > 0)
        seen = seen[np.argsort((corners[seen] @ view[2]).mean(axis=1))]
        style = {"facecolors": colors[seen], "edgecolors": "white", "linewidths": 0.4}
        taxels = PolyCollection(list(flat[seen]), zorder=2, **style)
    else:
        points = flat.reshape(-1, 2)
        hull = points[ConvexHull(points, qhull_options="QJ").vertices]
        style = {"facecolors": (0, 0, 0, 0), "edgecolors": [_RED], "linestyles": "dashed", "linewidths": 1}
        taxels = PolyCollection([hull], zorder=2, **style)
    ax.add_collection(taxels)
    outward = -data.xmat[pads.bodies[pad]].reshape(3, 3)[:, 2]
    middle = corners.mean(axis=(0, 1))
    arrow, number = np.array([middle, middle + _ARROW * outward]) @ view[:2].T, view[:2] @ (middle + _NUMBER * outward)
    ax.plot(*arrow.T, color=_RED, linewidth=1.5, zorder=3)
    ax.text(*number, str(pad + 1), fontsize=9, color=_RED, ha="center", va="center", zorder=4)
