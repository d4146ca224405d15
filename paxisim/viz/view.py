"""Live view of a simulation: MuJoCo's own viewer, with every taxel coloured by its normal force."""

from __future__ import annotations

import os
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from paxisim.errors import InvalidValueError, UnsupportedError
from paxisim.models.pads import Pads, find_pads
from paxisim.models.readout import TactileReadout
from paxisim.viz.colors import taxel_colors

_FRAME = 1 / 60  # s
_MAX_LAG = 0.05  # s: limits the lag, so a slow simulation runs in slow motion
_FADE = 2.0  # s: time constant of the automatic scale's decay after a peak
_FAINTEST = 0.02  # N: lower limit of the automatic scale, so that rounding errors stay faint
_CLOSING = 2.0  # s: maximum wait for the window to close
_SHADE = 0.9  # brightness factor of every second taxel
_INSTEAD = "run it on a machine with a screen, or draw readings with paxisim.plot_tactile"


def view(
    model: mujoco.MjModel,
    data: mujoco.MjData | None = None,
    pads: Pads | None = None,
    *,
    vmax: float | None = None,
) -> None:
    """Open MuJoCo's viewer on a model with pads, run it in real time, and return when the window is closed.

    The taxels are coloured as in `color_taxels`; the corner of the window shows the force on each pad. Controls
    can be set in the viewer's panel, and objects can be pulled with the mouse. A simulation slower than real time runs
    in slow motion. The taxels' original colours are restored at the end.

    Args:
        model: The compiled model; its taxels' ``geom_rgba`` changes while the window is open.
        data: The state to start from, stepped in place. Default: the model's initial state.
        pads: The pads to colour. Default: all pads of the model.
        vmax: Normal force (N) of full red. Default: a recent peak of the taxel forces that decays over seconds.

    Raises:
        InvalidValueError: The model has no pads, or `vmax` is not positive and finite.
        UnsupportedError: No window can be opened on this machine.
    """
    pads = find_pads(model) if pads is None else pads
    if vmax is not None and not (np.isfinite(vmax) and vmax > 0):
        raise InvalidValueError(f"vmax must be a positive finite force in N, got {vmax!r}")
    data = mujoco.MjData(model) if data is None else data
    readout = TactileReadout(model, pads)
    resting = model.geom_rgba[pads.geoms].copy()
    peak, owed = _FAINTEST, 0.0
    with _window(model, data) as viewer:
        last = time.perf_counter()
        try:
            while viewer.is_running():
                now = time.perf_counter()
                owed += min(now - last, _MAX_LAG)
                peak *= np.exp((last - now) / _FADE)
                last = now
                while owed >= model.opt.timestep:
                    mujoco.mj_step(model, data)
                    owed -= model.opt.timestep
                force = readout.read(data)
                peak = max(peak, float(np.abs(force[:, 2]).max()), _FAINTEST)
                scale = peak if vmax is None else vmax
                color_taxels(model, pads, force, scale)
                viewer.set_texts((None, mujoco.mjtGridPos.mjGRID_TOPRIGHT, *caption(pads, force, scale)))
                viewer.sync()
                time.sleep(max(0.0, _FRAME - (time.perf_counter() - now)))
        finally:
            model.geom_rgba[pads.geoms] = resting


def color_taxels(model: mujoco.MjModel, pads: Pads, force: ArrayLike, vmax: float) -> None:
    """Write the colours of a reading into a model's taxels (``geom_rgba``). No window, no I/O.

    Every second taxel is a shade darker than the colour from `taxel_colors`, which makes the grid visible.

    Args:
        model: The compiled model; changed in place.
        pads: The model's pads.
        force: ``(pads, 3, rows, cols)`` newtons, pad frame.
        vmax: Normal force (N) of full red.

    Raises:
        InvalidValueError: `force` has another shape.
    """
    force = np.asarray(force)
    if force.shape != pads.shape:
        raise InvalidValueError(f"expected a tensor of shape {pads.shape}, got {force.shape}")
    rgba = taxel_colors(force, vmax)
    dark = np.indices(rgba.shape[1:3]).sum(axis=0) % 2 == 1
    rgba[:, dark, :3] *= _SHADE
    model.geom_rgba[pads.geoms] = rgba.reshape(*pads.geoms.shape, 4)


def caption(pads: Pads, force: ArrayLike, vmax: float) -> tuple[str, str]:
    """Return the text in the corner of the window as MuJoCo expects it: names and values, one line each.

    Args:
        pads: The pads.
        force: ``(pads, 3, rows, cols)`` newtons, pad frame.
        vmax: Normal force (N) of full red.

    Returns:
        Two texts of ``pads + 2`` lines: a heading, the total x, y, z force of each pad, and the scale.
    """
    totals = np.round(np.asarray(force).sum(axis=(-2, -1)), 2) + 0.0  # turns -0.0 into 0.0
    rows = [f"{x:6.2f} {y:6.2f} {z:6.2f}" for x, y, z in totals]
    heading = f"{'x':>6} {'y':>6} {'z':>6}"
    return "\n".join(["force (N)", *pads.names, "full red"]), "\n".join([heading, *rows, f"{vmax:20.2f}"])


@contextmanager
def _window(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[Any]:
    """Open MuJoCo's viewer; raise an error where it would wait forever for a window that cannot be opened."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in screens):
        raise UnsupportedError(f"the live view needs a display, but neither {' nor '.join(screens)} is set: {_INSTEAD}")
    if sys.platform != "darwin" and not _can_open_window():
        raise UnsupportedError(f"the live view needs an OpenGL window, which cannot be opened here: {_INSTEAD}")
    from mujoco.viewer import launch_passive

    others = set(threading.enumerate())
    try:
        viewer = launch_passive(model, data)
    except RuntimeError as error:  # macOS, outside mjpython
        raise UnsupportedError(f"the live view cannot start: {error}; {_INSTEAD}") from error
    drawing = set(threading.enumerate()) - others
    try:
        yield viewer
    finally:
        viewer.close()
        # a process that exits while the window is still being drawn crashes with an X error
        for thread in drawing:
            thread.join(_CLOSING)


def _can_open_window() -> bool:
    """Whether GLFW, which MuJoCo's viewer uses, can open a window; leaves GLFW initialised, as the viewer requires."""
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW reports its errors as warnings
        if not glfw.init():
            return False
        glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
        window = glfw.create_window(16, 16, "paxisim", None, None)
        glfw.default_window_hints()
        if window:
            glfw.destroy_window(window)
        return bool(window)
