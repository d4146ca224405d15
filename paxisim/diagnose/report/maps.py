"""Maps: pictures with a value for each taxel, drawn at its position, for causes that differ from taxel to taxel."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from paxisim.augment.dead_taxels import DeadTaxels
from paxisim.augment.gains import TaxelGain
from paxisim.augment.layout_faults import LayoutFault
from paxisim.augment.swapped_taxels import SwappedTaxels
from paxisim.diagnose.report import style
from paxisim.diagnose.report.curves import force_force
from paxisim.diagnose.report.effect import Effect, Series, largest
from paxisim.diagnose.report.style import AXES, EXTENDED, GRID, INK, MEASURED, MUTED, Picture
from paxisim.diagnose.report.timing import trace, zero_against_time
from paxisim.layout import TaxelLayout

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Maps = Sequence[tuple[str, np.ndarray]]
MOST_PADS = 4  # pads drawn; the worst ones if there are more
_TITLE = {"fontsize": 8.5, "pad": 3}


def taxel_map(effect: Effect) -> list[Picture]:
    """Map of the gain of each taxel, and force against force for the most affected taxel."""
    streams, member = effect.streams, effect.member
    assert isinstance(member, TaxelGain)
    gains = 100 * (np.broadcast_to(np.asarray(member.gain, dtype=float), streams.measured[0, :, 0].shape) - 1)
    maps = [(streams.pad(pad), gains[pad]) for pad in worst_pads(gains**2)]
    title = f"Taxel gains deviate from 1 by {gains.min():+.0f}% to {gains.max():+.0f}%"
    alt = f"Maps of the fitted gain of each taxel, as deviations from 1: {gains.min():+.1f}% to {gains.max():+.1f}%."
    spread = style.finish(grid_of_maps(streams.layout, maps, signed=True, unit="%"), title, alt)
    return [spread, force_force(effect, "The most affected taxel")]


def silent_map(effect: Effect) -> list[Picture]:
    """Maps of the taxels that do not respond, and the trace of one of them under load."""
    streams, member = effect.streams, effect.member
    assert isinstance(member, DeadTaxels)
    gone = np.asarray(member.dead, dtype=float) + np.asarray(member.stuck, dtype=float)
    gone = np.broadcast_to(gone, streams.measured[0, :, 0].shape)
    maps = [(streams.pad(pad), gone[pad]) for pad in worst_pads(gone)]
    count = int(gone.sum())
    names = ", ".join(f"{streams.pad(p)} ({r}, {c})" for p, r, c in np.argwhere(gone > 0)[:12])
    title = f"{count} taxel{'s do' if count > 1 else ' does'} not respond"
    alt = f"Maps of the taxels that do not respond: {names}."
    where = style.finish(grid_of_maps(streams.layout, maps, limit=1.0, unit=""), title, alt)
    return [where, trace(effect, "The reading stays constant under load")]


def mapping(effect: Effect) -> list[Picture]:
    """Pictures of the force as simulated, as measured, and as simulated with the corrected mapping."""
    member, swapped = effect.member, "A taxel reads the force on another taxel"
    if isinstance(member, SwappedTaxels):
        return [_moved(effect), trace(effect, swapped)]
    assert isinstance(member, LayoutFault)
    moved = member.flip_rows or member.flip_cols or member.transpose or member.pad_order is not None
    turned = [axis for axis in range(3) if member.axis_signs[axis] < 0 or member.axis_order[axis] != axis]
    pictures = [_moved(effect)] if moved else []
    for axis in turned[:1]:
        _, pad, row, col = largest(effect.energy[:, :, axis])
        title = "has the wrong sign" if member.axis_signs[axis] < 0 else "reads another axis"
        pictures.append(trace(effect, f"{AXES[axis]} {title}", (pad, axis, row, col)))
    if not moved:
        pictures.append(force_force(effect, "Measured and simulated force disagree"))
    elif not turned:
        pictures.append(trace(effect, swapped))
    return pictures


def zero(effect: Effect) -> list[Picture]:
    """Reading at rest over time, and maps of the zero of each taxel."""
    shift = _added(effect, 0)
    title = "The sensor does not read zero at rest"
    return [zero_against_time(effect, shift, title), _zeros(effect, shift, "Reading of each taxel at rest")]


def zero_in_time(effect: Effect) -> list[Picture]:
    """Reading at rest over time, and maps of the drift of each taxel's zero."""
    shift = _added(effect, -1) - _added(effect, 0)
    spread = _zeros(effect, shift, "Drift of each taxel's zero over the recording")
    return [zero_against_time(effect, shift, "The zero drifts"), spread]


