"""Mixing: what of one axis arrives on another, and what a taxel reads of its neighbours."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report import marks
from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.maps import draw_map
from paxisim.diagnose.report.style import (
    AXES,
    EXTENDED,
    INK,
    MEASURED,
    SIMULATED,
    WIDTH,
    Picture,
    finish,
    panel,
    scattered,
)


def axes_mixed(effect: Effect) -> list[Picture]:
    """Axis coupling and rotation: what is left on one axis against the force on another, and all nine factors."""
    matrices = [_mixing(effect, pad) for pad in range(len(effect.streams.pads))]
    off = np.abs(matrices) * (1 - np.eye(3)) * np.sqrt(_loads(effect))[:, None, :]
    pad, into, source = (int(i) for i in np.unravel_index(int(off.argmax()), off.shape))
    return [_leak(effect, pad, into, source), _matrix(effect, matrices[pad], pad)]


def _loads(effect: Effect) -> Series:
    """``(pads, 3)`` N^2, the simulated force on each axis."""
    squares = [np.sum(effect.without[s] ** 2, axis=(0, 3, 4), dtype=float) for s in effect.streams.episodes]
    return np.sum(squares, axis=0)


def _mixing(effect: Effect, pad: int) -> Series:
    """``(3, 3)`` how a force on each axis, columns, is read on each, rows, by the model."""
    x = np.stack([effect.sums(pad, axis)[1] for axis in range(3)])
    y = np.stack([effect.sums(pad, axis)[2] for axis in range(3)])
    ridge = 1e-9 * max(float(np.trace(x @ x.T)), 1e-12) * np.eye(3)
    return y @ x.T @ np.linalg.inv(x @ x.T + ridge)


def _leak(effect: Effect, pad: int, into: int, source: int) -> Picture:
    measured, own, _ = effect.sums(pad, into)
    forces = [effect.sums(pad, axis)[1] for axis in range(3)]
    factors = _mixing(effect, pad)[into] - np.eye(3)[into]
    others = sum(factors[axis] * forces[axis] for axis in range(3) if axis != source)
    kept = np.abs(forces[source]) > 0.01 * np.abs(forces[source]).max()
    load, seen = forces[source][kept], (measured - own - others)[kept]
    slope = float(factors[source])
    figure, axes = panel(3.0)
    marks.cloud(axes, load, seen)
    marks.level(axes)
    ends = np.array([min(load.min(), 0), max(load.max(), 0)])
    marks.with_cause(axes, ends, slope * ends, effect.cause.name)
    axes.set_xlabel(f"{AXES[source]} force of the pad, N")
    axes.set_ylabel(f"what comes on top on {AXES[into]}, N")
    name = effect.streams.pads[pad]
    return finish(
        figure,
        f"{abs(slope):.0%} of the force on {AXES[source]} is read on {AXES[into]} (pad {name})",
        f"Measured {AXES[into]} force of pad {name} beyond that of the model without {effect.cause.name}, against the "
        f"{AXES[source]} force: points lie along a line of slope {slope:.3g}, as the model says.",
    )


def _matrix(effect: Effect, matrix: Series, pad: int) -> Picture:
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Rectangle

    figure, axes = panel(3.0)
    change = matrix - np.eye(3)
    limit = max(float(np.abs(change).max()), 1e-9)
    for row in range(3):
        for col in range(3):
            value = change[row, col]
            colour = to_rgba(SIMULATED if value >= 0 else EXTENDED, 0.75 * abs(value) / limit)
            axes.add_patch(Rectangle((col - 0.47, row - 0.47), 0.94, 0.94, facecolor=colour, edgecolor="none"))
            axes.text(
                col, row, f"{round(matrix[row, col], 3) + 0.0:.3f}", ha="center", va="center", color=INK, fontsize=10
            )
    axes.set_xlim(-0.5, 2.5)
    axes.set_ylim(2.5, -0.5)
    axes.set_aspect("equal")
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.tick_params(length=0)
    axes.set_xticks(range(3), [f"force on {axis}" for axis in AXES], color=INK)
    axes.set_yticks(range(3), [f"read on {axis}" for axis in AXES], color=INK)
    words = "; ".join(", ".join(f"{round(v, 3) + 0.0:.3f}" for v in row) for row in matrix)
    return finish(
        figure,
        "How each axis is read on each; without the cause, ones and zeros",
        f"Matrix of pad {effect.streams.pads[pad]}, rows what is read, columns the force: {words}.",
        legend=False,
    )


def neighbours(effect: Effect) -> list[Picture]:
    """Poisson and crosstalk: what a taxel reads, against the load beside it; and one moment as a map."""
    return [_moment(effect), _beside(effect)]


def _strongest(effect: Effect, pad: int) -> int:
    """The sample at which the cause adds most to a pad, and which is held longest about."""
    adds = np.array([np.sum((effect.model[t, pad] - effect.without[t, pad]) ** 2) for t in range(len(effect.model))])
    return int(np.convolve(adds, np.ones(5), mode="same").argmax())


def _moment(effect: Effect) -> Picture:
    from matplotlib.figure import Figure

    pad = effect.axes[0][0]
    at = _strongest(effect, pad)
    around = slice(max(0, at - 2), at + 3)
    streams, shape = effect.streams, effect.streams.measured.shape[-2:]
    seen = (streams.measured[around, pad] - effect.without[around, pad]).mean(axis=0, dtype=float)
    adds = (effect.model[around, pad] - effect.without[around, pad]).mean(axis=0, dtype=float)
    load = effect.without[around, pad, 2].mean(axis=0, dtype=float)
    shear = effect.axes[0][1] < 2 and effect.cause.name == "poisson"
    figure = Figure(figsize=(WIDTH, 2.65), layout="constrained")
    pair = figure.subplots(1, 2)
    where = streams.layout.positions[:, :2] * 1e3
    largest = float(np.abs(adds[:2] if shear else adds[2]).max()) or 1.0
    for axes, values, title in zip(pair, (seen, adds), ("measured on top", f"{effect.cause.name} adds"), strict=True):
        if shear:
            draw_map(axes, streams.layout, load, 1.25 * float(np.abs(load).max() or 1.0))
            arrows = axes.quiver(
                *where.T, *values[:2].reshape(2, -1), angles="xy", scale_units="xy",
                scale=largest / (0.85e3 * min(streams.layout.pitch)), width=0.014, zorder=4, clip_on=False,
                color=MEASURED if axes is pair[0] else EXTENDED,
            )  # fmt: skip
            arrows.set_in_layout(False)
        else:
            draw_map(axes, streams.layout, values[2].reshape(shape), largest, signed=True)
        axes.set_title(title, fontsize=8.5, pad=3, color=INK)
    place = f"pad {streams.pads[pad]} at {streams.time[at] - streams.time[0]:.1f} s"
    return finish(
        figure,
        f"Shear points away from the load (up to {largest:.2g} N; shade: normal force)"
        if shear
        else f"One moment: what is read besides the taxel's own force (full colour {largest:.2g} N)",
        f"Maps of {place}: what is measured beyond the model without {effect.cause.name}, and what the cause adds; "
        "they look alike.",
        legend=False,
    )


def _beside(effect: Effect) -> Picture:
    channel = effect.channel
    pad, axis, row, col = channel
    measured, without, model = effect.at(channel)
    layout = effect.streams.layout
    where = layout.positions[:, :2]
    away = where - where[row * layout.cols + col]
    distance = np.linalg.norm(away, axis=1)
    near = (distance > 1e-9) & (distance < 1.6 * max(layout.pitch))
    loads = effect.without[:, pad, 2 if effect.cause.name == "poisson" else axis].reshape(len(without), -1)
    if effect.cause.name == "poisson":  # what lies at smaller x pushes towards larger x
        weight = np.where(near, -away[:, min(axis, 1)] / np.maximum(distance, 1e-9) ** 2, 0.0)
        label = f"load beside it, across {AXES[axis]}, N"
    else:
        weight = near / max(int(near.sum()), 1)
        label = f"mean {AXES[axis]} force of the {int(near.sum())} neighbours, N"
    scale = np.abs(weight).sum() if effect.cause.name == "poisson" else 1.0
    x = loads.astype(float) @ weight / max(float(scale), 1e-12)
    kept = np.abs(x) > 0.01 * np.abs(x).max()
    figure, axes = panel()
    seen, adds = (measured - without)[kept], (model - without)[kept]
    marks.cloud(axes, x[kept], seen)
    marks.level(axes)
    px, adds = scattered(x[kept], adds)
    axes.plot(px, adds, "o", color=EXTENDED, markersize=2.4, markeredgewidth=0, label=f"with {effect.cause.name}")
    axes.set_xlabel(label)
    axes.set_ylabel(f"on top on {AXES[axis]}, N")
    return finish(
        figure,
        f"The load beside it shows on {AXES[axis]} of taxel ({row}, {col})",
        f"What {effect.place(channel)} reads beyond the model without {effect.cause.name}, against the load of its "
        "neighbours: points rise along those of the model with it.",
    )
