"""Figures of a calibration: where the presses were cut, and how well the loads explain each channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from paxisim.calibrate.linear import AXES, LinearCalibration
from paxisim.calibrate.loads import values_of
from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.presses import MIN_SAMPLES, Presses, find_presses
from paxisim.recording import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK, _LOAD, _PRESS, _CUT = "#444444", "#2b5c94", "#e4ecf5", "#c2030f"
_MEASURED, _EXPECTED = "#9a9a9a", "#2b5c94"
_AXIS_COLORS = ("#2b5c94", "#0b8a3a", "#d1711f")
_MOST_POINTS = 6000  # of a line
_LOW = 12.0  # height of the lower panel, in multiples of the lower threshold above rest


def plot_presses(presses: Presses) -> Figure:
    """Plot the presses found in a load signal: the whole signal, and an enlarged view near rest.

    Args:
        presses: Result of `paxisim.find_presses`.

    Returns:
        A figure that is not shown in a window; use ``figure.savefig("presses.png")``. Presses are shaded, cuts between
        episodes are red lines, and thresholds are dashed lines.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure("plot_presses", (10, 5.2))
    _draw_presses(figure.subplots(2, 1, sharex=True), presses)
    return figure


def plot_calibration(readout: LinearCalibration, recording: Recording) -> Figure:
    """Plot a calibration: the cuts, the held-out error of each channel, and the least and best explained channels.

    Args:
        readout: Result of `paxisim.calibrate_readout`.
        recording: The recording that the readout was fitted to, or another one of the same sensor.

    Returns:
        A figure that is not shown in a window; use ``figure.savefig("calibration.png")``.

    Raises:
        InvalidValueError: The recording does not fit the readout.
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure("plot_calibration", (10, 11))
    values = values_of(recording, readout.loads)
    known = np.isfinite(values).all(axis=1)
    if recording.measured is None or known.sum() < MIN_SAMPLES:
        raise InvalidValueError("the figure of a calibration needs the measured tensor and 8 samples with a known load")
    names = ", ".join(load.name for load in readout.loads)
    title = f"{readout.used.sum()} channels from {names}, delay {1e3 * readout.delay:.1f} ms"
    figure.suptitle(title, fontsize="large", parse_math=False)
    upper, middle, lower = figure.subfigures(3, 1, height_ratios=[4.6, 2.4, 4.4], squeeze=False).ravel()
    elapsed = recording[known].elapsed
    _draw_presses(upper.subplots(2, 1, sharex=True), find_presses(elapsed, values[known]))
    _draw_errors(middle.add_subplot(), readout)
    applied = readout.apply(recording)
    used = np.argwhere(readout.used)
    order = np.argsort(readout.explained[readout.used], kind="stable")
    for ax, which, what in zip(
        lower.subplots(2, 1, sharex=True), (order[0], order[-1]), ("least", "best"), strict=True
    ):
        _draw_channel(ax, elapsed, readout, applied, tuple(int(i) for i in used[which]), what)
    lower.axes[-1].set_xlabel("time (s)")
    return figure


def new_figure(purpose: str, size: tuple[float, float]) -> Figure:
    """Return an empty figure that is not shown in a window.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib", "viz", purpose) from error
    return Figure(figsize=size, layout="constrained")


def _draw_presses(axes: NDArray[np.object_], presses: Presses) -> None:
    stride = -(-len(presses.time) // _MOST_POINTS)
    for ax in axes:
        for span in presses.spans:
            ax.axvspan(presses.time[span.start], presses.time[span.stop - 1], color=_PRESS, linewidth=0)
        for cut in presses.cuts:
            ax.axvline(presses.time[cut], color=_CUT, linewidth=1)
        for level in (presses.low, presses.high):
            ax.axhline(level, color=_INK, linewidth=0.8, linestyle="--")
        ax.set_xlim(presses.time[0], presses.time[-1])
        plain(ax)
    axes[0].plot(presses.time[::stride], presses.load[::stride], color=_LOAD, linewidth=0.9)
    axes[1].plot(presses.time, presses.load, color=_LOAD, linewidth=0.7)
    top = presses.rest + max(_LOW * (presses.low - presses.rest), 2 * (presses.high - presses.rest))
    bottom = float(np.nanmin(presses.load))
    axes[1].set_ylim(bottom - 0.05 * (top - bottom), top)
    axes[0].set_title(
        f"{len(presses.spans)} presses (shaded), {len(presses.cuts) + 1} episodes (red: cuts); "
        f"rest {presses.rest:.2g} N, noise {presses.noise:.2g} N",
        loc="left",
        fontsize="medium",
    )
    axes[0].set_ylabel("load (N)", color=_INK)
    axes[1].set_ylabel("load near rest (N)", color=_INK)
    axes[1].set_xlabel("time (s)", color=_INK)


def _draw_errors(ax: Axes, readout: LinearCalibration) -> None:
    """Draw the unexplained share of each channel as bars by axis, and unused channels as crosses at the top."""
    left = np.clip(1 - readout.explained, 1e-6, 1.0)
    pads, _, rows, cols = readout.used.shape
    at = np.arange(pads * rows * cols)
    for axis in range(3):
        used, own = readout.used[:, axis].ravel(), left[:, axis].ravel()
        place = at + 0.27 * (axis - 1)
        ax.bar(place[used], own[used], width=0.25, color=_AXIS_COLORS[axis], label=AXES[axis])
        ax.plot(place[~used], np.ones(int((~used).sum())), "x", color=_CUT, markersize=5)
    ax.set_yscale("log")
    ax.set_ylim(10 ** np.floor(np.log10(left[readout.used].min())), 1.3)
    if len(at) <= 20:
        ax.set_xticks(at, [f"{p}: {r},{c}" for p, r, c in np.ndindex(pads, rows, cols)])
    ax.set_xlabel("taxel", color=_INK)
    ax.set_ylabel("share", color=_INK)
    unused = int((~readout.used).sum())
    ax.set_title(
        "share of the variance that the loads do not explain on held-out data"
        + (f"; crosses: related to no load, set to zero ({unused})" if unused else ""),
        loc="left",
        fontsize="medium",
    )
    ax.legend(frameon=False, fontsize="small", labelcolor=_INK, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    plain(ax)


def _draw_channel(
    ax: Axes,
    elapsed: NDArray[np.float64],
    readout: LinearCalibration,
    applied: Recording,
    at: tuple[int, ...],
    what: str,
) -> None:
    assert applied.measured is not None
    assert applied.simulated is not None
    stride = -(-len(elapsed) // _MOST_POINTS)
    pad, axis, row, col = at
    for values, color, label in ((applied.measured, _MEASURED, "channel"), (applied.simulated, _EXPECTED, "loads")):
        ax.plot(elapsed[::stride], values[(slice(None), *at)][::stride], color=color, linewidth=1.0, label=label)
    ax.set_xlim(elapsed[0], elapsed[-1])
    ax.set_title(
        f"the {what} explained channel: {applied.pads[pad]}, taxel {row},{col}, {AXES[axis]} "
        f"({readout.explained[at]:.2%})",
        loc="left",
        fontsize="medium",
    )
    ax.set_ylabel("N", color=_INK)
    ax.legend(frameon=False, fontsize="small", labelcolor=_INK, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    plain(ax)


def plain(ax: Axes) -> None:
    """Remove frame, ticks and grid from the axes."""
    ax.tick_params(length=0, colors=_INK, labelsize="small")
    ax.xaxis.label.set_color(_INK)
    ax.yaxis.label.set_color(_INK)
    ax.spines[:].set_visible(False)
    ax.grid(visible=False)
