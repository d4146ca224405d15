"""Figure of a sensor's quality: intervals between frames, total force over time, noise of each taxel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import MissingExtraError
from paxisim.hw.commissioning.quality import SensorQuality
from paxisim.layout import TaxelLayout

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

_INK, _BARS = "#444444", "#5b7fa6"
_PAD_COLORS = ("#2b5c94", "#d1711f", "#0b8a3a", "#7a4fa3")
_MAX_COLUMNS = 4
_MAX_POINTS = 4000  # of a line; more would only overlap


def plot_quality(quality: SensorQuality) -> Figure:
    """Plot the result of `paxisim.hw.commissioning.quality.measure_quality`.

    Args:
        quality: The result.

    Returns:
        A figure that is not shown in a window; use ``figure.savefig("quality.png")``. It shows the intervals between
        frames, the mean-subtracted total force of the pads over time, and the noise of each pad's taxels on a common
        scale, taking the noisiest axis of each taxel.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib", "viz", "plot_quality") from error

    pads = len(quality.pads)
    columns = min(pads, _MAX_COLUMNS)
    lines = -(-pads // columns)
    height, width = quality.layout.size
    map_inches = float(np.clip(8.5 / columns * height / width, 0.4, 3.4)) + 0.7
    heights = (3.6, lines * map_inches + 0.7)
    figure = Figure(figsize=(10, sum(heights)), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=heights, squeeze=False).ravel()
    left, right = upper.subfigures(1, 2, width_ratios=[1, 1.6], squeeze=False).ravel()
    _draw_intervals(left.add_subplot(), quality)
    _draw_totals(right.subplots(3, 1, sharex=True), quality)
    noise = quality.noise.max(axis=1)
    top = float(noise.max()) or 0.1  # without any noise, any scale will do
    axes = [lower.add_subplot(lines, columns, i + 1) for i in range(pads)]
    drawn = [_draw_noise(ax, quality.layout, noise[i], top, f"noise, {quality.pads[i]}") for i, ax in enumerate(axes)]
    bar = lower.colorbar(drawn[-1], ax=axes, location="bottom", shrink=0.5, aspect=45)
    bar.set_label(f"noise of a taxel, noisiest axis ({quality.unit})", color=_INK)
    bar.ax.tick_params(length=0, colors=_INK, labelsize="small")
    bar.outline.set_visible(False)  # type: ignore[operator]
    return figure


def _draw_intervals(ax: Axes, quality: SensorQuality) -> None:
    milliseconds = 1e3 * quality.intervals
    # a few long intervals would squeeze the rest into one bar, so they are counted at the right edge
    edge = max(float(np.percentile(milliseconds, 99.5)), 1.5 * float(np.median(milliseconds)))
    beyond = int(np.sum(milliseconds > edge))
    ax.hist(np.minimum(milliseconds, edge), bins=40, range=(0.0, edge), color=_BARS)
    ax.axvline(float(np.median(milliseconds)), color=_INK, linewidth=1)
    nominal = "" if quality.nominal_rate is None else f" (nominally {quality.nominal_rate:g})"
    ax.set_title(f"{quality.rate:.1f} Hz{nominal}, {quality.lost} frames lost", loc="left", fontsize="medium")
    ax.set_xlabel("interval between frames (ms)" + (f"; {beyond} longer ones at the right edge" if beyond else ""))
    ax.set_ylabel("frames")
    _plain(ax)


def _draw_totals(axes: Sequence[Axes], quality: SensorQuality) -> None:
    step = -(-quality.frames // _MAX_POINTS)
    away = quality.total - quality.total.mean(axis=0)
    for i, pad in enumerate(quality.pads):
        for j, ax in enumerate(axes):
            color = _PAD_COLORS[i % len(_PAD_COLORS)]
            ax.plot(
                quality.time[::step],
                away[::step, i, j],
                color=color,
                linewidth=0.8,
                alpha=0.8,
                label=pad.replace("$", r"\$"),
            )
    for ax, axis in zip(axes, "xyz", strict=True):
        ax.set_ylabel(f"{axis} ({quality.unit})")
        _plain(ax)
    axes[0].set_title("total force, mean subtracted", loc="left", fontsize="medium")
    axes[-1].set_xlabel("time (s)")
    if len(quality.pads) > 1:
        look = {"frameon": False, "fontsize": "small", "labelcolor": _INK}
        axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), **look)


def _draw_noise(ax: Axes, layout: TaxelLayout, noise: NDArray[np.float64], top: float, title: str) -> PolyCollection:
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    x, y = 1e3 * layout.positions[:, :2].T
    half_y, half_x = (500 * pitch for pitch in layout.pitch)
    corners = np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]])
    taxels = PolyCollection(
        list(np.stack([x, y], axis=-1)[:, None] + corners),
        array=noise.reshape(-1),
        cmap=LinearSegmentedColormap.from_list("noise", ["#f2f2f0", _BARS, "#0f2a4d"]),
        norm=Normalize(0, top),
        edgecolors="white",
        linewidths=0.8,
    )
    ax.add_collection(taxels)
    ax.set_aspect("equal")
    ax.set_xlim(x.min() - half_x, x.max() + half_x)
    ax.set_ylim(y.max() + half_y, y.min() - half_y)
    ax.set_title(title, loc="left", fontsize="medium", parse_math=False)
    ax.set_xlabel("x (mm)")
    if np.ptp(y) > 0:
        ax.set_ylabel("y (mm)")
    else:
        ax.set_yticks([])
    _plain(ax)
    return taxels


def _plain(ax: Axes) -> None:
    ax.tick_params(length=0, colors=_INK, labelsize="small")
    ax.xaxis.label.set_color(_INK)
    ax.yaxis.label.set_color(_INK)
    ax.spines[:].set_visible(False)
    ax.grid(visible=False)
