"""Curves: what is read against what should be read, for what acts on each reading alone."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.style import (
    AXES,
    EXTENDED,
    INK,
    MEASURED,
    SIMULATED,
    Picture,
    binned,
    finish,
    panel,
    scattered,
)

_TITLES = {
    "stiffening": "The reading bends away from the straight line",
    "saturation": "Large forces are cut off",
    "dead_band": "Small forces are not read",
    "axis_gain": "The reading is too large or too small by a constant factor",
    "taxel_gain": "This taxel reads too much or too little by a constant factor",
}
_NEAR = 4.0  # widths of a dead band that its picture shows


def curves(effect: Effect) -> list[Picture]:
    """Stiffening, saturation and dead band: force against force, and what is added to the straight line."""
    return [_force_force(effect), _bend(effect)]


def gain_curves(effect: Effect) -> list[Picture]:
    """Axis gain: force against force, and the factor of each axis."""
    return [_force_force(effect), _factors(effect)]


def _range(effect: Effect, x: np.ndarray) -> np.ndarray:
    """Samples to be shown: all but the crowd at rest; for a dead band only small forces."""
    wanted = np.abs(x) > 0.002 * np.abs(x).max()
    if effect.cause.name == "dead_band":
        width = next((p.value.value for p in effect.cause.parameters if p.name == "width"), np.abs(x).max())
        wanted = np.abs(x) < max(_NEAR * width, 5 * effect.streams.step)
        wanted &= np.abs(x) > 0.002 * np.abs(x).max()
    return wanted if wanted.sum() >= 20 else np.ones(len(x), dtype=bool)


def _force_force(effect: Effect) -> Picture:
    channel, name = effect.channel, effect.cause.name
    measured, without, model = effect.at(channel)
    kept = _range(effect, without)
    measured, without, model = measured[kept], without[kept], model[kept]
    figure, axes = panel(3.1)
    x, y = scattered(without, measured)
    axes.plot(x, y, ".", color=MEASURED, alpha=0.3, markersize=4, label="measured", markeredgewidth=0)
    ends = np.array([without.min(), without.max()])
    axes.plot(ends, ends, color=SIMULATED, linewidth=1.3, linestyle=(0, (4, 1.5)), label="without")
    order = np.argsort(without)
    axes.plot(*scattered(without[order], model[order], points=200), color=EXTENDED, linewidth=1.8, label=f"with {name}")
    axes.set_xlabel(f"{AXES[channel[1]]} force without {name}, N")
    axes.set_ylabel(f"{AXES[channel[1]]} force read, N")
    return finish(
        figure,
        _TITLES.get(name, f"What {name} does to the reading"),
        f"Measured force against that of the model without {name}, {effect.place(channel)}: points leave the "
        f"straight line, and the model with {name} follows them.",
    )


def _bend(effect: Effect) -> Picture:
    channel, name = effect.channel, effect.cause.name
    measured, without, model = effect.at(channel)
    kept = _range(effect, without)
    x, seen, adds = without[kept], (measured - without)[kept], (model - without)[kept]
    figure, axes = panel(3.1)
    axes.plot(*scattered(x, seen), ".", color=MEASURED, alpha=0.2, markersize=3.5, markeredgewidth=0)
    means = binned(x, seen, bins=20)
    axes.plot(means[0], means[1], "o", color=MEASURED, markersize=4.5, label="measured, mean")
    axes.axhline(0, color=SIMULATED, linewidth=1.3, linestyle=(0, (4, 1.5)), label="without")
    order = np.argsort(x)
    axes.plot(*scattered(x[order], adds[order], points=200), color=EXTENDED, linewidth=1.8, label=f"with {name}")
    axes.set_xlabel(f"{AXES[channel[1]]} force without {name}, N")
    axes.set_ylabel("what comes on top, N")
    place = effect.place(channel)
    return finish(
        figure,
        "The same, minus the straight line",
        f"Measured force minus that of the model without {name}, against the latter, {place}: the means lie on "
        "the curve of the model with it.",
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
    axes.axvline(1, color=SIMULATED, linewidth=1.3, linestyle=(0, (4, 1.5)))
    axes.set_yticks(range(len(parameters)), [p.name.removeprefix("gain_") for p in parameters], color=INK)
    axes.set_ylim(len(parameters) - 0.5, -0.75)
    axes.margins(x=0.15)
    axes.set_xlabel("measured / simulated, with 90 % interval")
    words = ", ".join(f"{p.name} {p.value}" for p in parameters)
    return finish(figure, "The factor of each axis", f"Points with intervals: {words}; 1 is none.", legend=False)
