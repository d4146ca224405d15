"""Loops: pictures of force against force, for causes that depend on the direction of loading."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from paxisim.diagnose.report import marks
from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.style import AXES, EXTENDED, MEASURED, Picture, finish, panel, thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NEAR = 0.3  # share of the largest effect; episodes and taxels with less are ignored


def loops(effect: Effect) -> list[Picture]:
    """Loop of measured against simulated force, and its deviation from the straight line."""
    pad, axis, _, _ = effect.channel
    name = effect.cause.name
    number = _simplest(effect)
    span = effect.streams.episodes[number]
    energy = effect.energy[number, pad, axis]
    taxels = energy >= _NEAR * energy.max()
    arrays = (effect.streams.measured, effect.without, effect.model)
    measured, lacking, model = thin(*(a[span, pad, axis][:, taxels].mean(axis=1, dtype=float) for a in arrays))
    count = int(taxels.sum())
    where = f"mean of {count} taxels" if count > 1 else "one taxel"
    place = f"{effect.streams.pad(pad)}, {AXES[axis]}, {where}, episode {effect.streams.numbers[number]}"

    figure, axes = panel(3.0)
    axes.plot(lacking, measured, color=MEASURED, linewidth=2.2, alpha=0.85, label="measured")
    marks.without(axes, lacking, lacking)
    axes.plot(lacking, model, color=EXTENDED, linewidth=1.3, label=f"with {name}")
    axes.set_xlabel(f"{AXES[axis]} force without {name}, N")
    axes.set_ylabel(f"{AXES[axis]} force measured, N")
    closed = finish(
        figure,
        "Loading and unloading follow different curves",
        f"Measured force against force in the model without {name}, {place}. The model with {name} follows the "
        "measured loop; without it, only the straight line remains.",
    )

    figure, axes = panel(3.0)
    marks.level(axes)
    axes.plot(lacking, measured - lacking, color=MEASURED, linewidth=0.8, alpha=0.3)
    marks.points(axes, lacking, measured - lacking)
    marks.with_cause(axes, lacking, model - lacking, name)
    _arrows(axes, lacking, model - lacking)
    axes.set_xlabel(f"{AXES[axis]} force without {name}, N")
    axes.set_ylabel("deviation, N")
    gap = float((model - lacking).max() - (model - lacking).min())
    opened = finish(
        figure,
        f"Deviation from the straight line spans {gap:.2g} N ({where})",
        f"Measured force minus force in the model without {name}, against the latter, {place}. The points lie on a "
        f"loop that spans {gap:.3g} N; the model with {name} follows it.",
    )
    return [closed, opened]


def _simplest(effect: Effect) -> int:
    """Index of the episode with the fewest reversals, among those that show the cause well."""
    pad, axis, _, _ = effect.channel
    energy = effect.energy[:, pad, axis].sum(axis=(1, 2))
    turns = []
    for span in effect.streams.episodes:
        force = effect.without[span, pad, axis]
        turns.append(np.abs(np.diff(force, axis=0)).sum() / max(float(np.ptp(force, axis=0).sum()), 1e-12))
    return int(np.argmin(np.where(energy >= _NEAR * energy.max(), turns, np.inf)))


def _arrows(axes: Axes, x: Series, y: Series) -> None:
    """Draw the direction of travel near the middle of the range, once during loading and once during unloading."""
    middle = (float(x.min()) + float(x.max())) / 2
    for way in (1, -1):
        crossing = np.flatnonzero((x[:-1] - middle) * way <= 0) if len(x) > 1 else np.zeros(0, dtype=int)
        crossing = crossing[(x[crossing + 1] - middle) * way > 0]
        if len(crossing):
            at = int(crossing[0])
            axes.annotate(
                "", (x[at + 1], y[at + 1]), (x[at], y[at]),
                arrowprops={"arrowstyle": "-|>", "color": EXTENDED, "mutation_scale": 15, "shrinkA": 0, "shrinkB": 0},
            )  # fmt: skip
