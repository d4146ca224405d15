"""Timing: what comes late or slowly: holds for creep, shifted edges for a delay, lost swings for a filter."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report.effect import Effect, Series
from paxisim.diagnose.report.style import (
    AXES,
    EXTENDED,
    INK,
    MEASURED,
    MUTED,
    SIMULATED,
    Picture,
    finish,
    panel,
    thin,
)

_EDGE = 12.0  # delays that a picture of an edge is wide


def holds(effect: Effect) -> list[Picture]:
    """Creep: a pad's force while it is held, and what grows meanwhile."""
    pad, axis = effect.axes[0]
    number = effect.best_episode(pad, axis)
    span = effect.streams.episodes[number]
    time = effect.streams.time[span] - effect.streams.time[span.start]
    t, measured, without, model = thin(time, *effect.sums(pad, axis, span))
    place = f"pad {effect.streams.pads[pad]}, {AXES[axis]}, all taxels, episode {number}"
    name = effect.cause.name

    figure, axes = panel()
    _three(axes, t, measured, without, model, name)
    axes.set_xlabel("time in the episode, s")
    axes.set_ylabel(f"{AXES[axis]} force of the pad, N")
    whole = finish(
        figure,
        "Under load the reading goes on after the force stands still",
        f"Measured force, and the model with and without {name}, {place}.",
    )

    figure, axes = panel()
    axes.axhline(0, color=SIMULATED, linewidth=1.2, linestyle=(0, (4, 1.5)), label="without")
    axes.plot(t, measured - without, ".", color=MEASURED, alpha=0.4, markersize=3.5, label="measured")
    axes.plot(t, model - without, color=EXTENDED, linewidth=1.8, label=f"with {name}")
    pressed = np.abs(without) > 0.1 * np.abs(without).max()
    axes.fill_between(t, 0, 1, where=pressed.tolist(), transform=axes.get_xaxis_transform(), color=MUTED, alpha=0.12, lw=0)
    axes.set_xlabel("time in the episode, s; grey: pressed")
    axes.set_ylabel("what comes on top, N")
    grows = finish(
        figure,
        "What comes on top builds up while pressed and dies away when released",
        f"Measured force minus the model without {name} in time, {place}: it grows under load and decays after it, as "
        f"the model with {name} does, by up to {np.abs(model - without).max():.3g} N.",
    )
    return [whole, grows]


def edges(effect: Effect) -> list[Picture]:
    """Latency and low-pass: the fastest edge from near, and how late or how flat all of them are."""
    channel = effect.channel
    number = int(effect.energy[(slice(None), *channel)].argmax())
    span = effect.streams.episodes[number]
    time = effect.streams.time[span] - effect.streams.time[span.start]
    measured, without, model = effect.at(channel, span)
    lag = _lag(effect, channel)
    interval = float(np.median(np.diff(time)))
    half = float(np.clip(_EDGE * abs(lag) / 2, 8 * interval, 1.5))
    middle = time[_busiest(np.abs(model - without), max(1, round(2 * half / interval)))]
    near = np.abs(time - middle) <= half
    axis, name = channel[1], effect.cause.name

    figure, axes = panel()
    axes.plot(time[near], without[near], color=SIMULATED, linewidth=1.4, linestyle=(0, (4, 1.5)), label="without")
    axes.plot(time[near], measured[near], "o", color=MEASURED, markersize=4, alpha=0.8, label="measured")
    axes.plot(time[near], model[near], color=EXTENDED, linewidth=1.7, label=f"with {name}")
    axes.set_xlabel("time in the episode, s")
    axes.set_ylabel(f"{AXES[axis]} force, N")
    place = f"{effect.place(channel)}, episode {number}"
    close = finish(
        figure,
        f"The measurement comes {'late' if lag > 0 else 'early'}: {abs(1e3 * lag):.0f} ms at this taxel"
        if name == "latency"
        else "Edges are rounded, and short swings are lost",
        f"The fastest moment of {place}: measured points lie on the model with {name}, beside the one without.",
    )
    return [close, _correlation(effect, channel) if name == "latency" else _swings(effect, channel)]


def _busiest(size: Series, width: int) -> int:
    """The middle of the stretch of `width` samples in which there is most."""
    return int(np.argmax(np.convolve(size**2, np.ones(min(width, len(size))), mode="same")))


