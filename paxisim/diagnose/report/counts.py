"""Counts: which values a sensor reads at all, for rounding that is too coarse."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report.curves import force_force
from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.style import GRID, MEASURED, SIMULATED, Picture, finish, panel

_STEPS = 6  # of rounding that the histogram shows
_PARTS = 9  # bins in a step, odd so that a multiple is in the middle of one


def counts(effect: Effect) -> list[Picture]:
    """Quantisation: a histogram of the readings, and what is read against what should be."""
    return [_histogram(effect, effect.cause.parameters[0].value.value), force_force(effect)]


def _histogram(effect: Effect, step: float) -> Picture:
    edges = (np.arange(_PARTS * _STEPS + 1) / _PARTS + 0.5) * step
    middle = (edges[:-1] + edges[1:]) / 2
    seen, smooth = (np.histogram(values, bins=edges)[0] for values in (effect.streams.measured, effect.without))
    figure, axes = panel(3.0)
    for number in range(1, _STEPS + 1):
        axes.axvspan((number - 0.12) * step, (number + 0.12) * step, color=GRID, linewidth=0)
    axes.bar(middle, 100 * seen / max(int(seen.sum()), 1), width=0.8 * step / _PARTS, color=MEASURED, label="measured")
    part = 100 * smooth / max(int(smooth.sum()), 1)
    axes.step(middle, part, where="mid", color=SIMULATED, linewidth=1.6, label="without")
    axes.set_xlabel(f"reading, N; grey: multiples of {step:.3g} N")
    axes.set_ylabel("% of the readings")
    axes.grid(visible=False)
    return finish(
        figure,
        f"Only multiples of {step:.3g} N are ever read",
        f"Histogram of the readings from {edges[0]:.2g} to {edges[-1]:.2g} N: those measured stand in narrow bars at "
        f"multiples of {step:.3g} N, those of the model without rounding are spread evenly.",
    )
