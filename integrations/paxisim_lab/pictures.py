"""``python -m paxisim_lab.pictures --out pictures``: figures of learning curves and results, light and dark."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from paxisim_insertion.results import IN_SIMULATION, PADS, Result
from paxisim_insertion.shell import command
from paxisim_insertion.tasks import TASKS

from .curves import draw_curves, method_colours, shipped_curves
from .paper import REAL, TABLE_2_SIM, UNKNOWN
from .rates import PAPER_TRIALS, TRANSFERS, in_order, pooled, read_results

DARK = {
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), "#d9dde2"),
    **{"grid.color": "#7d8590", "legend.facecolor": "none", "savefig.transparent": True},
}
"""Settings for a picture on a dark page, beside matplotlib's dark style."""


def pictures(*, results: Path | None = None, out: Path = Path(".")) -> None:
    """Draw learning.png, the curves that come with the package, and table.png, the paper's results beside ours.

    learning-dark.png and table-dark.png are the same for dark pages.

    Args:
        results: Folder of results, for the table. Default: the results that come with the package and those in
            ./results.
        out: Output folder; created if missing.
    """
    import matplotlib.style

    matplotlib.use("Agg")
    found = read_results(results)
    out.mkdir(parents=True, exist_ok=True)
    for end, style in {"": "default", "-dark": ["dark_background", DARK]}.items():
        with matplotlib.style.context(style):  # pyright: ignore[reportArgumentType]
            for name, figure in {"learning": draw_panels(shipped_curves()), "table": draw_table(found)}.items():
                path = out / f"{name}{end}.png"
                figure.savefig(path, dpi=90)
                print(path)


def draw_panels(curves: dict[str, dict[str, list[NDArray[np.float64]]]]) -> Any:
    """Return a figure with one panel per task and one line per method, with a band if it has several seeds."""
    from matplotlib.figure import Figure

    figure = Figure((11, 6), layout="constrained")
    axes = figure.subplots(2, 3, sharey=True).reshape(-1)
    colours = method_colours(method for methods in curves.values() for method in methods)
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
    stand_in = next((sensor for sensor in TRANSFERS if any(r.sensor == sensor for r in found)), PADS)
    for row, paper, sensor, theirs_in, ours_in in (
        (axes[0], TABLE_2_SIM, IN_SIMULATION, "simulation", "simulation"),
        (axes[1], REAL, stand_in, "real robot", f"transfer to {TRANSFERS.get(stand_in)}"),
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


if __name__ == "__main__":
    sys.exit(command(pictures))
