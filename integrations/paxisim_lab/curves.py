"""Curves: success rate against training steps, by task and method, read from logs and drawn with matplotlib."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from paxisim_insertion.tasks import TASKS

import paxisim

from .rates import REAL, in_order

SHIPPED = Path(__file__).with_name("curves.json")
"""The curves of the trainings whose results come with the package."""

_STEPS, _SUCCESS = "time/total_timesteps", "rollout/success_rate"  # stable-baselines3's names

INK = "#1f2328"
"""Colour of text and axes in the figure; the SVG has the page's own text colour instead."""

_PALETTE = (
    *("#868e96", "#f08c00", "#ae3ec9", "#2b8a3e", "#1971c2", "#e03131"),  # NT, TF, TB, TD, DT, GCS
    *("#0c8599", "#a0522d", "#e64980", "#94d82d", "#3b5bdb"),
)
_GRID = 60


def method_colours(methods: Iterable[str]) -> dict[str, str]:
    """Return a colour for each method, the same in every report for those of the paper."""
    own = list(methods)
    order = in_order([*REAL, *own])
    return {method: _PALETTE[order.index(method) % len(_PALETTE)] for method in in_order(own)}


def read_curve(folder: Path) -> list[tuple[int, float]]:
    """Read the steps of a training and the success rate of the last 100 episodes, with sampled actions, at each.

    Returns:
        Pairs of steps and success rate, ordered by steps; empty if the folder has no log.

    Raises:
        InvalidValueError: A file is not a training log.
    """
    points: dict[int, float] = {}
    for path in sorted(folder.glob("log_*/progress.csv"), key=lambda path: path.stat().st_mtime):
        try:
            with path.open(encoding="utf-8", newline="") as lines:
                for row in csv.DictReader(lines):
                    if row.get(_SUCCESS):
                        points[int(row[_STEPS])] = float(row[_SUCCESS])
        except (ValueError, TypeError, KeyError, csv.Error) as error:
            raise paxisim.InvalidValueError(f"{path} is not the log of a training: {error!r}") from error
    return sorted(points.items())


def read_curves(runs: Iterable[tuple[str, str, Path]]) -> dict[str, dict[str, list[NDArray[np.float64]]]]:
    """Read the learning curves of runs.

    Args:
        runs: Task, method and folder of each run.

    Returns:
        By task and method, an (n, 2) array of steps and success rates for each seed. Runs without a log are left out.

    Raises:
        InvalidValueError: A log is not that of a training.
    """
    return _by_task((task, method, read_curve(folder)) for task, method, folder in runs)


def shipped_curves() -> dict[str, dict[str, list[NDArray[np.float64]]]]:
    """Return the curves that come with the package, see `read_curves`."""
    found = json.loads(SHIPPED.read_text(encoding="utf-8"))
    return _by_task((one["task"], one["method"], one["points"]) for one in found)


def _by_task(found: Iterable[tuple[str, str, list[Any]]]) -> dict[str, dict[str, list[NDArray[np.float64]]]]:
    curves: dict[str, dict[str, list[NDArray[np.float64]]]] = {}
    for task, method, points in found:
        if points:
            curves.setdefault(task, {}).setdefault(method, []).append(np.array(points, dtype=float))
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


def draw_svg(curves: dict[str, list[NDArray[np.float64]]], colours: dict[str, str]) -> str:
    """Draw the curves of a task as SVG for a page, with the page's colour of text."""
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
