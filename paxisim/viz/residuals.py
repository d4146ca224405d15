"""Figure of a calibration's residuals: error of the estimated load against the load and other covariates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from paxisim.calibrate.calibration import Calibration
from paxisim.calibrate.loads import values_of
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording
from paxisim.viz.calibration import new_figure, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_COLUMNS = 4
"""Maximum number of quantities that errors are plotted against: the load, then covariates."""
_INK, _POINT, _LINE = "#444444", "#a9bdd6", "#2b5c94"
_MOST_POINTS = 4000
_BINS, _FEW = 15, 5  # number of bins of the line, and minimum number of samples in a bin


def plot_residuals(calibration: Calibration, recording: Recording) -> Figure:
    """Plot the error of the estimated load against the load itself and against the other covariates.

    A correct calibration leaves a level band. A slope against the load indicates a wrong gain, and a curved band a
    nonlinear sensor. A slope against a covariate, such as a temperature or the gripper's opening, indicates an effect
    that the calibration does not model.

    Args:
        calibration: Result of `paxisim.calibrate_sensor`.
        recording: A recording with the channels, the loads and any covariates with one value per sample. If the
            calibration was not fitted to it, the errors are held-out errors.

    Returns:
        A figure that is not shown in a window, with a row for each load and a column for each quantity.

    Raises:
        InvalidValueError: The recording does not fit the calibration.
        MissingExtraError: matplotlib is not installed.
    """
    if recording.measured is None:
        raise InvalidValueError("the errors of a calibration need the measured tensor, but the recording has none")
    calibration.check(recording.measured.shape[1:], recording.unit)
    if calibration.background is not None and "background" not in recording.metadata:
        recording = calibration.background.apply(recording)
    assert recording.measured is not None
    loads = calibration.model.loads
    values = values_of(recording, loads)
    known = np.isfinite(values).all(axis=1) & np.isfinite(recording.measured[:, calibration.model.used]).all(axis=1)
    if not known.any():
        raise InvalidValueError("no sample of the recording has both a known load and known channels")
    part = recording[known]
    assert part.measured is not None
    load = values[known]
    error = calibration.model(part.measured) - load
    taken = {one.covariate for one in loads}
    others = {
        name: own
        for name, own in part.covariates.items()
        if name not in taken and own.ndim == 1 and len(np.unique(own[np.isfinite(own)])) > 1
    }
    names = list(others)[: MAX_COLUMNS - 1]
    figure = new_figure("plot_residuals", (3.6 * (1 + len(names)) + 0.6, 2.6 * len(loads) + 0.5))
    axes = figure.subplots(len(loads), 1 + len(names), squeeze=False, sharey="row")
    for k, one in enumerate(loads):
        for ax, name, against in zip(axes[k], ["", *names], [load[:, k], *(others[n] for n in names)], strict=True):
            _draw(ax, against, error[:, k])
            ax.set_xlabel(name or f"{one.name} ({one.unit})", color=_INK)
        axes[k, 0].set_ylabel(f"error of {one.name} ({one.unit})", color=_INK)
    figure.suptitle("estimated minus measured load; the line is the mean", fontsize="medium", color=_INK)
    return figure


def _draw(ax: Axes, against: NDArray[np.float64], error: NDArray[np.float64]) -> None:
    known = np.isfinite(against)
    against, error = against[known], error[known]
    stride = -(-len(error) // _MOST_POINTS)
    ax.axhline(0, color=_INK, linewidth=0.8, linestyle="--")
    ax.plot(against[::stride], error[::stride], ".", color=_POINT, markersize=2, rasterized=True)
    # bins of equal width: with bins of equal count, the noise of a load at rest would be sorted across many bins
    edges = np.linspace(against.min(), against.max(), _BINS + 1)
    bins = np.clip(np.searchsorted(edges, against, side="right") - 1, 0, _BINS - 1)
    count, total = np.bincount(bins, minlength=_BINS), np.bincount(bins, error, minlength=_BINS)
    full = count >= _FEW
    ax.plot((edges[:-1] + edges[1:])[full] / 2, total[full] / count[full], color=_LINE, linewidth=1.6)
    ax.locator_params(axis="x", nbins=5)
    plain(ax)
