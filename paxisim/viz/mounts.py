"""plot_mounts: a picture of a gripper with its pads, to see at a glance where they went."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.models.attach import TactileGripper
from paxisim.models.closing import close_gripper
from paxisim.models.faces import shape_of
from paxisim.models.pads import Pads, find_pads

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_VIEWS = ((20, -60), (15, 30), (75, -90))  # elevation and azimuth (deg)
_LIGHT = np.array([0.4, -0.5, 0.77])
_GREY, _RED = np.array([0.72, 0.74, 0.78]), np.array([0.85, 0.2, 0.18])


def plot_mounts(gripper: TactileGripper, qpos: NDArray[np.floating] | None = None) -> Figure:
    """Draw a gripper from three sides: its geoms grey (meshes as the hulls MuJoCo collides), its pads red.

    A pad that looks away from the viewer is drawn as a dashed outline through what hides it. An arrow leaves each
    pad along its outward normal; the white taxel is row 0, column 0.

    Args:
        gripper: The gripper with pads, from `attach`.
        qpos: ``(nq,)`` pose to draw. Default: with the gripper open.

    Returns:
        A figure without a window: ``figure.savefig("mounts.png")``.

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
        ax: Any = figure.add_subplot(1, len(_VIEWS), index + 1, projection="3d", computed_zorder=False)
        ax.view_init(elevation, azimuth)
        ax.set_proj_type("ortho")
        ax.set_axis_off()
        _draw_gripper(ax, triangles)
        angles = np.radians([elevation, azimuth])
        towards = np.array(
            [np.cos(angles[0]) * np.cos(angles[1]), np.cos(angles[0]) * np.sin(angles[1]), np.sin(angles[0])]
        )
        for pad in range(len(pads)):
            _draw_pad(ax, model, data, pads, pad, towards)
    numbered = ", ".join(f"{i + 1} {name}" for i, name in enumerate(pads.names))
    figure.suptitle(
        f"{pads.layout.rows}x{pads.layout.cols} taxels on {numbered}", fontsize=9, wrap=True, parse_math=False
    )
    return figure


def _open_pose(gripper: TactileGripper) -> NDArray[np.floating]:
    model = gripper.compile()
    try:
        return close_gripper(model).qpos[0]
    except InvalidValueError:  # nothing closes, as on a wiping tool
        return model.qpos0


def _triangles(model: mujoco.MjModel, data: mujoco.MjData, pads: Pads) -> NDArray[np.floating]:
    """``(n, 3, 3)`` corners (m, world frame) of everything but the pads."""
    triangles = []
    for geom in range(model.ngeom):
        shape = None if int(model.geom_bodyid[geom]) in pads.bodies else shape_of(model, geom)
        if shape is not None:
            vertices, faces = shape
            triangles.append((vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])[faces])
    return np.concatenate(triangles)


def _draw_gripper(ax: Any, triangles: NDArray[np.floating]) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-20)
    colors = _GREY * (0.65 + 0.35 * np.clip(normals @ _LIGHT, 0, 1))[:, None]
    ax.add_collection3d(Poly3DCollection(triangles, facecolors=colors, edgecolors="none", zorder=1))
    low, high = triangles.reshape(-1, 3).min(axis=0), triangles.reshape(-1, 3).max(axis=0)
    for axis in range(3):
        getattr(ax, f"set_{'xyz'[axis]}lim")(low[axis], high[axis])
    ax.set_box_aspect(high - low, zoom=1.25)


def _draw_pad(
    ax: Any, model: mujoco.MjModel, data: mujoco.MjData, pads: Pads, pad: int, towards: NDArray[np.floating]
) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    geoms, body = pads.geoms[pad], pads.bodies[pad]
    # the outward face of a cube is at -z
    face = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1]]) * model.geom_size[geoms][:, None]
    corners = face @ data.geom_xmat[geoms].reshape(-1, 3, 3).transpose(0, 2, 1) + data.geom_xpos[geoms][:, None]
    outward = -data.xmat[body].reshape(3, 3)[:, 2]
    if outward @ towards > 0:
        colors = np.tile(_RED, (len(geoms), 1))
        colors[0] = 1.0
        taxels = Poly3DCollection(corners, facecolors=colors, edgecolors="white", linewidths=0.4, zorder=2)
    else:
        rows, cols = pads.layout.rows, pads.layout.cols
        grid = corners.reshape(rows, cols, 4, 3)
        outline = np.array([[grid[0, 0, 0], grid[0, -1, 1], grid[-1, -1, 2], grid[-1, 0, 3]]])
        taxels = Poly3DCollection(
            outline, facecolors=(0, 0, 0, 0), edgecolors=[_RED], linestyles="dashed", linewidths=1, zorder=2
        )
    ax.add_collection3d(taxels)
    origin, tip = corners.mean(axis=(0, 1)), corners.mean(axis=(0, 1)) + 0.02 * outward
    ax.plot(*np.stack([origin, tip], axis=1), color=_RED, linewidth=1.5, zorder=3)
    ax.text(*(origin + 0.026 * outward), str(pad + 1), fontsize=9, color=_RED, ha="center", va="center", zorder=4)
