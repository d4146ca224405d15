"""Curves: pictures of force against force, for causes that bend, round or mix the readings."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report import style
from paxisim.diagnose.report.effect import Effect, Series, largest
from paxisim.diagnose.report.style import AXES, EXTENDED, GRID, INK, MEASURED, MUTED, SIMULATED, Picture

_NEAR = 4.0  # range of small forces shown, in units of the affected range
_WINDING = 3.0  # times its range; a curve with a larger total variation depends on more than this force
_COLUMNS, _MOST_PANELS = 3, 6  # columns of panels, and most channels drawn
_STEPS, _NEAR_STEPS = 6, 8.0  # steps shown in the histogram, and in the curve
_PARTS = 9  # bins per step; odd, so that each multiple lies in the middle of a bin
_WELL = 0.3  # share of the largest effect; episodes and taxels with less are left out of a loop


def curves(effect: Effect, near: float = np.inf) -> list[Picture]:
    """Force against force, and the deviation from the straight line, up to the force `near` (N)."""
    (pad, axis, _, _), name = effect.channel, effect.cause.name
    measured, lacking, model = _shown(tuple(force[:, pad, axis].astype(float).ravel() for force in effect.forces), near)
    seen, adds = measured - lacking, model - lacking
    figure, axes = style.panel(f"{AXES[axis]} force without {name}, N", "deviation, N", 3.0)
    style.cloud(axes, lacking, seen, faint=True)
    x, mean, fitted = style.binned(lacking, seen, adds, bins=24, least=8)
    style.level(axes)
    at, curve = _in_order(lacking, adds)
    if np.abs(np.diff(curve)).sum() > _WINDING * np.ptp(curve):  # it depends on more than this force: draw the mean
        at, curve = x, fitted
    style.with_cause(axes, at, curve, name)
    style.points(axes, x, mean, "measured, mean")
    wide = float(max(np.abs(mean).max(), np.abs(fitted).max()))
    axes.set_ylim(max(float(seen.min()), -2.2 * wide), min(float(seen.max()), 2.2 * wide))
    title = "Deviation from the straight line, all taxels"
    alt = f"{effect.deviation}, against the latter, for all taxels of pad {effect.streams.pads[pad]}, {AXES[axis]}. "
    alt += f"The means lie on the curve of the model with {name}."
    return [force_force(effect, near=near), style.finish(figure, title, alt)]


def small_forces(effect: Effect) -> list[Picture]:
    """Like `curves`, zoomed in on small forces."""
    return curves(effect, near=max(_NEAR * _in_newtons(effect), 5 * effect.streams.step))


def gains(effect: Effect) -> list[Picture]:
    """Force against force, and the fitted factors."""
    parameters = effect.cause.parameters
    figure, axes = style.panel("measured / simulated, with 90% interval", height=0.9 + 0.42 * len(parameters))
    for place, parameter in enumerate(parameters):
        value = parameter.value
        if value.low is not None and value.high is not None:
            axes.plot([value.low, value.high], [place, place], color=EXTENDED, linewidth=2.2)
        axes.plot([value.value], [place], "o", color=EXTENDED, markersize=6)
        style.note(axes, f"{value.value:.3f}", (value.value, place), (0, 7), ha="center")
    axes.axvline(1, color=SIMULATED, linewidth=1.3, linestyle=style.DASHES)
    axes.set_yticks(range(len(parameters)), [p.name.removeprefix("gain_") for p in parameters], color=INK)
    axes.set_ylim(len(parameters) - 0.5, -0.75)
    axes.margins(x=0.15)
    words = ", ".join(f"{p.name} {p.value}" for p in parameters)
    factors = style.finish(figure, "Fitted factors", f"Points with intervals: {words}. 1 has no effect.")
    return [force_force(effect), factors]


def channel_curves(effect: Effect) -> list[Picture]:
    """Force against force for one channel, and the deviation of the most affected channels from a straight line."""
    energy, name = effect.energy.sum(axis=0), effect.cause.name
    order = np.argsort(-energy.ravel(), kind="stable")[: min(_MOST_PANELS, int((energy > 0).sum()))]
    rows = max(1, -(-len(order) // _COLUMNS))
    figure = style.blank(0.7 + 1.3 * rows)
    grid = figure.subplots(rows, _COLUMNS, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, place in zip(grid, order, strict=False):
        pad, axis, row, col = (int(i) for i in np.unravel_index(place, energy.shape))
        measured, lacking, model = effect.at((pad, axis, row, col))
        x, seen, fitted = style.binned(lacking, measured - lacking, model - lacking, bins=16, least=8)
        style.level(axes)
        style.with_cause(axes, x, fitted, name)
        style.points(axes, x, seen, "measured, mean", 2.5)
        axes.set_title(f"{AXES[axis]} ({row}, {col})", fontsize=8, color=MUTED)
    for axes in grid[len(order) :]:
        axes.set_axis_off()
    figure.supxlabel(f"force without {name}, N", fontsize=9)
    figure.supylabel("deviation, N", fontsize=9)
    title = f"Deviation from the straight line, the {len(order)} most affected channels"
    alt = f"{effect.deviation}, against the latter, one panel per channel. The means lie on the curve of the model "
    alt += f"with {name}."
    return [force_force(effect), style.finish(figure, title, alt)]


def steps(effect: Effect) -> list[Picture]:
    """Histogram of the readings, and measured against expected force near zero."""
    step = _in_newtons(effect)
    edges = (np.arange(_PARTS * _STEPS + 1) / _PARTS + 0.5) * step
    middle = (edges[:-1] + edges[1:]) / 2
    seen, smooth = (np.histogram(values, bins=edges)[0] for values in (effect.streams.measured, effect.without))
    figure, axes = style.panel(f"reading, N (grey: multiples of {step:.3g} N)", "% of readings", 3.0)
    for number in range(1, _STEPS + 1):
        axes.axvspan((number - 0.12) * step, (number + 0.12) * step, color=GRID, linewidth=0)
    axes.bar(middle, 100 * seen / max(int(seen.sum()), 1), width=0.8 * step / _PARTS, color=MEASURED, label="measured")
    part = 100 * smooth / max(int(smooth.sum()), 1)
    axes.step(middle, part, where="mid", color=SIMULATED, linewidth=1.6, label="without")
    axes.grid(visible=False)
    title = f"The sensor reads only multiples of {step:.3g} N"
    alt = f"Histogram of the readings from {edges[0]:.2g} to {edges[-1]:.2g} N. Measured readings fall on multiples of "
    alt += f"{step:.3g} N; those of the model without rounding spread evenly."
    near = force_force(effect, "A smooth force is read in steps", _NEAR_STEPS * step)
    return [style.finish(figure, title, alt), near]


def axes_mixed(effect: Effect) -> list[Picture]:
    """The deviation on one axis against the force on another, and the full 3x3 matrix."""
    from matplotlib.patches import Rectangle

    matrices = [_mixing(effect, pad) for pad in range(len(effect.streams.pads))]
    squares = [np.sum(effect.without[s] ** 2, axis=(0, 3, 4), dtype=float) for s in effect.streams.episodes]
    loads = np.sum(squares, axis=0)  # (pads, 3) N^2, energy of the simulated force
    pad, into, source = largest(np.abs(matrices) * (1 - np.eye(3)) * np.sqrt(loads)[:, None, :])
    matrix = matrices[pad]
    leak = _leak(effect, pad, into, source, matrix)
    figure, axes = style.panel("", height=3.0)
    change = matrix - np.eye(3)
    limit = max(float(np.abs(change).max()), 1e-9)
    rounded = [[f"{round(value, 3) + 0.0:.3f}" for value in row] for row in matrix]
    for row, col in np.ndindex(3, 3):
        colour = style.shade(change[row, col], 0.75 * abs(change[row, col]) / limit)
        axes.add_patch(Rectangle((col - 0.47, row - 0.47), 0.94, 0.94, facecolor=colour, edgecolor="none"))
        axes.text(col, row, rounded[row][col], ha="center", va="center", fontsize=10)
    axes.set(xlim=(-0.5, 2.5), ylim=(2.5, -0.5), aspect="equal")
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)
    axes.set_xticks(range(3), [f"force on {axis}" for axis in AXES], color=INK)
    axes.set_yticks(range(3), [f"reading on {axis}" for axis in AXES], color=INK)
    words = "; ".join(", ".join(row) for row in rounded)
    title = "Coupling matrix (identity without the cause)"
    alt = f"Coupling matrix of {effect.streams.pad(pad)}, rows are readings and columns forces: {words}."
    return [leak, style.finish(figure, title, alt)]


def loops(effect: Effect) -> list[Picture]:
    """Loop of measured against simulated force, and its deviation from the straight line."""
    pad, axis, _, _ = effect.channel
    name, streams = effect.cause.name, effect.streams
    number = _simplest(effect)
    energy = effect.energy[number, pad, axis]
    taxels = energy >= _WELL * energy.max()
    own = (force[streams.episodes[number], pad, axis][:, taxels] for force in effect.forces)
    measured, lacking, model = style.thin(*(force.mean(axis=1, dtype=float) for force in own))
    where = f"mean of {int(taxels.sum())} taxels" if taxels.sum() > 1 else "one taxel"
    place = f"{streams.pad(pad)}, {AXES[axis]}, {where}, episode {streams.numbers[number]}"

    figure, axes = style.panel(f"{AXES[axis]} force without {name}, N", f"{AXES[axis]} force measured, N", 3.0)
    axes.plot(lacking, measured, color=MEASURED, linewidth=2.2, alpha=0.85, label="measured")
    style.without(axes, lacking, lacking)
    style.with_cause(axes, lacking, model, name, 1.3)
    title = "Loading and unloading follow different curves"
    alt = f"Measured force against force in the model without {name}, {place}. The model with {name} follows the "
    alt += "measured loop; without it, only the straight line remains."
    closed = style.finish(figure, title, alt)

    seen, adds = measured - lacking, model - lacking
    figure, axes = style.panel(f"{AXES[axis]} force without {name}, N", "deviation, N", 3.0)
    style.level(axes)
    axes.plot(lacking, seen, color=MEASURED, linewidth=0.8, alpha=0.3)
    style.points(axes, lacking, seen)
    style.with_cause(axes, lacking, adds, name)
    for start in _halfway(lacking):
        (x, to_x), (y, to_y) = lacking[start : start + 2], adds[start : start + 2]
        style.arrow(axes, (x, y), (to_x, to_y), size=15)
    gap = float(adds.max() - adds.min())
    title = f"Deviation from the straight line spans {gap:.2g} N ({where})"
    alt = f"{effect.deviation}, against the latter, {place}. The points lie on a loop that spans {gap:.3g} N; the "
    alt += f"model with {name} follows it."
    return [closed, style.finish(figure, title, alt)]


def force_force(effect: Effect, title: str = "", near: float = np.inf) -> Picture:
    """Measured force on the most affected channel against force in the model without the cause, up to `near` (N)."""
    name, axis, place = effect.cause.name, AXES[effect.channel[1]], effect.place(effect.channel)
    title = title or (effect.about.words.removesuffix(".") if effect.about else "") or f"Effect of {name}"
    measured, lacking, model = _shown(effect.at(effect.channel), near)
    figure, axes = style.panel(f"{axis} force without {name}, N", f"{axis} force measured, N", 3.0)
    style.cloud(axes, lacking, measured)
    ends = np.array([lacking.min(), lacking.max()])
    style.without(axes, ends, ends)
    x, fitted = _in_order(lacking, model)
    style.with_cause(axes, x, fitted, name)
    alt = f"Measured force against force in the model without {name}, {place}. The points deviate from the straight "
    alt += f"line; the model with {name} follows them."
    return style.finish(figure, f"{title} ({place})", alt)


def _in_newtons(effect: Effect) -> float:
    """Size of the cause (N): its first parameter in newtons, or the largest force if it has none."""
    sizes = (p.value.value for p in effect.cause.parameters if p.unit == "N")
    return next(sizes, float(np.abs(effect.without).max()))


def _shown(forces: tuple[Series, ...], near: float) -> tuple[Series, ...]:
    """Return the samples with a force of at most `near` (N), without those at rest."""
    lacking = forces[1]
    most = float(np.abs(lacking).max())
    kept = (np.abs(lacking) > 0.004 * min(near, most)) & (np.abs(lacking) <= near)
    if kept.sum() < 20:
        kept = np.ones(len(lacking), dtype=bool)
    return tuple(force[kept] for force in forces)


def _in_order(x: Series, y: Series) -> tuple[Series, ...]:
    order = np.argsort(x, kind="stable")
    return style.scattered(x[order], y[order], points=250)


def _simplest(effect: Effect) -> int:
    """Index of the episode with the fewest reversals, among those that show the cause well."""
    pad, axis, _, _ = effect.channel
    energy = effect.energy[:, pad, axis].sum(axis=(1, 2))
    turns = []
    for span in effect.streams.episodes:
        force = effect.without[span, pad, axis]
        turns.append(np.abs(np.diff(force, axis=0)).sum() / max(float(np.ptp(force, axis=0).sum()), 1e-12))
    return int(np.argmin(np.where(energy >= _WELL * energy.max(), turns, np.inf)))


def _halfway(x: Series) -> list[int]:
    """Samples just before `x` first passes the middle of its range, while it rises and while it falls."""
    middle = (float(x.min()) + float(x.max())) / 2
    below, above = x < middle, x > middle
    rises, falls = ~above[:-1] & above[1:], ~below[:-1] & below[1:]
    return [int(passes.argmax()) for passes in (rises, falls) if passes.any()]


def _mixing(effect: Effect, pad: int) -> Series:
    """``(3, 3)`` least-squares coupling matrix of the model; rows are axes of the reading, columns of the force."""
    x, y = (np.stack([effect.sums(pad, axis)[which] for axis in range(3)]) for which in (1, 2))
    ridge = 1e-9 * max(float(np.trace(x @ x.T)), 1e-12) * np.eye(3)
    return y @ x.T @ np.linalg.inv(x @ x.T + ridge)


def _leak(effect: Effect, pad: int, into: int, source: int, matrix: Series) -> Picture:
    measured, own, _ = effect.sums(pad, into)
    forces = [effect.sums(pad, axis)[1] for axis in range(3)]
    factors = (matrix - np.eye(3))[into]
    others = sum(factors[axis] * forces[axis] for axis in range(3) if axis != source)
    kept = np.abs(forces[source]) > 0.01 * np.abs(forces[source]).max()
    load, seen = forces[source][kept], (measured - own - others)[kept]
    slope = float(factors[source])
    figure, axes = style.panel(f"{AXES[source]} force of the pad, N", f"deviation on {AXES[into]}, N", 3.0)
    style.cloud(axes, load, seen)
    style.level(axes)
    ends = np.array([min(load.min(), 0), max(load.max(), 0)])
    style.with_cause(axes, ends, slope * ends, effect.cause.name)
    name = effect.streams.pad(pad)
    title = f"{AXES[into]} reads {abs(slope):.0%} of the {AXES[source]} force ({name})"
    alt = f"Measured {AXES[into]} force of {name} minus force in the model without {effect.cause.name}, against the "
    alt += f"{AXES[source]} force. The points follow the model's line, whose slope is {slope:.3g}."
    return style.finish(figure, title, alt)
