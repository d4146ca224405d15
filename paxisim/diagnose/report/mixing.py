"""Mixing: pictures of coupling between axes and between neighbouring taxels."""

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
    """The deviation on one axis against the force on another, and the full 3x3 matrix."""
    matrices = [_mixing(effect, pad) for pad in range(len(effect.streams.pads))]
    off = np.abs(matrices) * (1 - np.eye(3)) * np.sqrt(_loads(effect))[:, None, :]
    pad, into, source = (int(i) for i in np.unravel_index(int(off.argmax()), off.shape))
    return [_leak(effect, pad, into, source), _matrix(effect, matrices[pad], pad)]


def _loads(effect: Effect) -> Series:
    """``(pads, 3)`` N^2, energy of the simulated force on each axis."""
    squares = [np.sum(effect.without[s] ** 2, axis=(0, 3, 4), dtype=float) for s in effect.streams.episodes]
    return np.sum(squares, axis=0)


def _mixing(effect: Effect, pad: int) -> Series:
    """``(3, 3)`` least-squares coupling matrix of the model; rows are axes of the reading, columns of the force."""
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
    axes.set_ylabel(f"deviation on {AXES[into]}, N")
    name = effect.streams.pad(pad)
    return finish(
        figure,
        f"{AXES[into]} reads {abs(slope):.0%} of the {AXES[source]} force ({name})",
        f"Measured {AXES[into]} force of {name} minus force in the model without {effect.cause.name}, against the "
        f"{AXES[source]} force. The points follow the model's line, whose slope is {slope:.3g}.",
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
    axes.set_yticks(range(3), [f"reading on {axis}" for axis in AXES], color=INK)
    words = "; ".join(", ".join(f"{round(v, 3) + 0.0:.3f}" for v in row) for row in matrix)
    return finish(
        figure,
        "Coupling matrix (identity without the cause)",
        f"Coupling matrix of {effect.streams.pad(pad)}, rows are readings and columns forces: {words}.",
        legend=False,
    )


def neighbours(effect: Effect) -> list[Picture]:
    """Maps of one moment, and the deviation of a taxel against the mean force on its neighbours."""
    axis = effect.channel[1]
    near, _ = _around(effect)
    weight = near / max(int(near.sum()), 1)
    label = f"mean {AXES[axis]} force on the {int(near.sum())} neighbours, N"
    return [_moment(effect, shear=False), _beside(effect, axis, weight, label)]


def outward_shear(effect: Effect) -> list[Picture]:
    """Maps of one moment, and the shear of a taxel against the difference in normal force across it."""
    axis = effect.channel[1]
    near, away = _around(effect)
    # a neighbour at smaller x pushes towards larger x
    weight = np.where(near, -away[:, min(axis, 1)] / np.maximum(np.linalg.norm(away, axis=1), 1e-9) ** 2, 0.0)
    weight = weight / max(float(np.abs(weight).sum()), 1e-12)
    label = f"difference in normal force across {AXES[axis]}, N"
    return [_moment(effect, shear=effect.axes[0][1] < 2), _beside(effect, 2, weight, label)]


def _around(effect: Effect) -> tuple[np.ndarray, Series]:
    """Neighbours of the most affected taxel, ``(taxels,)``, and positions relative to it, ``(taxels, 2)`` m."""
    layout, (_, _, row, col) = effect.streams.layout, effect.channel
    where = layout.positions[:, :2]
    away = where - where[row * layout.cols + col]
    distance = np.linalg.norm(away, axis=1)
    return (distance > 1e-9) & (distance < 1.6 * max(layout.pitch)), away


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
    where = streams.layout.positions[:, :2] * 1e3
    largest = float(np.abs(adds[:2] if shear else adds[2]).max()) or 1.0
    longest = max(largest, float(np.abs(seen[:2]).max()))
    for axes, values, title in zip(
        pair, (seen, adds), ("measured deviation", f"{effect.cause.name} adds"), strict=True
    ):
        if shear:
            draw_map(axes, streams.layout, load, 1.25 * float(np.abs(load).max() or 1.0))
            arrows = axes.quiver(
                *where.T, *values[:2].reshape(2, -1), angles="xy", scale_units="xy",
                scale=longest / (0.85e3 * min(streams.layout.pitch)), width=0.014, zorder=4, clip_on=False,
                color=MEASURED if axes is pair[0] else EXTENDED,
            )  # fmt: skip
            arrows.set_in_layout(False)
        else:
            draw_map(axes, streams.layout, values[2].reshape(shape), largest, signed=True)
        axes.set_title(title, fontsize=8.5, pad=3, color=INK)
    place = f"{streams.pad(pad)} at {streams.time[at] - streams.time[0]:.1f} s"
    return finish(
        figure,
        f"Shear points away from the contact (up to {largest:.2g} N; shading: normal force)"
        if shear
        else f"One moment: deviation of each taxel (full colour: {largest:.2g} N)",
        f"Maps of {place}: measured force minus force in the model without {effect.cause.name}, and the effect of the "
        "cause. The two agree.",
        legend=False,
    )


def _beside(effect: Effect, source: int, weight: Series, label: str) -> Picture:
    """Deviation on the most affected channel against a weighted mean of the surrounding force on axis `source`."""
    channel = effect.channel
    pad, axis, row, col = channel
    measured, without, model = effect.at(channel)
    x = effect.without[:, pad, source].reshape(len(without), -1).astype(float) @ weight
    kept = np.abs(x) > 0.01 * np.abs(x).max()
    figure, axes = panel()
    seen, adds = (measured - without)[kept], (model - without)[kept]
    marks.cloud(axes, x[kept], seen)
    marks.level(axes)
    px, adds = scattered(x[kept], adds)
    axes.plot(px, adds, "o", color=EXTENDED, markersize=2.4, markeredgewidth=0, label=f"with {effect.cause.name}")
    axes.set_xlabel(label)
    axes.set_ylabel(f"deviation on {AXES[axis]}, N")
    return finish(
        figure,
        f"Taxel ({row}, {col}) reads its neighbours' load on {AXES[axis]}",
        f"Measured force on {effect.place(channel)} minus force in the model without {effect.cause.name}, against the "
        f"load on its neighbours. The points follow those of the model with {effect.cause.name}.",
    )
