"""Remains: pictures of the residual that no cause explains, by frequency and by force."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.report.effect import Series
from paxisim.diagnose.report.marks import DASHES
from paxisim.diagnose.report.style import EXTENDED, SIMULATED, Picture, finish, logarithmic, panel
from paxisim.diagnose.result import Streams

_LINE = 6.0  # least power of a spectral line, relative to its surroundings
_BINS = 12  # force bins


def remains(streams: Streams, extended: bool) -> list[Picture]:
    """Return the residual of the simulation and, if there is one, of the extended model, by frequency and by force."""
    kinds = [(streams.simulated, SIMULATED, "simulated", DASHES if extended else "-")]
    if extended:
        kinds.append((streams.extended, EXTENDED, "extended", "-"))
    return [_frequencies(streams, kinds), _forces(streams, kinds)]


def _frequencies(streams: Streams, kinds) -> Picture:  # type: ignore[no-untyped-def]
    figure, axes = panel()
    frequency, size, sizes = np.zeros(0), np.zeros(0), []
    for other, colour, label, style in kinds:
        frequency, size = _spectrum(streams, other)
        sizes.append(size)
        axes.plot(frequency, size, color=colour, linewidth=1.5, linestyle=style, label=label)
    logarithmic(axes, "x", frequency)
    logarithmic(axes, "y", np.concatenate(sizes))
    axes.set_xlabel("frequency, Hz")
    axes.set_ylabel("residual, N per √Hz")
    around = np.array([np.median(size[max(0, i - 6) : i + 7]) for i in range(len(size))])
    at = int(np.argmax(size / np.maximum(around, 1e-12)))
    told = at > 3 and size[at] > np.sqrt(_LINE) * around[at]
    line = f": a line at {frequency[at]:.2g} Hz" if told else ""
    return finish(
        figure,
        f"Residual by frequency{line}",
        f"Spectrum of the residual, mean of all channels{line}.",
    )


def _spectrum(streams: Streams, other: np.ndarray) -> tuple[Series, Series]:
    """Frequencies (Hz), and the residual's amplitude spectral density (N/√Hz), averaged over channels and episodes."""
    interval = float(np.median(np.diff(streams.time[streams.episodes[0]])))
    typical = int(np.median([s.stop - s.start for s in streams.episodes]))  # shorter episodes are ignored
    length = min(typical, max(32, round(8.0 / interval)))
    window = np.hanning(length)
    power, count = np.zeros(length // 2 + 1), 0
    for span in streams.episodes:
        for start in range(span.start, span.stop - length + 1, max(1, length // 2)):
            part = slice(start, start + length)
            error = ((streams.measured[part] - other[part]) * streams.alive).reshape(length, -1)
            power += np.mean(np.abs(np.fft.rfft((error - error.mean(axis=0)) * window[:, None], axis=0)) ** 2, axis=1)
            count += 1
    density = 2 * interval * power / max(count, 1) / np.sum(window**2)
    return np.fft.rfftfreq(length, interval)[1:], np.sqrt(np.maximum(density[1:], 1e-18))


def _forces(streams: Streams, kinds) -> Picture:  # type: ignore[no-untyped-def]
    peak = max(streams.peak, 1e-9)
    figure, axes = panel()
    for other, colour, label, style in kinds:
        square, count = np.zeros(_BINS), np.zeros(_BINS)
        for span in streams.episodes:
            force = np.linalg.norm(streams.simulated[span], axis=2)
            error = np.sum((streams.measured[span] - other[span]) ** 2, axis=2, where=streams.alive)
            cell = np.minimum((_BINS * force / peak).astype(int), _BINS - 1).ravel()
            square += np.bincount(cell, weights=error.ravel(), minlength=_BINS)
            count += np.bincount(cell, minlength=_BINS)
        told = count >= 20
        middle = (np.arange(_BINS) + 0.5) * peak / _BINS
        root = np.sqrt(square[told] / count[told])
        axes.plot(middle[told], root, "o", linestyle=style, color=colour, markersize=4, linewidth=1.5, label=label)
    axes.set_ylim(0, 1.08 * axes.get_ylim()[1])
    axes.set_xlabel("force on the taxel, N")
    axes.set_ylabel("RMS residual of the taxel, N")
    return finish(figure, "Residual by force", "RMS residual of a taxel against the force on it.")
