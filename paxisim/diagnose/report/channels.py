"""Channels: pictures with one curve per channel, for a cause that fits each channel separately."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report import marks
from paxisim.diagnose.report.curves import force_force
from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.style import AXES, MUTED, WIDTH, Picture, binned, finish

COLUMNS, MAX_PANELS = 3, 6  # columns of panels, and most channels drawn


def channel_curves(effect: Effect) -> list[Picture]:
    """Force against force for one channel, and the deviation of the most affected channels from a straight line."""
    return [force_force(effect), _bends(effect)]


def _bends(effect: Effect) -> Picture:
    from matplotlib.figure import Figure

    energy, name = effect.energy.sum(axis=0), effect.cause.name
    order = np.argsort(-energy.ravel(), kind="stable")[: min(MAX_PANELS, int((energy > 0).sum()))]
    rows = max(1, -(-len(order) // COLUMNS))
    figure = Figure(figsize=(WIDTH, 0.7 + 1.3 * rows), layout="constrained")
    grid = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, place in zip(grid, order, strict=False):
        pad, axis, row, col = (int(i) for i in np.unravel_index(place, energy.shape))
        measured, lacking, model = effect.at((pad, axis, row, col))
        x, seen, fitted = binned(lacking, measured - lacking, model - lacking, bins=16, least=8)
        marks.level(axes)
        marks.with_cause(axes, x, fitted, name)
        axes.plot(x, seen, "o", color=marks.MEASURED, markersize=2.5, markeredgewidth=0, label="measured, mean")
        axes.set_title(f"{AXES[axis]} ({row}, {col})", fontsize=8, color=MUTED)
    for axes in grid[len(order) :]:
        axes.set_axis_off()
    figure.supxlabel(f"force without {name}, N", fontsize=9)
    figure.supylabel("deviation, N", fontsize=9)
    return finish(
        figure,
        f"Deviation from the straight line, the {len(order)} most affected channels",
        f"Measured force minus force in the model without {name}, against the latter, one panel per channel. The means "
        f"lie on the curve of the model with {name}.",
    )
