"""Mixing: pictures of coupling between axes."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report import marks
from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.style import (
    AXES,
    EXTENDED,
    INK,
    SIMULATED,
    Picture,
    finish,
    panel,
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
