"""plot_mounts: figure of a gripper that shows where its pads are mounted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import MissingExtraError
from paxisim.models.attach import TactileGripper
from paxisim.models.load import compile_whole
from paxisim.models.mount import replaced_in_model
from paxisim.models.pads import find_pads
from paxisim.viz.posed import ASIDE, PosedRobot
from paxisim.viz.raster import triangles_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ACROSS = 4  # most pads in a row of close-ups


def plot_mounts(gripper: TactileGripper, qpos: NDArray[np.floating] | None = None) -> Figure:
    """Draw a gripper with its pads: first all of it, then each pad from close by.

    The first picture shows the gripper with its pads in red and their numbers, on top of anything that hides them; a
    pad that faces away is a dashed outline. If the gripper is part of a larger robot, the whole robot is drawn small
    beside it. Then come two close-ups of each pad. The left one looks straight at its face, with row 0 at the top and
    column 0 at the left, as `plot_pads` draws its tensor; the finger shows through the pad, a taxel that something
    covers is hollow, and what is more than a pad's length in front of the pad is cut away. The right one shows the pad
    and its finger from the side, without what stands beside the pad. "tip" and "palm" are the ends of the pad towards
    the tip of its finger and towards the palm, as far as its joints tell. An arrow shows each pad's outward normal; the
    white taxel is row 0, column 0.

    Bodies are drawn with their visual meshes, or if they have none, with their collision geoms.

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
    model = compile_whole(gripper.spec, "the gripper with pads")
    data = mujoco.MjData(model)
    data.qpos[:] = _open_pose(gripper) if qpos is None else qpos
    mujoco.mj_kinematics(model, data)
    pads = find_pads(model)
    scene = PosedRobot(
        model,
        data,
        pads,
        triangles_of(
            model,
            data,
            without=pads.bodies,
            replaced=[geom for mount in gripper.mounts for geom in replaced_in_model(model, mount)],
        ),
    )
    hands = scene.hands()
    across = min(len(pads), next(n for n in (2, 3, _ACROSS) if len(pads) <= n * n or n == _ACROSS))
    down = -(-len(pads) // across)
    wide = [1.0] * scene.is_large(hands) + [2.0] * len(hands)
    height = max(4.4, 2.6 * down)
    close = [2 / down, 2 / down * ASIDE] * across
    figure = Figure(figsize=(height / 2 * sum([*wide, *close]), height), layout="constrained")
    grid = figure.add_gridspec(down, len(wide) + len(close), width_ratios=[*wide, *close])
    axes = [figure.add_subplot(grid[:, column]) for column in range(len(wide))]
    if scene.is_large(hands):
        scene.draw_robot(axes[0])
    for ax, hand in zip(axes[-len(hands) :], hands, strict=True):
        scene.draw_hand(ax, hand)
    for pad in range(len(pads)):
        row, column = pad // across, len(wide) + 2 * (pad % across)
        front, side = (figure.add_subplot(grid[row, column + k]) for k in (0, 1))
        scene.draw_close(front, side, pad)
    for ax in figure.axes:
        ax.set_axis_off()
    taxels = f"{pads.layout.rows}x{pads.layout.cols} taxels, taxel (0, 0) white"
    figure.suptitle(f"{taxels}; each pad from the front and from the side", fontsize=9)
    return figure


def _open_pose(gripper: TactileGripper) -> NDArray[np.floating]:
    """Return the rest pose with every hand open."""
    model = gripper.compile()
    qpos = model.qpos0.copy()
    for grip in gripper.grips:
        moved = np.abs(grip.qpos[-1] - grip.qpos[0]) > 1e-9
        qpos = np.where(moved, grip.qpos[0], qpos if len(gripper.grips) > 1 else grip.qpos[0])
    return qpos