def _lags(effect: Effect, channel: tuple[int, int, int, int]) -> tuple[Series, Series, Series]:
    """Lags (s), and how well the measured changes follow those of the model without and with the cause."""
    streams = effect.streams
    interval = float(np.median(np.diff(streams.time[streams.episodes[0]])))
    fine = interval / 8
    reach = max(0.25, 12 * interval)
    lags = np.arange(-round(reach / fine), round(reach / fine) + 1) * fine
    products = np.zeros((2, len(lags)))
    energies = np.zeros((3, 1))
    for span in streams.episodes:
        even = np.arange(streams.time[span][0], streams.time[span][-1], fine)
        changes = [np.diff(np.interp(even, streams.time[span], v)) for v in effect.at(channel, span)]
        for row, other in enumerate(changes[1:]):
            size = 2 * len(other)
            cross = np.fft.irfft(np.fft.rfft(changes[0], size) * np.conj(np.fft.rfft(other, size)), size)
            products[row] += cross[np.round(lags / fine).astype(int)]
        energies += np.array([[float(c @ c)] for c in changes])
    scale = np.sqrt(energies[0] * energies[1:])
    without, with_it = products / np.maximum(scale, 1e-12)
    return lags, without, with_it


def _lag(effect: Effect, channel: tuple[int, int, int, int]) -> float:
    lags, without, _ = _lags(effect, channel)
    return float(lags[without.argmax()])


def _correlation(effect: Effect, channel: tuple[int, int, int, int]) -> Picture:
    lags, without, with_it = _lags(effect, channel)
    figure, axes = panel()
    axes.plot(1e3 * lags, without, color=SIMULATED, linewidth=1.5, linestyle=(0, (4, 1.5)), label="without")
    axes.plot(1e3 * lags, with_it, color=EXTENDED, linewidth=1.8, label=f"with {effect.cause.name}")
    peaks = [float(1e3 * lags[v.argmax()]) for v in (without, with_it)]
    for peak, values, colour in zip(peaks, (without, with_it), (SIMULATED, EXTENDED), strict=True):
        axes.plot([peak], [values.max()], "o", color=colour, markersize=6)
        axes.annotate(f"{peak:.0f} ms", (peak, values.max()), (7, 1), textcoords="offset points", color=INK)
    axes.axvline(0, color=MUTED, linewidth=0.8)
    axes.set_ylim(top=1.12)
    axes.set_xlabel("measured later than the model by, ms")
    axes.set_ylabel("agreement of the changes")
    return finish(
        figure,
        f"The two streams agree best when shifted by {peaks[0]:.0f} ms",
        f"Correlation of the changes of measured and modelled force against the lag, {effect.place(channel)}: without "
        f"the cause it peaks at {peaks[0]:.0f} ms, with it at {peaks[1]:.0f} ms.",
    )


def _swings(effect: Effect, channel: tuple[int, int, int, int]) -> Picture:
    """How much of each frequency is measured, of what the model without the cause has."""
    streams = effect.streams
    interval = float(np.median(np.diff(streams.time[streams.episodes[0]])))
    size = min(min(s.stop - s.start for s in streams.episodes), max(16, round(4.0 / interval)))
    window = np.hanning(size)
    cross, own = np.zeros((2, size // 2 + 1), dtype=complex), np.zeros(size // 2 + 1)
    for span in streams.episodes:
        series = effect.at(channel, span)
        for start in range(0, span.stop - span.start - size + 1, max(1, size // 2)):
            cut = [np.fft.rfft(window * (v[start : start + size] - v[start : start + size].mean())) for v in series]
            cross += np.array([cut[0] * np.conj(cut[1]), cut[2] * np.conj(cut[1])])
            own += np.abs(cut[1]) ** 2
    frequency = np.fft.rfftfreq(size, interval)
    seen = (own > 1e-4 * own.max()) & (frequency > 0)
    measured, model = np.abs(cross[:, seen]) / own[seen]
    figure, axes = panel()
    axes.axhline(1, color=SIMULATED, linewidth=1.2, linestyle=(0, (4, 1.5)), label="without")
    axes.plot(frequency[seen], measured, "o", color=MEASURED, markersize=3.5, alpha=0.6, label="measured")
    axes.plot(frequency[seen], model, color=EXTENDED, linewidth=1.8, label=f"with {effect.cause.name}")
    axes.set_xscale("log")
    axes.set_ylim(0, max(1.25, min(1.6, float(measured.max()))))
    axes.set_xlabel("frequency, Hz")
    axes.set_ylabel("measured / without")
    axes.xaxis.set_major_formatter("{x:g}")
    return finish(
        figure,
        "The faster the swing, the less of it arrives",
        f"Share of the force that is measured against frequency, {effect.place(channel)}: measured points fall with "
        "frequency as the model with the cause does.",
    )


def _three(axes, t, measured, without, model, name) -> None:  # type: ignore[no-untyped-def]
    axes.plot(t, measured, color=MEASURED, linewidth=2.4, label="measured")
    axes.plot(t, without, color=SIMULATED, linewidth=1.3, linestyle=(0, (4, 1.5)), label="without")
    axes.plot(t, model, color=EXTENDED, linewidth=1.4, label=f"with {name}")
