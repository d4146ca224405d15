"""Counts: which values a sensor reads at all, for rounding that is too coarse."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.style import (
    AXES,
    EXTENDED,
    GRID,
    MEASURED,
    SIMULATED,
    Picture,
    finish,
    panel,
)

_STEPS = 8  # of rounding that the histogram shows on either side of none


def counts(effect: Effect) -> list[Picture]:
    """Quantisation: a histogram of the readings, and one stretch of them in time."""
    step = effect.cause.parameters[0].value.value
    return [_histogram(effect, step), _stairs(effect, step)]


def _histogram(effect: Effect, step: float) -> Picture:
    edges = np.linspace(0.5, _STEPS + 0.5, 10 * _STEPS + 1) * step
    seen = np.histogram(effect.streams.measured, bins=edges)[0]
    smooth = np.histogram(effect.without, bins=edges)[0]
    middle = (edges[:-1] + edges[1:]) / 2
    figure, axes = panel()
    for number in range(1, _STEPS + 1):
        axes.axvline(number * step, color=GRID, linewidth=3)
    whole = max(int(seen.sum()), 1)
    axes.bar(middle, 100 * seen / whole, width=edges[1] - edges[0], color=MEASURED, label="measured")
    part = 100 * smooth / max(int(smooth.sum()), 1)
    axes.step(middle, part, where="mid", color=SIMULATED, linewidth=1.4, label="without")
    axes.set_xlabel(f"reading, N; grey: multiples of {step:.3g} N")
    axes.set_ylabel("% of the readings")
    axes.grid(visible=False)
    return finish(
        figure,
        f"Only multiples of {step:.3g} N are ever read",
        f"Histogram of the readings from {edges[0]:.2g} to {edges[-1]:.2g} N: those measured stand in narrow bars at "
        f"multiples of {step:.3g} N, those of the model without rounding are spread evenly.",
    )


def _stairs(effect: Effect, step: float) -> Picture:
    streams, channel = effect.streams, effect.channel
    number = int(effect.energy[(slice(None), *channel)].argmax())
    span = streams.episodes[number]
    time = streams.time[span] - streams.time[span.start]
    measured, without, model = effect.at(channel, span)
    middle = time[int((np.abs(without) > step).argmax())] if (np.abs(without) > step).any() else time[len(time) // 2]
    near = np.abs(time - middle - 0.8) <= 1.2
    figure, axes = panel()
    axes.plot(time[near], without[near], color=SIMULATED, linewidth=1.4, linestyle=(0, (4, 1.5)), label="without")
    axes.step(time[near], model[near], where="mid", color=EXTENDED, linewidth=1.6, label=f"with {effect.cause.name}")
    axes.plot(time[near], measured[near], "o", color=MEASURED, markersize=3.5, alpha=0.8, label="measured")
    axes.set_xlabel("time in the episode, s")
    axes.set_ylabel(f"{AXES[channel[1]]} force, N")
    place = f"{effect.place(channel)}, episode {number}"
    return finish(
        figure,
        "A smooth force is read in steps",
        f"A moment of {place}: measured points lie on stairs of {step:.3g} N, the model without rounding is smooth.",
    )
