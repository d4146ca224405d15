"""Error: pictures of the error before and after the correction: its size, place and time, and what remains of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.report import style
from paxisim.diagnose.report.effect import Series, elapsed, largest, windows
from paxisim.diagnose.report.maps import grid_of_maps, worst_pads
from paxisim.diagnose.report.style import AXES, EXTENDED, INK, MEASURED, MUTED, PAPER, SIMULATED, Picture
from paxisim.diagnose.result import HeldOut, Interval, Place, Result, Streams, Symptoms, pad_in_words

_Model = tuple[str, NDArray[np.float32], str, Any]  # label, force, colour, line style
_EPISODES, _MOST_TICKS = 3, 12  # most episodes drawn as traces, and named below the bars
_SECONDS = 40.0  # longest trace
_LINE = 6.0  # least power of a spectral line, relative to its surroundings
_BINS = 12  # force bins


def gain_pictures(diagnosis: Result) -> list[Picture]:
    """Return pictures of the improvement by the extended model."""
    heldout, extended = diagnosis.heldout, bool(diagnosis.causes)
    causes = [_causes(diagnosis)] if extended else []
    episodes = [_episodes(diagnosis)] if extended and len(heldout.gain_per_episode) > 1 else []
    return [_sizes(heldout, extended), *causes, *episodes]


def percent(value: Interval | float) -> str:
    """Format a share in percent with its interval, without meaningless digits for a failing black box."""
    if isinstance(value, Interval):
        return value.percent(digits=0)
    return f"{value:.1%}" if value < 10 else "over 1000%"


def _sizes(heldout: HeldOut, extended: bool) -> Picture:
    rows = [("simulation", heldout.nrmse_before, SIMULATED)]
    rows += [("extended", heldout.nrmse_after, EXTENDED)] if extended else []
    rows += [("black box", heldout.ceiling_nrmse, MUTED)] if heldout.ceiling_nrmse is not None else []
    figure, axes = style.panel("normalised RMSE, %", height=0.85 + 0.38 * len(rows))
    floor = heldout.noise_floor
    most = max(heldout.nrmse_before, heldout.nrmse_after, floor)
    for place, (_, value, colour) in enumerate(rows):
        end = 100 * min(value, 1.1 * most)  # keeps a failing black box from squashing the other bars
        axes.barh(place, end, height=0.62, color=colour)
        style.note(axes, percent(value), (end, place), (4, 0), va="center")
    axes.axvline(100 * floor, color=INK, linewidth=1.2, linestyle=(0, (3, 2)))
    shift, aligned = (4, "left") if floor < 0.55 * most else (-4, "right")
    style.note(axes, f"noise floor {floor:.1%}", (100 * floor, -0.52), (shift, 3), ha=aligned, fontsize=8)
    style.name_rows(axes, [name for name, _, _ in rows])
    axes.set(ylim=(len(rows) - 0.5, -0.85), xlim=(0, 136 * most or 1.0))
    words = ", ".join(f"{name} {percent(value)}" for name, value, _ in rows)
    where = "Held-out" if len(heldout.gain_per_episode) > 1 else "In-sample"
    becomes = f" → {heldout.nrmse_after:.1%}" if extended else ""
    title = f"{where} error: {heldout.nrmse_before:.1%}{becomes}"
    alt = f"{where} normalised RMSE: {words}. The noise floor is {floor:.1%}."
    return style.finish(figure, title, alt)


def _causes(diagnosis: Result) -> Picture:
    causes = diagnosis.causes
    figure, axes = style.panel("% of the explainable error, 90% interval", height=0.85 + 0.38 * len(causes))
    for place, cause in enumerate(causes):
        gain = cause.gain
        axes.barh(place, 100 * gain.value, height=0.62, color=EXTENDED)
        if gain.low is not None and gain.high is not None:
            axes.plot([100 * gain.low, 100 * gain.high], [place, place], color=PAPER, linewidth=3.6)
            axes.plot([100 * gain.low, 100 * gain.high], [place, place], color=INK, linewidth=1.6)
        end = 100 * max(gain.value, gain.ends[1])
        style.note(axes, f"{gain.value:.0%}", (end, place), (5, 0), va="center")
    most = max(max(cause.gain.value, cause.gain.high or 0.0) for cause in causes)
    least = min(min(cause.gain.value, cause.gain.low or 0.0, 0.0) for cause in causes)
    style.name_rows(axes, [cause.name for cause in causes])
    axes.set(ylim=(len(causes) - 0.5, -0.5), xlim=(118 * least, max(120 * most, 1.0)))
    words = ", ".join(f"{cause.name} {cause.gain.value:.0%}" for cause in causes)
    title = "Gain of each cause: full model compared with the model without it"
    return style.finish(figure, title, f"Gain of each cause, with intervals: {words}.")


def _episodes(diagnosis: Result) -> Picture:
    gains = [100 * gain for gain in diagnosis.heldout.gain_per_episode]
    # a loaded diagnosis has no streams and so does not know the numbers
    numbers = range(len(gains)) if diagnosis.streams is None else diagnosis.streams.numbers
    label = "episode" if diagnosis.streams is not None else "episode, counted from 0"
    figure, axes = style.panel(label, "error removed, %", 2.0)
    shown = [max(gain, -100.0) for gain in gains]
    axes.bar(range(len(gains)), shown, color=[EXTENDED if gain >= 0 else SIMULATED for gain in gains], width=0.7)
    axes.axhline(0, color=INK, linewidth=0.8)
    axes.set_ylim(min(0.0, 1.1 * min(shown)), 100)
    shown_at = range(0, len(gains), -(-len(gains) // _MOST_TICKS))
    axes.set_xticks(shown_at, [str(numbers[i]) for i in shown_at])
    axes.grid(axis="x", visible=False)
    better = f"{sum(gain > 0 for gain in gains)} of {len(gains)} episodes"
    title = f"The error decreases in {better}"
    alt = f"Share of each episode's error energy that the model removes. It is positive in {better}."
    return style.finish(figure, title, alt)


def places(streams: Streams, extended: bool = True) -> list[Picture]:
    """Return maps of the error of each taxel, by pad and axis: before and, if there is a model, after."""
    errors = {}
    for when, other in (("before", streams.simulated), ("after", streams.extended))[: 1 + extended]:
        # episode by episode, to save memory
        square = sum(np.sum((streams.measured[s] - other[s]) ** 2, axis=0, dtype=float) for s in streams.episodes)
        errors[when] = np.sqrt(square / len(streams.time)) * streams.alive
    before = errors["before"]
    pads = worst_pads(before**2)
    limit = float(before[pads].max())
    if limit == 0:
        return []
    order = np.argsort(-(before**2).sum(axis=(0, 2, 3)), kind="stable").tolist()
    return [_places(streams, errors, pads, axis, limit) for axis in order]


def _places(streams: Streams, errors: dict[str, Series], pads: list[int], axis: int, limit: float) -> Picture:
    before = errors["before"][:, axis]
    pad, row, col = largest(before)
    at = f"the worst taxel is ({row}, {col}) of {streams.pad(pad)} with {before.max():.3g} N"
    sizes = [float(np.sqrt(np.mean(error[:, axis] ** 2))) for error in errors.values()]
    maps = [(f"{streams.pad(pad)}, {when}", error[pad, axis]) for pad in pads for when, error in errors.items()]
    when, words = ", before and after", f"Overall {sizes[0]:.3g} N before and {sizes[-1]:.3g} N after; before, {at}."
    if len(errors) == 1:
        maps = [(streams.pad(pad), errors["before"][pad, axis]) for pad in pads]
        when, words = "", f"Overall {sizes[0]:.3g} N; {at}."
    title = f"{AXES[axis]}: RMS error {' → '.join(f'{size:.2g} N' for size in sizes)}"
    alt = f"Maps of the RMS error of each taxel on {AXES[axis]}, by pad{when}. {words}"
    return style.finish(grid_of_maps(streams.layout, maps, limit=limit), title, alt)


def worst_episodes(streams: Streams, extended: bool = True) -> list[Picture]:
    """Return traces of the episodes with the largest error, each with its worst channel."""
    square = [np.sum((streams.measured[s] - streams.simulated[s]) ** 2, axis=0, dtype=float) for s in streams.episodes]
    energy = np.where(streams.alive, square, 0.0)
    order = np.argsort(-energy.sum(axis=(1, 2, 3, 4)), kind="stable")[:_EPISODES]
    return [_trace(streams, int(number), energy[number], extended) for number in order]


def _trace(streams: Streams, number: int, energy: Series, with_model: bool) -> Picture:
    pad, axis, row, col = largest(energy)
    where = (streams.episodes[number], pad, axis, row, col)
    time, measured = elapsed(streams, number), streams.measured[where]
    models = _models(streams, with_model, style.DASHES)
    errors = [float(np.sqrt(np.mean((measured - force[where]) ** 2))) for _, force, _, _ in models]
    near = _near_worst(time, measured - streams.simulated[where])
    figure = style.blank(3.1)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.3, 1])
    above.plot(*style.thin(time[near], measured[near]), color=MEASURED, linewidth=2.4, label="measured")
    for label, force, colour, line in models:
        t, f, m = style.thin(time[near], force[where][near], measured[near])
        above.plot(t, f, color=colour, linewidth=1.3, linestyle=line, label=label)
        below.plot(t, f - m, color=colour, linewidth=1.1)
    above.set_ylabel(f"{AXES[axis]} force, N")
    below.axhline(0, color=MUTED, linewidth=0.7)
    below.set(xlabel="time in the episode, s", ylabel="error, N")
    figure.align_ylabels()
    episode, place = streams.numbers[number], f"{streams.pad(pad)}, taxel ({row}, {col}), {AXES[axis]}"
    title = f"Episode {episode}, {place}: error {' → '.join(f'{error:.2g} N' for error in errors)}"
    traces, said = "measured and simulated force, and the error", f"{errors[0]:.3g} N"
    if with_model:
        traces = "measured, simulated and extended force, and both errors"
        said = f"{errors[0]:.3g} N before and {errors[1]:.3g} N after"
    alt = f"Traces of {place} in episode {episode}: {traces} below. The RMS error is {said}."
    return style.finish(figure, title, alt)


def _models(streams: Streams, extended: bool, dashes: Any) -> list[_Model]:
    simulated = ("simulated", streams.simulated, SIMULATED, dashes)
    return [simulated, ("extended", streams.extended, EXTENDED, "-")] if extended else [simulated]


def _near_worst(time: Series, error: NDArray[np.float32]) -> slice:
    """Return the samples of the `_SECONDS` around the largest error."""
    if time[-1] - time[0] <= _SECONDS:
        return slice(0, len(time))
    middle = np.clip(time[np.abs(error).argmax()], time[0] + _SECONDS / 2, time[-1] - _SECONDS / 2)
    start, stop = np.searchsorted(time, [middle - _SECONDS / 2, middle + _SECONDS / 2])
    return slice(int(start), int(stop))


def shares(symptoms: Symptoms, extended: bool = True) -> list[Picture]:
    """Return the error by phase of the motion, frequency, and pad and axis; before and, if there is a model, after."""
    if sum(place.before for place in symptoms.pads) <= 0:
        return []
    pads = tuple(replace(place, where=pad_in_words(place.where)) for place in symptoms.pads)
    kinds = {"phase": [symptoms.phases], "frequency": [symptoms.frequencies], "pad and axis": [pads, symptoms.axes]}
    return [_shares(name, groups, extended) for name, groups in kinds.items() if all(groups)]


def _shares(name: str, groups: Sequence[Sequence[Place]], extended: bool) -> Picture:
    places = [place for group in groups for place in group]
    figure, axes = style.panel("% of the simulation's error energy", height=0.9 + 0.3 * len(places))
    rows = np.arange(len(places))
    height, shift = (0.36, 0.19) if extended else (0.6, 0.0)
    axes.barh(rows - shift, [100 * p.before for p in places], height=height, color=SIMULATED, label="simulated")
    if extended:
        axes.barh(rows + shift, [100 * p.after for p in places], height=height, color=EXTENDED, label="extended")
    style.name_rows(axes, [place.where for place in places])
    axes.invert_yaxis()
    words = "; ".join(f"{p.where} {p.before:.0%}" + (f", {p.after:.0%} after" if extended else "") for p in places)
    worst = [max(group, key=lambda place: place.before) for group in groups]
    title = f"Error by {name}, largest share{'s' if len(worst) > 1 else ''}: "
    title += ", ".join(f"{place.where} {place.before:.0%}" for place in worst)
    return style.finish(figure, title, f"Share of the error energy by {name}: {words}.")


def remains(streams: Streams, extended: bool) -> list[Picture]:
    """Return the residual of the simulation and, if there is one, of the extended model, by frequency and by force."""
    models = _models(streams, extended, style.DASHES if extended else "-")
    return [_frequencies(streams, models), _forces(streams, models)]


def _frequencies(streams: Streams, models: list[_Model]) -> Picture:
    figure, axes = style.panel("frequency, Hz", "residual, N per √Hz")
    spectra = [_spectrum(streams, other) for _, other, _, _ in models]
    for (label, _, colour, line), spectrum in zip(models, spectra, strict=True):
        axes.plot(*spectrum, color=colour, linewidth=1.5, linestyle=line, label=label)
    frequency, size = spectra[-1]
    style.logarithmic(axes, "x", frequency)
    style.logarithmic(axes, "y", np.concatenate([size for _, size in spectra]))
    around = np.array([np.median(size[max(0, i - 6) : i + 7]) for i in range(len(size))])
    at = int(np.argmax(size / np.maximum(around, 1e-12)))
    has_line = at > 3 and size[at] > np.sqrt(_LINE) * around[at]
    found = f": a line at {frequency[at]:.2g} Hz" if has_line else ""
    alt = f"Spectrum of the residual, mean of all channels{found}."
    return style.finish(figure, f"Residual by frequency{found}", alt)


def _spectrum(streams: Streams, other: NDArray[np.float32]) -> tuple[Series, Series]:
    """Frequencies (Hz), and the residual's amplitude spectral density (N/√Hz), averaged over channels and windows."""
    interval, spans = windows(streams, seconds=8.0, least=32)
    length = spans[0].stop - spans[0].start
    window, power = np.hanning(length), np.zeros(length // 2 + 1)
    for span in spans:
        error = ((streams.measured[span] - other[span]) * streams.alive).reshape(length, -1)
        power += np.mean(np.abs(np.fft.rfft((error - error.mean(axis=0)) * window[:, None], axis=0)) ** 2, axis=1)
    density = 2 * interval * power / len(spans) / np.sum(window**2)
    return np.fft.rfftfreq(length, interval)[1:], np.sqrt(np.maximum(density[1:], 1e-18))


def _forces(streams: Streams, models: list[_Model]) -> Picture:
    peak = max(streams.peak, 1e-9)
    figure, axes = style.panel("force on the taxel, N", "RMS residual of the taxel, N")
    for label, other, colour, line in models:
        square, count = np.zeros(_BINS), np.zeros(_BINS)
        for span in streams.episodes:
            force = np.linalg.norm(streams.simulated[span], axis=2)
            error = np.sum((streams.measured[span] - other[span]) ** 2, axis=2, where=streams.alive)
            cell = np.minimum((_BINS * force / peak).astype(int), _BINS - 1).ravel()
            square += np.bincount(cell, weights=error.ravel(), minlength=_BINS)
            count += np.bincount(cell, minlength=_BINS)
        enough = count >= 20
        middle = (np.arange(_BINS) + 0.5) * peak / _BINS
        root = np.sqrt(square[enough] / count[enough])
        axes.plot(middle[enough], root, "o", linestyle=line, color=colour, markersize=4, linewidth=1.5, label=label)
    axes.set_ylim(0, 1.08 * axes.get_ylim()[1])
    return style.finish(figure, "Residual by force", "RMS residual of a taxel against the force on it.")
