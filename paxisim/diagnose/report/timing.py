"""Timing: pictures of causes that act over time: slow changes during holds, delays, and lost bandwidth."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from paxisim.diagnose.report import marks
from paxisim.diagnose.report.effect import Channel, Effect, Series
from paxisim.diagnose.report.style import (
    AXES,
    EXTENDED,
    INK,
    MUTED,
    SIMULATED,
    Picture,
    finish,
    logarithmic,
    panel,
    thin,
)

_EDGE = 12.0  # duration shown around an edge, in units of the delay
_MOST = 4  # episodes used to find the shift


def holds(effect: Effect) -> list[Picture]:
    """Force on a pad over time, and its deviation from the model without the cause."""
    pad, axis = effect.axes[0]
    number = effect.best_episode(pad, axis)
    span = effect.streams.episodes[number]
    time = effect.streams.time[span] - effect.streams.time[span.start]
    t, measured, lacking, model = thin(time, *effect.sums(pad, axis, span))
    place = f"{effect.streams.pad(pad)}, {AXES[axis]}, all taxels, episode {effect.streams.numbers[number]}"
    name = effect.cause.name

    figure, axes = panel()
    marks.force_trace(axes, t, measured, lacking, model, name)
    total = "mean of the {} channels, N" if effect.streams.calibrated else "{} force on the pad, N"
    axes.set_ylabel(total.format(AXES[axis]))
    whole = finish(
        figure,
        "The reading keeps changing under constant load",
        f"Measured force against time, and the model with and without {name}, {place}.",
    )

    figure, axes = panel()
    marks.level(axes)
    marks.cloud(axes, t, measured - lacking)
    marks.with_cause(axes, t, model - lacking, name)
    pressed = (np.abs(lacking) > 0.1 * np.abs(lacking).max()).tolist()
    axes.fill_between(t, 0, 1, where=pressed, transform=axes.get_xaxis_transform(), color=MUTED, alpha=0.13, lw=0)
    axes.set_xlabel("time in the episode, s (grey: pressed)")
    axes.set_ylabel("deviation, N")
    grows = finish(
        figure,
        "The deviation changes slowly during the hold and decays after release",
        f"Measured force minus force in the model without {name} against time, {place}. The model with {name} follows "
        f"it and reaches {np.abs(model - lacking).max():.3g} N.",
    )
    return [whole, grows]


def shift(effect: Effect) -> list[Picture]:
    """Force at the edge that shows the cause best, and the error against the shift between the streams."""
    lags, errors = _shifted(effect, effect.channel)
    late = float(lags[errors.argmin()]) > 0
    title = f"The measurement {'lags behind' if late else 'leads'} the simulation"
    return [_edge(effect, lags, errors, title), _shift(effect, effect.channel, lags, errors)]


def edges(effect: Effect) -> list[Picture]:
    """Force at the edge that shows the cause best, and the gain from simulation to measurement against frequency."""
    lags, errors = _shifted(effect, effect.channel)
    return [_edge(effect, lags, errors, "Fast edges are smoothed"), _swings(effect, effect.channel)]


def _edge(effect: Effect, lags: Series, errors: Series, title: str) -> Picture:
    channel = effect.channel
    number = int(effect.reduced[(slice(None), *channel)].argmax())
    span = effect.streams.episodes[number]
    time = effect.streams.time[span] - effect.streams.time[span.start]
    measured, lacking, model = effect.at(channel, span)
    best = float(lags[errors.argmin()])
    interval = float(np.median(np.diff(time)))
    half = float(np.clip(_EDGE * abs(best) / 2, 10 * interval, 1.5))
    nearer = np.convolve(effect.nearer((span, *channel)), np.ones(max(1, round(half / interval))), "same")
    middle = float(np.clip(time[nearer.argmax()], time[0] + half, time[-1] - half))
    near = np.abs(time - middle) <= half
    name = effect.cause.name

    figure, axes = panel()
    marks.without(axes, time[near], lacking[near])
    marks.with_cause(axes, time[near], model[near], name)
    marks.points(axes, time[near], measured[near])
    axes.set_xlabel("time in the episode, s")
    axes.set_ylabel(f"{AXES[channel[1]]} force, N")
    place = f"{effect.place(channel)}, episode {effect.streams.numbers[number]}"
    alt = f"Force at a fast edge on {place}. The measured points lie on the model with {name}."
    return finish(figure, title, alt)


def _shifted(effect: Effect, channel: Channel) -> tuple[Series, Series]:
    """Return lags (s), and the RMS error (N) of the model without the cause shifted by each lag, on a pad and axis."""
    streams, (pad, axis, _, _) = effect.streams, channel
    interval = float(np.median(np.diff(streams.time[streams.episodes[0]])))
    most = np.argsort(-effect.energy[:, pad, axis].sum(axis=(1, 2)), kind="stable")[:_MOST]
    parts = []
    for span in (streams.episodes[int(number)] for number in most):
        time = streams.time[span]
        fresh = np.concatenate([[True], np.diff(time) > 0])  # a spline needs increasing times
        parts.append((time, CubicSpline(time[fresh], effect.without[span, pad, axis][fresh], axis=0), span))

    def left(lags: Series) -> Series:
        squares = np.zeros(len(lags))
        for time, curve, span in parts:
            measured = streams.measured[span, pad, axis]
            for place, lag in enumerate(lags):
                squares[place] += np.sum((measured - curve(np.clip(time - lag, time[0], time[-1]))) ** 2)
        return np.sqrt(squares / sum(streams.measured[span, pad, axis].size for _, _, span in parts))

    coarse = np.linspace(-1, 1, 41) * max(0.2, 8 * interval)
    best = int(np.clip(left(coarse).argmin(), 1, len(coarse) - 2))
    fine = np.linspace(coarse[best - 1], coarse[best + 1], 21)[1:-1]
    lags = np.unique(np.concatenate([coarse, fine]))
    return lags, left(lags)


def _shift(effect: Effect, channel: Channel, lags: Series, errors: Series) -> Picture:
    best = int(errors.argmin())
    none = int(np.abs(lags).argmin())
    figure, axes = panel()
    axes.plot(1e3 * lags, errors, color=EXTENDED, linewidth=1.8)
    axes.plot([0], [errors[none]], "o", color=SIMULATED, markersize=7)
    axes.plot([1e3 * lags[best]], [errors[best]], "o", color=EXTENDED, markersize=7)
    side = -1 if lags[best] > 0 else 1  # away from the valley
    axes.annotate(
        "as recorded", (0, errors[none]), (9 * side, 0), textcoords="offset points",
        ha="right" if side < 0 else "left", va="center",
    )  # fmt: skip
    axes.annotate(
        f"{1e3 * lags[best]:.0f} ms", (1e3 * lags[best], errors[best]), (0, -13), textcoords="offset points",
        ha="center", color=INK,
    )  # fmt: skip
    axes.set_ylim(-0.16 * float(errors.max()), 1.08 * float(errors.max()))
    axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick <= errors.max()])
    axes.set_xlabel("shift of the simulation, ms")
    axes.set_ylabel("error, N")
    pad, axis, _, _ = channel
    return finish(
        figure,
        f"The error is smallest when the simulation is shifted by {1e3 * lags[best]:.0f} ms",
        f"RMS error of {effect.streams.pad(pad)}, {AXES[axis]}, against the shift of the simulation: "
        f"{errors[none]:.3g} N as recorded, minimum {errors[best]:.3g} N at {1e3 * lags[best]:.0f} ms.",
        legend=False,
    )


def _swings(effect: Effect, channel: Channel) -> Picture:
    """Gain from the model without the cause to the measurement, against frequency."""
    streams = effect.streams
    interval = float(np.median(np.diff(streams.time[streams.episodes[0]])))
    typical = int(np.median([s.stop - s.start for s in streams.episodes]))  # shorter episodes are left out
    size = min(typical, max(16, round(4.0 / interval)))
    window = np.hanning(size)
    cross, own = np.zeros((2, size // 2 + 1), dtype=complex), np.zeros(size // 2 + 1)
    for span in streams.episodes:
        series = effect.at(channel, span)
        for start in range(0, span.stop - span.start - size + 1, max(1, size // 2)):
            cut = [np.fft.rfft(window * (v[start : start + size] - v[start : start + size].mean())) for v in series]
            cross += np.array([cut[0] * np.conj(cut[1]), cut[2] * np.conj(cut[1])])
            own += np.abs(cut[1]) ** 2
    frequency = np.fft.rfftfreq(size, interval)
    seen = (own > 3e-4 * own.max()) & (frequency > 0)
    measured, model = np.abs(cross[:, seen]) / own[seen]
    figure, axes = panel()
    marks.level(axes, 1)
    marks.with_cause(axes, frequency[seen], model, effect.cause.name)
    marks.points(axes, frequency[seen], measured)
    logarithmic(axes, "x", frequency[seen])
    axes.set_ylim(0, max(1.25, min(1.6, float(measured.max(initial=0.0)))))
    axes.set_xlabel("frequency, Hz")
    axes.set_ylabel("gain (measured / without)")
    return finish(
        figure,
        "The gain falls with frequency",
        f"Gain from simulated to measured force against frequency, {effect.place(channel)}. The measured points fall "
        "with frequency, like the model with the cause.",
    )
