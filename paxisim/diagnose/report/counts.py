"""Counts: pictures of the values that a sensor reads, for causes that round the readings to steps."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report.curves import force_force, in_newtons
from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.style import GRID, MEASURED, SIMULATED, Picture, finish, panel

_STEPS = 6  # shown in the histogram
_NEAR = 8.0  # steps shown in the curve
_PARTS = 9  # bins per step; odd, so that each multiple lies in the middle of a bin


def steps(effect: Effect) -> list[Picture]:
    """Histogram of the readings, and measured against expected force near zero."""
    step = in_newtons(effect)
    return [_histogram(effect, step), force_force(effect, "A smooth force is read in steps", _NEAR * step)]


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
    axes.set_xlabel(f"reading, N (grey: multiples of {step:.3g} N)")
    axes.set_ylabel("% of readings")
    axes.grid(visible=False)
    return finish(
        figure,
        f"The sensor reads only multiples of {step:.3g} N",
        f"Histogram of the readings from {edges[0]:.2g} to {edges[-1]:.2g} N. Measured readings fall on multiples of "
        f"{step:.3g} N; those of the model without rounding spread evenly.",
    )
