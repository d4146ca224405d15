"""Loops: force against force, for what depends on where the force came from."""

from __future__ import annotations

from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.style import AXES, EXTENDED, MEASURED, MUTED, SIMULATED, Picture, finish, panel, thin


def loops(effect: Effect) -> list[Picture]:
    """Hysteresis: the loop of measured against simulated force, and the loop opened."""
    channel = effect.channel
    pad, axis, row, col = channel
    number = int(effect.energy[(slice(None), *channel)].argmax())
    measured, without, model = thin(*effect.at(channel, effect.streams.episodes[number]))
    place = f"{effect.place(channel)}, episode {number}"

    figure, axes = panel(3.1)
    axes.plot(without, without, color=SIMULATED, linewidth=1.2, linestyle=(0, (4, 1.5)), label="without")
    axes.plot(without, measured, color=MEASURED, linewidth=1.3, alpha=0.75, label="measured")
    axes.plot(without, model, color=EXTENDED, linewidth=1.6, label=f"with {effect.cause.name}")
    axes.set_xlabel(f"{AXES[axis]} force without {effect.cause.name}, N")
    axes.set_ylabel(f"{AXES[axis]} force read, N")
    closed = finish(
        figure,
        "The way back is not the way there",
        f"Measured force against the force of the model without {effect.cause.name}, {place}: a loop, which the model "
        "with it follows; without it there is only the straight line.",
    )

    figure, axes = panel(3.1)
    axes.axhline(0, color=SIMULATED, linewidth=1.2, linestyle=(0, (4, 1.5)), label="without")
    axes.plot(without, measured - without, ".", color=MEASURED, alpha=0.35, markersize=3.5, label="measured")
    axes.plot(without, model - without, color=EXTENDED, linewidth=1.6, label=f"with {effect.cause.name}")
    _arrows(axes, without, model - without)
    axes.set_xlabel(f"{AXES[axis]} force without {effect.cause.name}, N")
    axes.set_ylabel("what comes on top, N")
    gap = float((model - without).max() - (model - without).min())
    opened = finish(
        figure,
        f"The loop, opened: {gap:.2g} N wide ({effect.streams.pads[pad]}, taxel ({row}, {col}))",
        f"Measured force minus the model without {effect.cause.name}, against that model's force, {place}: points "
        f"lie on a loop {gap:.3g} N wide, which the model with it follows.",
    )
    return [closed, opened]


def _arrows(axes, x, y) -> None:  # type: ignore[no-untyped-def]
    """Which way the loop is run through, where it is steep in time."""
    speed = abs(x[2:] - x[:-2])
    span = float(x.max() - x.min()) or 1.0
    middle = abs(x[1:-1] - (x.min() + x.max()) / 2) < 0.12 * span
    for way in (1, -1):
        fits = middle & ((x[2:] - x[:-2]) * way > 0)
        if fits.any():
            at = 1 + int((speed * fits).argmax())
            axes.annotate(
                "", (x[at + 1], y[at + 1]), (x[at - 1], y[at - 1]),
                arrowprops={"arrowstyle": "-|>", "color": EXTENDED, "mutation_scale": 14, "shrinkA": 0, "shrinkB": 0},
            )  # fmt: skip
    axes.axhline(0, color=MUTED, linewidth=0)
