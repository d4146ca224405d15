"""Timing: pictures against time, frequency and covariates, for causes that act in time or show at rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from paxisim.diagnose.data.directions import followed
from paxisim.diagnose.report import style
from paxisim.diagnose.report.effect import Channel, Effect, Series, elapsed, largest, windows
from paxisim.diagnose.report.style import AXES, EXTENDED, MEASURED, MUTED, SIMULATED, Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_EDGE = 12.0  # duration shown around an edge, in units of the delay
_MOST = 4  # episodes used to find the shift
_LABELS = {"gripper_opening": ("gripper opening, mm", 1e3), "temperature": ("temperature, °C", 1.0)}


def plain(effect: Effect) -> list[Picture]:
    """Measured deviation and effect of any cause, over time and against each other."""
    channel, name = effect.channel, effect.cause.name
    number = effect.most_affected(*channel)[0]
    t, measured, lacking, model = _in_episode(effect, number, effect.at(channel))
    place = effect.place(channel)
    figure, axes = style.panel("time in the episode, s", f"deviation on {AXES[channel[1]]}, N")
    style.level(axes)
    style.cloud(axes, t, measured - lacking)
    style.with_cause(axes, t, model - lacking, name)
    title = f"Deviation without {name}, and effect of {name}"
    alt = f"{effect.deviation}, and the effect of {name}, against time, {place}, episode "
    alt += f"{effect.streams.numbers[number]}."
    in_time = style.finish(figure, title, alt)

    measured, lacking, model = effect.at(channel)
    adds = model - lacking
    figure, axes = style.panel(f"effect of {name}, N", "measured deviation, N")
    style.cloud(axes, adds, measured - lacking)
    style.level(axes)
    ends = np.array([adds.min(), adds.max()])
    style.with_cause(axes, ends, ends, name)
    title = f"Measured deviation against the effect of {name}"
    alt = f"{effect.deviation}, against the effect of {name}, {place}. The points scatter around the line of equality."
    return [in_time, style.finish(figure, title, alt)]


def holds(effect: Effect) -> list[Picture]:
    """Force on a pad over time, and its deviation from the model without the cause."""
    pad, axis = effect.axes[0]
    name, streams = effect.cause.name, effect.streams
    number = effect.most_affected(pad, axis)[0]
    t, measured, lacking, model = _in_episode(effect, number, effect.sums(pad, axis))
    place = f"{streams.pad(pad)}, {AXES[axis]}, all taxels, episode {streams.numbers[number]}"
    total = f"mean of the {AXES[axis]} channels, N" if streams.calibrated else f"{AXES[axis]} force on the pad, N"
    title = "The reading keeps changing under constant load"
    alt = f"Measured force against time, and the model with and without {name}, {place}."
    whole = style.finish(_forces(effect, total, t, (measured, lacking, model)), title, alt)

    figure, axes = style.panel("time in the episode, s (grey: pressed)", "deviation, N")
    style.level(axes)
    style.cloud(axes, t, measured - lacking)
    style.with_cause(axes, t, model - lacking, name)
    pressed = (np.abs(lacking) > 0.1 * np.abs(lacking).max()).tolist()
    axes.fill_between(t, 0, 1, where=pressed, transform=axes.get_xaxis_transform(), color=MUTED, alpha=0.13, lw=0)
    title = "The deviation changes slowly during the hold and decays after release"
    alt = f"{effect.deviation} against time, {place}. The model with {name} follows it and reaches "
    alt += f"{np.abs(model - lacking).max():.3g} N."
    return [whole, style.finish(figure, title, alt)]


def trace(effect: Effect, title: str, channel: Channel = ()) -> Picture:
    """Draw the force on a channel, by default the most affected one, in the episode that shows the cause best."""
    channel = channel or effect.channel
    number, place = effect.most_affected(*channel)[0], effect.place(channel)
    time, *forces = _in_episode(effect, number, effect.at(channel))
    figure = _forces(effect, f"{AXES[channel[1]]} force, N", time, forces)
    alt = f"Measured force on {place} in episode {effect.streams.numbers[number]}, and the model with and without "
    alt += f"{effect.cause.name}."
    return style.finish(figure, f"{title} ({place})", alt)


def _in_episode(effect: Effect, number: int, forces: tuple[Series, ...]) -> tuple[Series, ...]:
    """Return time in an episode (s) and three forces (N), thinned."""
    return style.thin(elapsed(effect.streams, number), *(force[effect.streams.episodes[number]] for force in forces))


def _forces(effect: Effect, label: str, time: Series, forces: Sequence[Series]) -> Figure:
    figure, axes = style.panel("time in the episode, s", label)
    axes.plot(time, forces[0], color=MEASURED, linewidth=2.5, label="measured")
    style.without(axes, time, forces[1])
    style.with_cause(axes, time, forces[2], effect.cause.name, 1.4)
    return figure


def shift(effect: Effect) -> list[Picture]:
    """Force at the edge that shows the cause best, and the error against the shift between the streams."""
    lags, errors = _shifted(effect)
    best, none = int(errors.argmin()), int(np.abs(lags).argmin())
    lag, most = 1e3 * lags[best], float(errors.max())
    figure, axes = style.panel("shift of the simulation, ms", "error, N")
    axes.plot(1e3 * lags, errors, color=EXTENDED, linewidth=1.8)
    axes.plot([0], [errors[none]], "o", color=SIMULATED, markersize=7)
    axes.plot([lag], [errors[best]], "o", color=EXTENDED, markersize=7)
    aside, aligned = (-9, "right") if lag > 0 else (9, "left")  # away from the valley
    style.note(axes, "as recorded", (0, errors[none]), (aside, 0), ha=aligned, va="center")
    style.note(axes, f"{lag:.0f} ms", (lag, errors[best]), (0, -13), ha="center")
    axes.set_ylim(-0.16 * most, 1.08 * most)
    axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick <= most])
    pad, axis, _, _ = effect.channel
    title = f"The error is smallest when the simulation is shifted by {lag:.0f} ms"
    alt = f"RMS error of {effect.streams.pad(pad)}, {AXES[axis]}, against the shift of the simulation: "
    alt += f"{errors[none]:.3g} N as recorded, minimum {errors[best]:.3g} N at {lag:.0f} ms."
    edge = _edge(effect, lags, errors, f"The measurement {'lags behind' if lag > 0 else 'leads'} the simulation")
    return [edge, style.finish(figure, title, alt)]


def edges(effect: Effect) -> list[Picture]:
    """Force at the edge that shows the cause best, and the gain from simulation to measurement against frequency."""
    interval, spans = windows(effect.streams, seconds=4.0, least=16)
    size = spans[0].stop - spans[0].start
    cross, own = np.zeros((2, size // 2 + 1), dtype=complex), np.zeros(size // 2 + 1)
    forces = effect.at(effect.channel)
    for cut in ([force[span] for force in forces] for span in spans):
        measured, lacking, model = (np.fft.rfft(np.hanning(size) * (force - force.mean())) for force in cut)
        cross += np.array([measured * np.conj(lacking), model * np.conj(lacking)])
        own += np.abs(lacking) ** 2
    frequency = np.fft.rfftfreq(size, interval)
    seen = (own > 3e-4 * own.max()) & (frequency > 0)
    measured, model = np.abs(cross[:, seen]) / own[seen]
    figure, axes = style.panel("frequency, Hz", "gain (measured / without)")
    style.level(axes, 1)
    style.with_cause(axes, frequency[seen], model, effect.cause.name)
    style.points(axes, frequency[seen], measured)
    style.logarithmic(axes, "x", frequency[seen])
    axes.set_ylim(0, max(1.25, min(1.6, float(measured.max(initial=0.0)))))
    title = "The gain falls with frequency"
    alt = f"Gain from simulated to measured force against frequency, {effect.place(effect.channel)}. The measured "
    alt += "points fall with frequency, like the model with the cause."
    edge = _edge(effect, *_shifted(effect), "Fast edges are smoothed")
    return [edge, style.finish(figure, title, alt)]


def _edge(effect: Effect, lags: Series, errors: Series, title: str) -> Picture:
    channel, name = effect.channel, effect.cause.name
    number = int(effect.reduced[(slice(None), *channel)].argmax())
    span, time = effect.streams.episodes[number], elapsed(effect.streams, number)
    measured, lacking, model = (force[span] for force in effect.at(channel))
    interval = float(np.median(np.diff(time)))
    half = float(np.clip(_EDGE * abs(float(lags[errors.argmin()])) / 2, 10 * interval, 1.5))
    nearer = np.convolve(effect.nearer((span, *channel)), np.ones(max(1, round(half / interval))), "same")
    middle = float(np.clip(time[nearer.argmax()], time[0] + half, time[-1] - half))
    near = np.abs(time - middle) <= half
    figure, axes = style.panel("time in the episode, s", f"{AXES[channel[1]]} force, N")
    style.without(axes, time[near], lacking[near])
    style.with_cause(axes, time[near], model[near], name)
    style.points(axes, time[near], measured[near])
    place = f"{effect.place(channel)}, episode {effect.streams.numbers[number]}"
    alt = f"Force at a fast edge on {place}. The measured points lie on the model with {name}."
    return style.finish(figure, title, alt)


def _shifted(effect: Effect) -> tuple[Series, Series]:
    """Return lags (s), and the RMS error (N) on a pad and axis of the model without the cause shifted by each lag."""
    streams, (pad, axis, _, _) = effect.streams, effect.channel
    interval = float(np.median(np.diff(streams.time[streams.episodes[0]])))
    parts = []
    for span in (streams.episodes[number] for number in effect.most_affected(pad, axis)[:_MOST]):
        time = streams.time[span]
        fresh = np.concatenate([[True], np.diff(time) > 0])  # a spline needs increasing times
        curve = CubicSpline(time[fresh], effect.without[span, pad, axis][fresh], axis=0)
        parts.append((time, curve, streams.measured[span, pad, axis]))

    def left(lags: Series) -> Series:
        squares = np.zeros(len(lags))
        for time, curve, measured in parts:
            for place, lag in enumerate(lags):
                squares[place] += np.sum((measured - curve(np.clip(time - lag, time[0], time[-1]))) ** 2)
        return np.sqrt(squares / sum(measured.size for _, _, measured in parts))

    coarse = np.linspace(-1, 1, 41) * max(0.2, 8 * interval)
    best = int(np.clip(left(coarse).argmin(), 1, len(coarse) - 2))
    fine = np.linspace(coarse[best - 1], coarse[best + 1], 21)[1:-1]
    lags = np.unique(np.concatenate([coarse, fine]))
    return lags, left(lags)


def covariate(effect: Effect) -> list[Picture]:
    """Mean reading of a pad at rest against the covariate that it follows, on the two most affected axes."""
    return [_against_covariate(effect, pad, axis) for pad, axis in effect.axes[:2]]


def _at_rest(effect: Effect) -> NDArray[np.bool_]:
    rest = effect.streams.at_rest
    return rest if rest.sum() >= 20 else np.ones(len(rest), dtype=bool)


def _against_covariate(effect: Effect, pad: int, axis: int) -> Picture:
    streams, frames = effect.streams, _at_rest(effect)
    measured, lacking, model = (force[frames] / streams.layout.taxels for force in effect.sums(pad, axis))
    covariate = followed(effect.member, streams.covariates, (model - lacking)[:, None], frames)[0]
    label, scale = _LABELS.get(covariate, (covariate, 1.0))
    what = f"the {label.split(',')[0]}" if covariate in _LABELS else label
    x = (scale * streams.covariates[covariate])[frames]
    seen, adds = measured - lacking, model - lacking
    middle = float(np.mean(seen - adds))  # the effect is determined only up to a constant
    figure, axes = style.panel(f"{label} (pads unloaded)", f"{AXES[axis]} reading, N per taxel")
    style.cloud(axes, x, seen)
    style.level(axes, middle)
    x, adds_at = style.binned(x, adds + middle, bins=60, least=1)
    style.with_cause(axes, x, adds_at, effect.cause.name)
    swing, place = float(adds.max() - adds.min()), f"{streams.pad(pad)}, {AXES[axis]}"
    title = f"{place}: the reading without contact changes by {swing:.2g} N with {what}"
    alt = f"Mean reading of {place} at rest against {label}. The points follow the curve of the model with "
    alt += f"{effect.cause.name}, which spans {swing:.3g} N."
    return style.finish(figure, title, alt)


def zero_against_time(effect: Effect, shift: Series, title: str) -> Picture:
    """Draw the mean reading at rest of those taxels of one pad and axis whose zero shifts in the same direction.

    `shift` is the fitted shift of each channel, ``(pads, 3, rows, cols)`` N. Averaging reduces noise.
    """
    name, streams, frames = effect.cause.name, effect.streams, _at_rest(effect)
    side, pad, axis = largest(np.stack([np.clip(shift, 0, None), np.clip(-shift, 0, None)]).sum(axis=(3, 4)))
    taxels = shift[pad, axis] * (1 - 2 * side) > 0
    measured, lacking, model = (f[:, pad, axis][:, taxels].mean(axis=1, dtype=float) for f in effect.forces)
    seen, minutes = measured - lacking, (streams.time - streams.time[0]) / 60
    figure, axes = style.panel("time, min (pads unloaded)", f"{AXES[axis]} reading, N per taxel")
    style.cloud(axes, minutes[frames], seen[frames], faint=True)
    style.level(axes)
    at, adds = style.thin(minutes, model - lacking)
    style.with_cause(axes, at, adds, name)
    rests = [np.flatnonzero(frames[span]) + span.start for span in streams.episodes]
    means = [(minutes[rest].mean(), seen[rest].mean()) for rest in rests if len(rest)]
    style.points(axes, *np.array(means).T, label="measured, mean")
    place = f"{streams.pad(pad)}, {AXES[axis]}, mean of {int(taxels.sum())} taxels"
    alt = f"Reading at rest against time, {place}. The episode means lie on the line of the model with {name}."
    return style.finish(figure, f"{title} ({place})", alt)
