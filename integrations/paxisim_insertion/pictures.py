"""``python -m paxisim_insertion.pictures --policies integrations/policies``: figures of learning curves and results."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import paxisim

from .curve_figure import draw_curves, method_colours, read_curves
from .rates import PAPER_TRIALS, REAL, TABLE_2_SIM, UNKNOWN, in_order, pooled, read_results
from .results import IN_SIMULATION, TRANSFER, Result
from .run import Run
from .shell import command
from .tasks import TASKS


def pictures(
    *,
    policies: Path | None = None,
    results: Path | None = None,
    out: Path = Path("."),
    other_versions: bool = False,
) -> None:
    """Draw learning.png, the learning curves of each task, and table.png, the paper's results beside ours.

    Args:
        policies: Folder of runs or exported actors, for the curves. Default: no curves.
        results: Folder of results, for the table. Default: the results that come with the package and those in
            ./results.
        out: Output folder; created if missing.
        other_versions: Accept runs made with other software versions.
    """
    import matplotlib

    matplotlib.use("Agg")
    found = read_results(results)
    out.mkdir(parents=True, exist_ok=True)
    if policies is not None:
        folders = sorted(path.parent for path in policies.glob("*/run.json"))
        if not folders:
            raise paxisim.InvalidValueError(f"{policies} has no folders of runs or exported actors")
        runs = [Run.open(folder, other_versions=other_versions) for folder in folders]
        _save(draw_panels(runs), out / "learning.png")
    _save(draw_table(found), out / "table.png")


def draw_panels(runs: list[Run]) -> Any:
    """Return a figure with one panel per task and one line per method, with a band if it has several seeds."""
    from matplotlib.figure import Figure

    figure = Figure((11, 6), layout="constrained")
    axes = figure.subplots(2, 3, sharey=True).reshape(-1)
    curves = read_curves((run.task, run.name, run.folder) for run in runs)
    colours = method_colours(run.name for run in runs)
    lines: dict[str, Any] = {}
    for axis, task in zip(axes, TASKS, strict=True):
        axis.set_title(task)
        if task in curves:
            draw_curves(axis, curves[task], colours)
            axis.grid(alpha=0.3)
            lines |= {str(line.get_label()): line for line in axis.lines}
        else:
            axis.text(0.5, 0.5, "not trained", ha="center", va="center", transform=axis.transAxes, color="grey")
            axis.set_xticks([])
    for axis in axes[::3]:
        axis.set_ylabel("success, last 100 episodes")
    shown = [method for method in colours if method in lines]
    if shown:
        figure.legend([lines[method] for method in shown], shown, loc="outside lower center", ncols=len(shown))
    return figure


def draw_table(found: list[Result]) -> Any:
    """Return a figure of four coloured tables: the paper's results and ours, in simulation and after transfer."""
    from matplotlib.figure import Figure

    methods = in_order([*REAL, *(r.method for r in found if r.sensor in PAPER_TRIALS)])
    figure = Figure((13, 1 + 0.7 * len(methods)), layout="constrained")
    axes = figure.subplots(2, 2)
    for row, paper, sensor, theirs_in, ours_in in (
        (axes[0], TABLE_2_SIM, IN_SIMULATION, "simulation", "simulation"),
        (axes[1], REAL, TRANSFER, "real robot", "transfer to surrogates"),
    ):
        ours = [[_share(*pooled(found, task, method, sensor)) for task in TASKS] for method in methods]
        theirs = [[np.nan if rate is None else rate for rate in paper.get(method, UNKNOWN)] for method in methods]
        titles = (f"the paper, {theirs_in}", f"ours, {ours_in}")
        for axis, values, title in zip(row, (theirs, ours), titles, strict=True):
            axis.imshow(values, vmin=0, vmax=1, cmap="RdYlGn", aspect="auto")
            axis.set_xticks(range(len(TASKS)), list(TASKS))
            axis.set_yticks(range(len(methods)), methods)
            axis.set_title(title)
            for (y, x), value in np.ndenumerate(np.array(values)):
                if np.isfinite(value):
                    ink = "white" if abs(value - 0.5) > 0.4 else "black"
                    axis.text(x, y, f"{value:.2f}", ha="center", va="center", color=ink)
    return figure


def _share(good: int, trials: int) -> float:
    return good / trials if trials else np.nan


def _save(figure: Any, path: Path) -> None:
    figure.savefig(path, dpi=90)
    print(path)


if __name__ == "__main__":
    sys.exit(command(pictures))