def kernel(effect: Effect) -> list[Picture]:
    """What a load on one taxel adds to the readings of all, and maps of one moment."""
    streams, (pad, axis) = effect.streams, effect.axes[0]
    added = [float(np.sum((effect.model[t, pad] - effect.without[t, pad]) ** 2)) for t in range(len(effect.model))]
    at = int(np.convolve(added, np.ones(5), mode="same").argmax())  # smoothed over five samples
    measured, without, model = (force[max(0, at - 2) : at + 3, pad] for force in effect.forces)
    seen, adds = ((force - without).mean(axis=0, dtype=float) for force in (measured, model))
    load = without[:, 2].mean(axis=0, dtype=float)
    figure = style.blank(2.65)
    kinds = ((seen, "measured deviation", MEASURED), (adds, f"{effect.cause.name} adds", EXTENDED))
    most = float(np.abs(adds[:2] if axis < 2 else adds[2]).max()) or 1.0
    for axes, (values, title, colour) in zip(figure.subplots(1, 2), kinds, strict=True):
        if axis < 2:
            _draw_map(axes, streams.layout, load, 1.25 * float(np.abs(load).max() or 1.0))
            _arrows(axes, streams.layout, values, max(most, float(np.abs(seen[:2]).max())), colour)
        else:
            _draw_map(axes, streams.layout, values[2], most, signed=True)
        axes.set_title(title, **_TITLE)
    what = "in shear (arrows up to {} N; shading: normal force)" if axis < 2 else "of each taxel (full colour: {} N)"
    title = f"One moment: deviation {what.format(f'{most:.2g}')}"
    alt = f"Maps of {streams.pad(pad)} at {streams.time[at] - streams.time[0]:.1f} s: measured force minus force in "
    alt += f"the model without {effect.cause.name}, and the effect of the cause. The two agree."
    return [_kernel(effect), style.finish(figure, title, alt)]


def worst_pads(error: np.ndarray) -> list[int]:
    """Return the pads to draw in order, given the error of each pad's taxels ``(pads, ...)``."""
    return sorted(np.argsort(-error.sum(axis=tuple(range(1, error.ndim))), kind="stable")[:MOST_PADS].tolist())


