"""Curve figures: learning curves by task and method, drawn on matplotlib's axes or as SVG for the page of a report."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import Cell
from .curve import read_curve
from .rates import REAL, in_order
from .tasks import TASKS

INK = "#1f2328"
"""Colour of text and axes in the figure; the SVG has the page's own text colour instead."""

_PALETTE = (
    *("#868e96", "#f08c00", "#ae3ec9", "#2b8a3e", "#1971c2", "#e03131"),  # NT, TF, TB, TD, DT, GCS
    *("#0c8599", "#a0522d", "#e64980", "#5c940d", "#3b5bdb"),
)
_GRID = 60


def method_colours(methods: Iterable[str]) -> dict[str, str]:
    """Return a colour for each method, the same in every report for those of the paper."""
    own = list(methods)
    order = in_order([*REAL, *own])
    return {method: _PALETTE[order.index(method) % len(_PALETTE)] for method in in_order(own)}


def read_curves(runs: Iterable[tuple[str, str, Path]]) -> dict[str, dict[str, list[NDArray[np.float64]]]]:
    """Read the learning curves of runs.

    Args:
        runs: Task, method and folder of each run.

    Returns:
        By task and method, an (n, 2) array of steps and success rates for each seed. Runs without a log are left out.

    Raises:
        InvalidValueError: A log is not that of a training.
    """
    curves: dict[str, dict[str, list[NDArray[np.float64]]]] = {}
    for task, method, folder in runs:
        points = np.array(read_curve(folder), dtype=float).reshape(-1, 2)
        if len(points):
            curves.setdefault(task, {}).setdefault(method, []).append(points)
    return {task: curves[task] for task in TASKS if task in curves}


def draw_curves(axes: Any, curves: dict[str, list[NDArray[np.float64]]], colours: dict[str, str]) -> None:
    """Draw the mean over the seeds of each method, and with several seeds a band that holds their middle half."""
    for method, seeds in curves.items():
        steps, values = _together(seeds)
        if len(seeds) > 1:
            low, high = np.quantile(values, (0.25, 0.75), axis=0)
            axes.fill_between(steps / 1e3, low, high, color=colours[method], alpha=0.2, lw=0)
        axes.plot(steps / 1e3, values.mean(axis=0), color=colours[method], lw=1.6, label=method)
    axes.set(xlabel="steps (thousands)", ylim=(0, 1.02), xlim=(0, None))


def curve_svgs(cells: list[Cell], runs: Path, colours: dict[str, str]) -> dict[str, str]:
    """Return an SVG by task with the curves of its methods, see `draw_curves`.

    Args:
        cells: The cells; those without a log are left out, and so are tasks without any.
        runs: Folder of the runs.
        colours: Colours of the methods.

    Raises:
        InvalidValueError: A log is not that of a training.
    """
    curves = read_curves((cell.task, cell.method, runs / cell.folder) for cell in cells)
    return {task: _svg(by_method, colours) for task, by_method in curves.items()}


def _svg(curves: dict[str, list[NDArray[np.float64]]], colours: dict[str, str]) -> str:
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style = {"svg.fonttype": "none", "svg.hashsalt": "paxisim", "text.color": INK, "axes.edgecolor": INK}
    style |= {"xtick.color": INK, "ytick.color": INK, "axes.labelcolor": INK, "font.family": "DejaVu Sans"}
    style |= {"axes.spines.top": False, "axes.spines.right": False, "font.size": 9.0, "axes.linewidth": 0.6}
    with rc_context(style):  # pyright: ignore[reportArgumentType]
        figure = Figure((3.7, 2.5), layout="constrained")
        figure.patch.set_alpha(0)
        axes = figure.add_subplot()
        axes.patch.set_alpha(0)
        draw_curves(axes, curves, colours)
        axes.set_ylabel("success")
        axes.grid(color=INK, alpha=0.15, lw=0.6)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = buffer.getvalue()
    text = text[text.index("<svg") :].replace(INK, "currentColor").replace("'DejaVu Sans'", "inherit")
    return re.sub(r"(\.\d\d)\d+", r"\1", text)


def _together(seeds: list[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the curves of several seeds at the same steps, from the latest start to the earliest end."""
    if len(seeds) == 1:
        return seeds[0][:, 0], seeds[0][None, :, 1]
    first, last = max(points[0, 0] for points in seeds), min(points[-1, 0] for points in seeds)
    steps = np.linspace(first, max(first, last), _GRID)
    return steps, np.array([np.interp(steps, points[:, 0], points[:, 1]) for points in seeds])
