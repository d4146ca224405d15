"""plot_scene: figure of a simulated scene in one pose, with its pads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import MissingExtraError
from paxisim.models.pads import Pads
from paxisim.viz.posed import PosedRobot
from paxisim.viz.raster import triangles_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_INCHES = 4.4


def plot_scene(model: mujoco.MjModel, pads: Pads, qpos: NDArray[np.floating], title: str) -> Figure:
    """Draw a scene in one pose: all of it with rings around its pads, and each hand from close by.

    Args:
        model: The compiled model.
        pads: Its pads.
        qpos: ``(nq,)`` pose.
        title: Title of the figure.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib", "viz", "the picture of a scene") from error
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    scene = PosedRobot(model, data, pads, triangles_of(model, data, without=pads.bodies, replaced=()))
    hands = scene.hands()
    figure = Figure(figsize=(_INCHES * (1 + len(hands)), _INCHES), layout="constrained")
    whole, *close = figure.subplots(1, 1 + len(hands))
    scene.draw_robot(whole)
    for ax, hand in zip(close, hands, strict=True):
        scene.draw_hand(ax, hand)
    for ax in figure.axes:
        ax.set_axis_off()
    figure.suptitle(title, fontsize=9)
    return figure
