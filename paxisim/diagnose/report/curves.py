"""Curves: what is read against what should be read, for what acts on each reading alone."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report import marks
from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.style import AXES, EXTENDED, INK, Picture, binned, finish, panel, scattered

_TITLES = {
    "axis_gain": "All is too large or too small by a factor",
    "dead_band": "Small forces are not read",
    "layout": "Every point lies off the line on which both agree",
    "quantisation": "A smooth force is read in steps",
    "saturation": "Large forces are cut off",
    "stiffening": "The reading bends away from the straight line",
    "taxel_gain": "A taxel off by a factor of its own",
}
_NEAR = 4.0  # widths of a dead band that its picture shows
_STEPS = 8.0  # of rounding


def curves(effect: Effect) -> list[Picture]:
    """Stiffening, saturation and dead band: force against force, and what is added to the straight line."""
    return [force_force(effect), _bend(effect)]


def gain_curves(effect: Effect) -> list[Picture]:
    """Axis gain: force against force, and the factor of each axis."""
    return [force_force(effect), _factors(effect)]


def _pooled(effect: Effect) -> tuple[Series, Series, Series]:
    """The pressed samples of all taxels of the most affected pad's axis; small forces for what acts on those."""
    pad, axis, _, _ = effect.channel
    arrays = (effect.streams.measured, effect.without, effect.model)
    measured, lacking, model = (a[:, pad, axis].astype(float).ravel() for a in arrays)
    return _shown(effect, measured, lacking, model)


def _shown(effect: Effect, measured: Series, lacking: Series, model: Series) -> tuple[Series, Series, Series]:
    most = float(np.abs(lacking).max())
    near = most
    sizes = {p.name: p.value.value for p in effect.cause.parameters}
    if effect.cause.name == "dead_band":
        near = max(_NEAR * sizes.get("width", most), 5 * effect.streams.step)
    elif effect.cause.name == "quantisation":
        near = _STEPS * sizes.get("step", most)
    kept = (np.abs(lacking) > 0.004 * min(near, most)) & (np.abs(lacking) <= near)
    if kept.sum() < 20:
        kept = np.ones(len(lacking), dtype=bool)
    return measured[kept], lacking[kept], model[kept]


def force_force(effect: Effect) -> Picture:
    """What the most affected taxel reads, against what it would read without the cause."""
    channel, name = effect.channel, effect.cause.name
    measured, lacking, model = _shown(effect, *effect.at(channel))
    figure, axes = panel(3.0)
    marks.cloud(axes, lacking, measured)
    ends = np.array([lacking.min(), lacking.max()])
    marks.without(axes, ends, ends)
    order = np.argsort(lacking, kind="stable")
    x, fitted = scattered(lacking[order], model[order], points=250)
    marks.with_cause(axes, x, fitted, name)
    axes.set_xlabel(f"{AXES[channel[1]]} force without {name}, N")
    axes.set_ylabel(f"{AXES[channel[1]]} force read, N")
    return finish(
        figure,
        f"{_TITLES.get(name, f'What {name} does to the reading')} ({effect.place(channel)})",
        f"Measured force against that of the model without {name}, {effect.place(channel)}: points leave the "
        f"straight line, and the model with {name} follows them.",
    )


def _bend(effect: Effect) -> Picture:
    (pad, axis, _, _), name = effect.channel, effect.cause.name
    measured, lacking, model = _pooled(effect)
    seen, adds = measured - lacking, model - lacking
    figure, axes = panel(3.0)
    marks.cloud(axes, lacking, seen, faint=True)
    x, mean, fitted = binned(lacking, seen, adds, bins=24, least=8)
    marks.level(axes)
    at, curve = x, fitted
    if name != "stiffening":  # that acts on the size of the force, so that taxels under shear differ
        order = np.argsort(lacking, kind="stable")
        at, curve = scattered(lacking[order], adds[order], points=250)
    marks.with_cause(axes, at, curve, name)
    marks.means(axes, x, mean)
    wide = float(max(np.abs(mean).max(), np.abs(fitted).max()))
    axes.set_ylim(max(float(seen.min()), -2.2 * wide), min(float(seen.max()), 2.2 * wide))
    axes.set_xlabel(f"{AXES[axis]} force without {name}, N")
    axes.set_ylabel("what comes on top, N")
    return finish(
        figure,
        "The same, minus the straight line; all taxels",
        f"Measured force minus that of the model without {name}, against the latter, all taxels of pad "
        f"{effect.streams.pads[pad]}, {AXES[axis]}: the means lie on the curve of the model with it.",
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
    axes.set_xlabel("measured / simulated, with 90 % interval")
    words = ", ".join(f"{p.name} {p.value}" for p in parameters)
    return finish(figure, "The factor of each axis", f"Points with intervals: {words}; 1 is none.", legend=False)
