"""Maps: pictures with a value for each taxel, drawn at its position."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.report.style import AXES, EXTENDED, GRID, INK, MUTED, SIMULATED, WIDTH, Picture, finish
from paxisim.diagnose.result import Streams
from paxisim.layout import TaxelLayout

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_PADS = 4  # pads drawn; the worst ones if there are more


def places(streams: Streams, extended: bool = True) -> list[Picture]:
    """Return maps of the error of each taxel, by pad and axis: before and, if there is a model, after."""
    before = _error(streams, streams.simulated)
    after = _error(streams, streams.extended) if extended else None
    pads = sorted(np.argsort(-(before**2).sum(axis=(1, 2, 3)), kind="stable")[:MOST_PADS].tolist())
    limit = float(before[pads].max())
    if limit == 0:
        return []
    order = np.argsort(-(before**2).sum(axis=(0, 2, 3)), kind="stable")
    return [_places(streams, before, after, pads, int(axis), limit) for axis in order]


def _error(streams: Streams, other: NDArray[np.float32]) -> NDArray[np.float64]:
    """``(pads, 3, rows, cols)`` N, RMS error, accumulated episode by episode to save memory."""
    square = sum(np.sum((streams.measured[s] - other[s]) ** 2, axis=0, dtype=float) for s in streams.episodes)
    return np.sqrt(square / len(streams.time)) * streams.alive


def _places(
    streams: Streams,
    before: NDArray[np.float64],
    after: NDArray[np.float64] | None,
    pads: Sequence[int],
    axis: int,
    limit: float,
) -> Picture:
    worst = int(np.argmax(before[:, axis]))
    pad, row, col = np.unravel_index(worst, before[:, axis].shape)
    at = f"the worst taxel is ({row}, {col}) of {streams.pad(int(pad))} with {before[:, axis].max():.3g} N"
    was = float(np.sqrt(np.mean(before[:, axis] ** 2)))
    if after is None:
        maps, titles = [before[pad, axis] for pad in pads], [f"{streams.pad(pad)}" for pad in pads]
        title = f"{AXES[axis]}: RMS error {was:.2g} N"
        alt = f"Maps of the RMS error of each taxel on {AXES[axis]}, by pad. Overall {was:.3g} N; {at}."
    else:
        maps = [values[pad, axis] for pad in pads for values in (before, after)]
        titles = [f"{streams.pad(pad)}, {when}" for pad in pads for when in ("before", "after")]
        now = float(np.sqrt(np.mean(after[:, axis] ** 2)))
        title = f"{AXES[axis]}: RMS error {was:.2g} N → {now:.2g} N"
        alt = (
            f"Maps of the RMS error of each taxel on {AXES[axis]}, by pad, before and after. Overall {was:.3g} N "
            f"before and {now:.3g} N after; before, {at}."
        )
    return finish(grid_of_maps(streams.layout, maps, titles, 2, limit), title, alt, legend=False)


def grid_of_maps(
    layout: TaxelLayout,
    maps: Sequence[np.ndarray],
    titles: Sequence[str],
    columns: int,
    limit: float,
    *,
    signed: bool = False,
    unit: str = " N",
    strip: bool = True,
) -> Figure:
    """Return a figure of maps that share a colour scale, with the scale below.

    Args:
        layout: Layout of the taxels.
        maps: Values of each map, ``(rows, cols)``.
        titles: Title of each map.
        columns: Number of maps per row.
        limit: Value at full colour.
        signed: Whether negative values have their own colour.
        unit: Unit on the scale.
        strip: Whether to draw the scale.
    """
    from matplotlib.figure import Figure

    rows = -(-len(maps) // columns)
    width = WIDTH / columns - 0.15
    high, wide = layout.size
    height = float(np.clip(width * high / wide, 0.5, 2.2))
    figure = Figure(figsize=(WIDTH, rows * (height + 0.32) + (0.5 if strip else 0.1)), layout="constrained")
    grid = figure.add_gridspec(rows + strip, columns, height_ratios=[height + 0.2] * rows + ([0.12] if strip else []))
    for number, (values, title) in enumerate(zip(maps, titles, strict=True)):
        axes = figure.add_subplot(grid[number // columns, number % columns])
        draw_map(axes, layout, values, limit, signed)
        axes.set_title(title, fontsize=8.5, pad=3, color=INK)
    if strip:
        _strip(figure.add_subplot(grid[rows, :]), limit, signed, unit)
    return figure


def draw_map(axes: Axes, layout: TaxelLayout, values: np.ndarray, limit: float, signed: bool = False) -> None:
    """Draw one cell for each taxel; a larger value has a stronger colour. Row 0 is at the top."""
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import to_rgba
    from matplotlib.patches import FancyBboxPatch, Rectangle

    where = layout.positions[:, :2] * 1e3
    high, wide = layout.pitch[0] * 1e3, layout.pitch[1] * 1e3
    flat = np.asarray(values, dtype=float).ravel()
    cells = [Rectangle((x - 0.46 * wide, y - 0.46 * high), 0.92 * wide, 0.92 * high) for x, y in where]
    shares = np.clip(np.abs(np.nan_to_num(flat)) / limit, 0, 1)
    colours = [to_rgba(SIMULATED if v >= 0 or not signed else EXTENDED, s) for v, s in zip(flat, shares, strict=True)]
    axes.add_collection(PatchCollection(cells, facecolor=colours, edgecolor=GRID, linewidth=0.6))
    low, top = where.min(axis=0), where.max(axis=0)
    frame = FancyBboxPatch(
        (low[0] - 0.5 * wide, low[1] - 0.5 * high), top[0] - low[0] + wide, top[1] - low[1] + high,
        boxstyle=f"round,pad={0.12 * min(wide, high)}", facecolor="none", edgecolor=MUTED, linewidth=0.8,
    )  # fmt: skip
    axes.add_patch(frame)
    axes.set_xlim(low[0] - 0.75 * wide, top[0] + 0.75 * wide)
    axes.set_ylim(top[1] + 0.75 * high, low[1] - 0.75 * high)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _strip(axes: Axes, limit: float, signed: bool, unit: str) -> None:
    from matplotlib.colors import to_rgba

    steps = np.linspace(-limit if signed else 0, limit, 17)
    for left, right in itertools.pairwise(steps):
        middle = (left + right) / 2
        colour = to_rgba(SIMULATED if middle >= 0 else EXTENDED, min(abs(middle) / limit, 1))
        axes.axvspan(left, right, facecolor=colour, edgecolor="none", linewidth=0)
    axes.set_xlim(steps[0], steps[-1])
    axes.set_yticks([])
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    ticks = [-limit, 0, limit] if signed else [0, limit / 2, limit]
    axes.set_xticks(ticks, [f"{tick:.2g}{unit}" for tick in ticks])
    for label, side in zip(axes.get_xticklabels(), ("left", "center", "right"), strict=True):
        label.set_horizontalalignment(side)
