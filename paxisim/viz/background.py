"""Figure of a background: the channels without contact before and after its subtraction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from paxisim.calibrate.background import Background
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording
from paxisim.viz.calibration import new_figure, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_AXIS_COLORS = ("#2b5c94", "#0b8a3a", "#d1711f")  # x, y, z
_MOST_POINTS = 4000
_MOST_NAMES = 8  # covariates with a name


def plot_background(background: Background, recording: Recording) -> Figure:
    """Plot all channels of a recording before and after the subtraction of a background, each about its median.

    Args:
        background: Result of `paxisim.fit_background`.
        recording: The recording that it was fitted to, or another one of the same sensor with its covariates.

    Returns:
        A figure that is not shown in a window; use ``figure.savefig("background.png")``. Lines of the axes x, y and z
        are blue, green and orange. Below are the covariates, each scaled to its range.

    Raises:
        UnknownNameError: A covariate is missing.
        InvalidValueError: The recording does not fit the background.
        MissingExtraError: matplotlib is not installed.
    """
    figure = new_figure("plot_background", (10, 7))
    after = background.apply(recording)
    assert recording.measured is not None
    assert after.measured is not None
    thin = slice(None, None, -(-len(recording) // _MOST_POINTS))
    time = recording.elapsed[thin]
    before, left, below = figure.subplots(3, 1, sharex=True, height_ratios=[3, 3, 1.2])
    axis_of = np.nonzero(background.used)[1]
    for ax, tensor, what in (
        (before, recording.measured, "before"),
        (left, after.measured, "after subtraction"),
    ):
        channels = tensor[thin][:, background.used].astype(np.float64)
        if not np.isfinite(channels).any(axis=0).all():
            raise InvalidValueError("the covariates of the background are not known at any sample of the recording")
        channels = channels - np.nanmedian(channels, axis=0)
        for axis, color in enumerate(_AXIS_COLORS):
            ax.plot(time, channels[:, axis_of == axis], color=color, linewidth=0.5, alpha=0.7)
        size = np.sqrt(np.nanmean(channels**2))
        ax.set_title(f"{what}: {size:.3g} {background.unit} root mean square", loc="left", fontsize="medium")
        ax.set_ylabel(background.unit, parse_math=False)
    for name in background.covariates:
        values = recording.covariates[name].reshape(len(recording), -1)[thin]
        span = np.nanmax(values, axis=0) - np.nanmin(values, axis=0)
        lines = below.plot(time, (values - np.nanmin(values, axis=0)) / np.where(span > 0, span, 1), linewidth=0.8)
        for line, number in zip(lines, range(values.shape[1]), strict=True):
            line.set_label(name if len(lines) == 1 else f"{name} {number}")
    if len(below.lines) <= _MOST_NAMES:
        below.legend(loc="center left", bbox_to_anchor=(1, 0.5), fontsize="small", frameon=False)
    below.set_ylabel("covariates")
    below.set_yticks([])
    below.set_xlabel("time (s)")
    for ax in (before, left, below):
        plain(ax)
    return figure
