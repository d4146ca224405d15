"""Kernel: pictures of what a taxel reads of the loads on its neighbours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.maps import draw_map
from paxisim.diagnose.report.style import EXTENDED, INK, MEASURED, WIDTH, Picture, finish

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def kernel(effect: Effect) -> list[Picture]:
    """What a load on one taxel adds to the readings of all, and maps of one moment."""
    return [_kernel(effect), _moment(effect, shear=effect.axes[0][1] < 2)]


def _kernel(effect: Effect) -> Picture:
    from matplotlib.figure import Figure

    layout, shape = effect.streams.layout, effect.streams.measured.shape[1:]
    middle = int(np.argmin(np.linalg.norm(layout.positions - layout.positions.mean(axis=0), axis=1)))
    row, col = divmod(middle, layout.cols)
    force = np.zeros((2, *shape))
    force[0, :, :, row, col] = layout.frames[middle][:, 2]
    force[1, :, :, row, col] = layout.frames[middle][:, 0]
    added = np.asarray(effect.member(force) - force)[:, effect.axes[0][0]]
    local = np.einsum("tan,nab->tbn", added.reshape(2, 3, -1), layout.frames)  # in the frames of the taxels
    figure = Figure(figsize=(WIDTH, 2.65), layout="constrained")
    titles = ("1 N normal force", "1 N along x")
    for axes, one, values, title in zip(figure.subplots(1, 2), local, added, titles, strict=True):
        largest = float(np.abs(one).max()) or 1.0
        draw_map(axes, layout, one[2].reshape(layout.rows, layout.cols), largest, signed=True)
        _arrows(axes, effect, values, largest, INK)
        axes.plot(*layout.positions[middle, :2] * 1e3, "o", markersize=9, markerfacecolor="none", color=INK, zorder=5)
        axes.set_title(f"{title} adds up to {largest:.2g} N", fontsize=8.5, pad=3, color=INK)
    return finish(
        figure,
        "A load on the ringed taxel is read by its neighbours (arrows: shear; colour: normal force)",
        f"Maps of what {effect.cause.name} adds to the readings for 1 N on taxel ({row}, {col}): normal force up to "
        f"{np.abs(local[0]).max():.2g} N, shear along x up to {np.abs(local[1]).max():.2g} N on a taxel.",
        legend=False,
    )


def _arrows(axes: Axes, effect: Effect, shear: Series, longest: float, colour: str) -> None:
    layout = effect.streams.layout
    arrows = axes.quiver(
        *layout.positions[:, :2].T * 1e3, *shear[:2].reshape(2, -1), angles="xy", scale_units="xy",
        scale=longest / (0.85e3 * min(layout.pitch)), width=0.014, zorder=4, clip_on=False, color=colour,
    )  # fmt: skip
    arrows.set_in_layout(False)


def _strongest(effect: Effect, pad: int) -> int:
    """Index of the sample around which the cause adds most energy to a pad, smoothed over five samples."""
    adds = np.array([np.sum((effect.model[t, pad] - effect.without[t, pad]) ** 2) for t in range(len(effect.model))])
    return int(np.convolve(adds, np.ones(5), mode="same").argmax())


def _moment(effect: Effect, shear: bool) -> Picture:
    from matplotlib.figure import Figure

    pad = effect.axes[0][0]
    at = _strongest(effect, pad)
    around = slice(max(0, at - 2), at + 3)
    streams, shape = effect.streams, effect.streams.measured.shape[-2:]
    seen = (streams.measured[around, pad] - effect.without[around, pad]).mean(axis=0, dtype=float)
    adds = (effect.model[around, pad] - effect.without[around, pad]).mean(axis=0, dtype=float)
    load = effect.without[around, pad, 2].mean(axis=0, dtype=float)
    figure = Figure(figsize=(WIDTH, 2.65), layout="constrained")
    pair = figure.subplots(1, 2)
    largest = float(np.abs(adds[:2] if shear else adds[2]).max()) or 1.0
    longest = max(largest, float(np.abs(seen[:2]).max()))
    for axes, values, title in zip(
        pair, (seen, adds), ("measured deviation", f"{effect.cause.name} adds"), strict=True
    ):
        if shear:
            draw_map(axes, streams.layout, load, 1.25 * float(np.abs(load).max() or 1.0))
            _arrows(axes, effect, values, longest, MEASURED if axes is pair[0] else EXTENDED)
        else:
            draw_map(axes, streams.layout, values[2].reshape(shape), largest, signed=True)
        axes.set_title(title, fontsize=8.5, pad=3, color=INK)
    place = f"{streams.pad(pad)} at {streams.time[at] - streams.time[0]:.1f} s"
    return finish(
        figure,
        f"One moment: deviation in shear (arrows up to {largest:.2g} N; shading: normal force)"
        if shear
        else f"One moment: deviation of each taxel (full colour: {largest:.2g} N)",
        f"Maps of {place}: measured force minus force in the model without {effect.cause.name}, and the effect of the "
        "cause. The two agree.",
        legend=False,
    )
