"""Curves: pictures of measured against expected force, for causes that act on each reading separately."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report import marks
from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.style import AXES, EXTENDED, INK, Picture, binned, finish, panel, scattered

_NEAR = 4.0  # range of small forces shown, in units of the affected range
_WINDING = 3.0  # times its range; a curve with a larger total variation depends on more than this force


def curves(effect: Effect) -> list[Picture]:
    """Force against force, and the deviation from the straight line."""
    return [force_force(effect), _bend(effect)]


def small_forces(effect: Effect) -> list[Picture]:
    """Like `curves`, zoomed in on small forces."""
    near = max(_NEAR * in_newtons(effect), 5 * effect.streams.step)
    return [force_force(effect, near=near), _bend(effect, near)]


def gains(effect: Effect) -> list[Picture]:
    """Force against force, and the fitted factors."""
    return [force_force(effect), _factors(effect)]


def in_newtons(effect: Effect) -> float:
    """Size of the cause (N): its first parameter in newtons, or the largest force if it has none."""
    sizes = (p.value.value for p in effect.cause.parameters if p.unit == "N")
    return next(sizes, float(np.abs(effect.without).max()))


def _shown(measured: Series, lacking: Series, model: Series, near: float) -> tuple[Series, Series, Series]:
    """Return the samples with a force of at most `near` (N), without those at rest."""
    most = float(np.abs(lacking).max())
    kept = (np.abs(lacking) > 0.004 * min(near, most)) & (np.abs(lacking) <= near)
    if kept.sum() < 20:
        kept = np.ones(len(lacking), dtype=bool)
    return measured[kept], lacking[kept], model[kept]


def force_force(effect: Effect, title: str = "", near: float = np.inf) -> Picture:
    """Draw measured force on the most affected channel against force in the model without the cause.

    Args:
        effect: Effect of the cause.
        title: Title of the picture; default: the description of the cause.
        near: Largest force shown (N).
    """
    channel, name = effect.channel, effect.cause.name
    title = title or (effect.about.words.removesuffix(".") if effect.about else "") or f"Effect of {name}"
    measured, lacking, model = effect.at(channel)
    measured, lacking, model = _shown(measured, lacking, model, near)
    figure, axes = panel(3.0)
    marks.cloud(axes, lacking, measured)
    ends = np.array([lacking.min(), lacking.max()])
    marks.without(axes, ends, ends)
    order = np.argsort(lacking, kind="stable")
    x, fitted = scattered(lacking[order], model[order], points=250)
    marks.with_cause(axes, x, fitted, name)
    axes.set_xlabel(f"{AXES[channel[1]]} force without {name}, N")
    axes.set_ylabel(f"{AXES[channel[1]]} force measured, N")
    return finish(
        figure,
        f"{title} ({effect.place(channel)})",
        f"Measured force against force in the model without {name}, {effect.place(channel)}. The points deviate "
        f"from the straight line; the model with {name} follows them.",
    )


def _bend(effect: Effect, near: float = np.inf) -> Picture:
    (pad, axis, _, _), name = effect.channel, effect.cause.name
    arrays = (effect.streams.measured, effect.without, effect.model)
    measured, lacking, model = (a[:, pad, axis].astype(float).ravel() for a in arrays)
    measured, lacking, model = _shown(measured, lacking, model, near)
    seen, adds = measured - lacking, model - lacking
    figure, axes = panel(3.0)
    marks.cloud(axes, lacking, seen, faint=True)
    x, mean, fitted = binned(lacking, seen, adds, bins=24, least=8)
    marks.level(axes)
    order = np.argsort(lacking, kind="stable")
    at, curve = scattered(lacking[order], adds[order], points=250)
    if np.abs(np.diff(curve)).sum() > _WINDING * np.ptp(curve):  # it depends on more than this force: draw the mean
        at, curve = x, fitted
    marks.with_cause(axes, at, curve, name)
    marks.means(axes, x, mean)
    wide = float(max(np.abs(mean).max(), np.abs(fitted).max()))
    axes.set_ylim(max(float(seen.min()), -2.2 * wide), min(float(seen.max()), 2.2 * wide))
    axes.set_xlabel(f"{AXES[axis]} force without {name}, N")
    axes.set_ylabel("deviation, N")
    return finish(
        figure,
        "Deviation from the straight line, all taxels",
        f"Measured force minus force in the model without {name}, against the latter, for all taxels of pad "
        f"{effect.streams.pads[pad]}, {AXES[axis]}. The means lie on the curve of the model with {name}.",
    )


def _factors(effect: Effect) -> Picture:
    parameters = effect.cause.parameters
    figure, axes = panel(0.9 + 0.42 * len(parameters))
    for place, parameter in enumerate(parameters):
        value = parameter.value
        if value.low is not None and value.high is not None:
            axes.plot([value.low, value.high], [place, place], color=EXTENDED, linewidth=2.2)
        axes.plot([value.value], [place], "o", color=EXTENDED, markersize=6)
        axes.annotate(
            f"{value.value:.3f}", (value.value, place), (0, 7), textcoords="offset points", ha="center", color=INK
        )
    marks.level_across(axes, 1)
    axes.set_yticks(range(len(parameters)), [p.name.removeprefix("gain_") for p in parameters], color=INK)
    axes.set_ylim(len(parameters) - 0.5, -0.75)
    axes.margins(x=0.15)
    axes.set_xlabel("measured / simulated, with 90% interval")
    words = ", ".join(f"{p.name} {p.value}" for p in parameters)
    return finish(figure, "Fitted factors", f"Points with intervals: {words}. 1 has no effect.", legend=False)