def grid_of_maps(
    layout: TaxelLayout, maps: Maps, columns: int = 2, limit: float = 0.0, signed: bool = False, unit: str = " N"
) -> Figure:
    """Return a figure of titled maps ``(rows, cols)`` that share a colour scale.

    The colour is full at `limit`, by default the largest value; in a signed map, negative values have their own. The
    scale lies below, unless its unit is empty.
    """
    strip = bool(unit)
    limit = limit or max(float(np.abs(values).max()) for _, values in maps) or 1.0
    rows = -(-len(maps) // columns)
    width = style.WIDTH / columns - 0.15
    high, wide = layout.size
    height = float(np.clip(width * high / wide, 0.5, 2.2))
    figure = style.blank(rows * (height + 0.32) + (0.5 if strip else 0.1))
    grid = figure.add_gridspec(rows + strip, columns, height_ratios=[height + 0.2] * rows + ([0.12] if strip else []))
    for number, (title, values) in enumerate(maps):
        axes = figure.add_subplot(grid[number // columns, number % columns])
        _draw_map(axes, layout, values, limit, signed)
        axes.set_title(title, **_TITLE)
    if strip:
        _strip(figure.add_subplot(grid[rows, :]), limit, signed, unit)
    return figure


def _draw_map(axes: Axes, layout: TaxelLayout, values: np.ndarray, limit: float, signed: bool = False) -> None:
    """Draw one cell for each taxel; a larger value has a stronger colour. Row 0 is at the top."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import FancyBboxPatch, Rectangle

    where = layout.positions[:, :2] * 1e3
    high, wide = layout.pitch[0] * 1e3, layout.pitch[1] * 1e3
    flat = np.asarray(values, dtype=float).ravel()
    cells = [Rectangle((x - 0.46 * wide, y - 0.46 * high), 0.92 * wide, 0.92 * high) for x, y in where]
    shares = np.clip(np.abs(np.nan_to_num(flat)) / limit, 0, 1)
    colours = [style.shade(v if signed else 1.0, share) for v, share in zip(flat, shares, strict=True)]
    axes.add_collection(PatchCollection(cells, facecolor=colours, edgecolor=GRID, linewidth=0.6))
    low, top = where.min(axis=0), where.max(axis=0)
    frame = FancyBboxPatch(
        (low[0] - 0.5 * wide, low[1] - 0.5 * high), top[0] - low[0] + wide, top[1] - low[1] + high,
        boxstyle=f"round,pad={0.12 * min(wide, high)}", facecolor="none", edgecolor=MUTED, linewidth=0.8,
    )  # fmt: skip
    axes.add_patch(frame)
    axes.set(xlim=(low[0] - 0.75 * wide, top[0] + 0.75 * wide), ylim=(top[1] + 0.75 * high, low[1] - 0.75 * high))
    axes.set_aspect("equal")
    axes.set_axis_off()


def _strip(axes: Axes, limit: float, signed: bool, unit: str) -> None:
    steps = np.linspace(-limit if signed else 0, limit, 17)
    for left, right in itertools.pairwise(steps):
        middle = (left + right) / 2
        colour = style.shade(middle, min(abs(middle) / limit, 1))
        axes.axvspan(left, right, facecolor=colour, edgecolor="none", linewidth=0)
    axes.set_xlim(steps[0], steps[-1])
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    ticks = [-limit, 0, limit] if signed else [0, limit / 2, limit]
    axes.set_xticks(ticks, [f"{tick:.2g}{unit}" for tick in ticks])
    for label, side in zip(axes.get_xticklabels(), ("left", "center", "right"), strict=True):
        label.set_horizontalalignment(side)


def _moved(effect: Effect) -> Picture:
    streams = effect.streams
    number = effect.most_affected()[0]
    span = streams.episodes[number]
    change = [float(np.sum((effect.model[t] - effect.without[t]) ** 2)) for t in range(span.start, span.stop)]
    at = span.start + int(np.argmax(change))
    kinds = ((effect.without, "simulated"), (streams.measured, "measured"), (effect.model, "corrected"))
    pads = list(enumerate(streams.pads))[:MOST_PADS]
    maps = [(f"{name}, {kind}", np.abs(force[at, pad, 2])) for pad, name in pads for force, kind in kinds]
    title = "One contact: simulated, measured, and with the corrected order of taxels"
    alt = f"Maps of the normal force {streams.time[at] - streams.time[span.start]:.1f} s into episode "
    alt += f"{streams.numbers[number]}: simulated, measured, and simulated with the corrected order, which agrees with "
    alt += "the measurement."
    return style.finish(grid_of_maps(streams.layout, maps, columns=3), title, alt)


def _added(effect: Effect, number: int) -> Series:
    """``(pads, 3, rows, cols)`` N, mean effect of the cause over an episode."""
    span = effect.streams.episodes[number]
    return np.mean(effect.model[span] - effect.without[span], axis=0, dtype=float)


def _zeros(effect: Effect, shift: Series, title: str) -> Picture:
    streams, pads = effect.streams, worst_pads(shift**2)
    maps = [(f"{streams.pads[pad]}, {axis}", shift[pad, i]) for pad in pads for i, axis in enumerate(AXES)]
    channel = largest(np.abs(shift))
    alt = f"Maps of the fitted {effect.cause.name} of each taxel, by pad and axis. The largest is {shift[channel]:.3g} "
    alt += f"N at {effect.place(channel)}."
    return style.finish(grid_of_maps(streams.layout, maps, columns=3, signed=True), title, alt)


def _kernel(effect: Effect) -> Picture:
    layout, shape = effect.streams.layout, effect.streams.measured.shape[1:]
    middle = int(np.argmin(np.linalg.norm(layout.positions - layout.positions.mean(axis=0), axis=1)))
    row, col = divmod(middle, layout.cols)
    force = np.zeros((2, *shape))
    force[0, :, :, row, col] = layout.frames[middle][:, 2]
    force[1, :, :, row, col] = layout.frames[middle][:, 0]
    added = np.asarray(effect.member(force) - force)[:, effect.axes[0][0]]
    local = np.einsum("tan,nab->tbn", added.reshape(2, 3, -1), layout.frames)  # in the frames of the taxels
    figure = style.blank(2.65)
    titles = ("1 N normal force", "1 N along x")
    for axes, one, values, title in zip(figure.subplots(1, 2), local, added, titles, strict=True):
        most = float(np.abs(one).max()) or 1.0
        _draw_map(axes, layout, one[2], most, signed=True)
        _arrows(axes, layout, values, most, INK)
        axes.plot(*layout.positions[middle, :2] * 1e3, "o", markersize=9, markerfacecolor="none", color=INK, zorder=5)
        axes.set_title(f"{title} adds up to {most:.2g} N", **_TITLE)
    title = "A load on the ringed taxel is read by its neighbours (arrows: shear; colour: normal force)"
    alt = f"Maps of what {effect.cause.name} adds to the readings for 1 N on taxel ({row}, {col}): normal force up to "
    alt += f"{np.abs(local[0]).max():.2g} N, shear along x up to {np.abs(local[1]).max():.2g} N on a taxel."
    return style.finish(figure, title, alt)


def _arrows(axes: Axes, layout: TaxelLayout, shear: Series, longest: float, colour: str) -> None:
    arrows = axes.quiver(
        *layout.positions[:, :2].T * 1e3, *shear[:2].reshape(2, -1), angles="xy", scale_units="xy",
        scale=longest / (0.85e3 * min(layout.pitch)), width=0.014, zorder=4, clip_on=False, color=colour,
    )  # fmt: skip
    arrows.set_in_layout(False)
