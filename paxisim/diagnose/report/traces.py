"""Traces: pictures of the worst episodes over time, and of the error by phase, frequency, pad and axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from paxisim.diagnose.report.style import (
    AXES,
    EXTENDED,
    INK,
    MEASURED,
    MUTED,
    SIMULATED,
    WIDTH,
    Picture,
    finish,
    panel,
    thin,
)
from paxisim.diagnose.result import Place, Streams, Symptoms, pad_in_words

EPISODES = 3
SECONDS = 40.0  # longest trace


def worst_episodes(streams: Streams, extended: bool = True) -> list[Picture]:
    """Return traces of the episodes with the largest error, each with its worst channel."""
    square = [np.sum((streams.measured[s] - streams.simulated[s]) ** 2, axis=0, dtype=float) for s in streams.episodes]
    energy = np.where(streams.alive, square, 0.0)
    order = np.argsort(-energy.sum(axis=(1, 2, 3, 4)), kind="stable")[:EPISODES]
    return [_trace(streams, int(number), energy[number], extended) for number in order]


def _trace(streams: Streams, number: int, energy: np.ndarray, with_model: bool) -> Picture:
    from matplotlib.figure import Figure

    span = streams.episodes[number]
    pad, axis, row, col = (int(i) for i in np.unravel_index(int(energy.argmax()), energy.shape))
    where = (span, pad, axis, row, col)
    time = streams.time[span] - streams.time[span.start]
    measured, simulated, extended = streams.measured[where], streams.simulated[where], streams.extended[where]
    near = _near_worst(time, measured - simulated)
    before, after = (float(np.sqrt(np.mean((measured - other) ** 2))) for other in (simulated, extended))

    figure = Figure(figsize=(WIDTH, 3.1), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.3, 1])
    t, m, s, e = thin(time[near], measured[near], simulated[near], extended[near])
    above.plot(t, m, color=MEASURED, linewidth=2.4, label="measured")
    above.plot(t, s, color=SIMULATED, linewidth=1.3, linestyle=(0, (4, 1.5)), label="simulated")
    if with_model:
        above.plot(t, e, color=EXTENDED, linewidth=1.3, label="extended")
    above.set_ylabel(f"{AXES[axis]} force, N")
    below.plot(t, s - m, color=SIMULATED, linewidth=1.1)
    if with_model:
        below.plot(t, e - m, color=EXTENDED, linewidth=1.1)
    below.axhline(0, color=MUTED, linewidth=0.7)
    below.set_ylabel("error, N")
    below.set_xlabel("time in the episode, s")
    figure.align_ylabels()
    place = f"{streams.pad(pad)}, taxel ({row}, {col}), {AXES[axis]}"
    if not with_model:
        return finish(
            figure,
            f"Episode {streams.numbers[number]}, {place}: error {before:.2g} N",
            f"Traces of {place} in episode {streams.numbers[number]}: measured and simulated force, and the error "
            f"below. The RMS error is {before:.3g} N.",
        )
    return finish(
        figure,
        f"Episode {streams.numbers[number]}, {place}: error {before:.2g} N → {after:.2g} N",
        f"Traces of {place} in episode {streams.numbers[number]}: measured, simulated and extended force, and both "
        f"errors below. The RMS error is {before:.3g} N before and {after:.3g} N after.",
    )


def _near_worst(time: np.ndarray, error: np.ndarray) -> slice:
    """Return the samples of the `SECONDS` around the largest error."""
    if time[-1] - time[0] <= SECONDS:
        return slice(0, len(time))
    middle = np.clip(time[np.abs(error).argmax()], time[0] + SECONDS / 2, time[-1] - SECONDS / 2)
    start, stop = np.searchsorted(time, [middle - SECONDS / 2, middle + SECONDS / 2])
    return slice(int(start), int(stop))


def shares(symptoms: Symptoms, extended: bool = True) -> list[Picture]:
    """Return the error by phase of the motion, frequency, and pad and axis; before and, if there is a model, after."""
    pictures = []
    if sum(place.before for place in symptoms.pads) <= 0:
        return pictures
    for name, group in (("phase", symptoms.phases), ("frequency", symptoms.frequencies)):
        if group:
            most = max(group, key=lambda place: place.before)
            pictures.append(
                _shares(f"Error by {name}, largest share: {most.where} {most.before:.0%}", name, group, extended)
            )
    pads = [replace(place, where=pad_in_words(place.where)) for place in symptoms.pads]
    worst = [max(group, key=lambda place: place.before) for group in (pads, symptoms.axes)]
    title = "Error by pad and axis, largest shares: " + ", ".join(
        f"{place.where} {place.before:.0%}" for place in worst
    )
    return [*pictures, _shares(title, "pad and axis", (*pads, *symptoms.axes), extended)]


def _shares(title: str, name: str, group: Sequence[Place], extended: bool) -> Picture:
    figure, axes = panel(0.9 + 0.3 * len(group))
    rows = np.arange(len(group))
    height, shift = (0.36, 0.19) if extended else (0.6, 0.0)
    axes.barh(rows - shift, [100 * p.before for p in group], height=height, color=SIMULATED, label="simulated")
    if extended:
        axes.barh(rows + shift, [100 * p.after for p in group], height=height, color=EXTENDED, label="extended")
    axes.set_yticks(rows, [p.where for p in group], color=INK)
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("% of the simulation's error energy")
    words = "; ".join(f"{p.where} {p.before:.0%}" + (f", {p.after:.0%} after" if extended else "") for p in group)
    return finish(figure, title, f"Share of the error energy by {name}: {words}.")
