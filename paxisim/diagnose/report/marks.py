"""Marks: drawing of the measurement, and of the model with and without a cause."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from paxisim.diagnose.report.style import EXTENDED, MEASURED, SIMULATED, scattered

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DASHES = (0, (4, 1.5))


def cloud(axes: Axes, x: np.ndarray, y: np.ndarray, faint: bool = False) -> None:
    """Draw measured samples as points; faint ones serve as a backdrop for their means and have no legend entry."""
    x, y = scattered(x, y)
    alpha, label = (0.18, None) if faint else (0.35, "measured")
    axes.plot(x, y, "o", color=MEASURED, alpha=alpha, markersize=2.8, markeredgewidth=0, label=label)


def means(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw binned means of measured samples."""
    axes.plot(x, y, "o", color=MEASURED, markersize=4.5, markeredgewidth=0, label="measured, mean")


def points(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw a few measured samples as individual points."""
    axes.plot(x, y, "o", color=MEASURED, markersize=4, alpha=0.8, markeredgewidth=0, label="measured")


def without(axes: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw the model without the cause."""
    axes.plot(x, y, color=SIMULATED, linewidth=1.4, linestyle=DASHES, label="without")


def level(axes: Axes, value: float = 0.0) -> None:
    """Draw the model without the cause where it is constant."""
    axes.axhline(value, color=SIMULATED, linewidth=1.3, linestyle=DASHES, label="without")


def with_cause(axes: Axes, x: np.ndarray, y: np.ndarray, name: str) -> None:
    """Draw the model with the cause."""
    axes.plot(x, y, color=EXTENDED, linewidth=1.8, label=f"with {name}")


def force_trace(
    axes: Axes, time: np.ndarray, measured: np.ndarray, lacking: np.ndarray, model: np.ndarray, name: str
) -> None:
    """Draw measured force against time, and the model with and without the cause."""
    axes.plot(time, measured, color=MEASURED, linewidth=2.5, label="measured")
    without(axes, time, lacking)
    axes.plot(time, model, color=EXTENDED, linewidth=1.4, label=f"with {name}")
    axes.set_xlabel("time in the episode, s")


def level_across(axes: Axes, value: float) -> None:
    """Draw a vertical line, like `level` for a value along x."""
    axes.axvline(value, color=SIMULATED, linewidth=1.3, linestyle=DASHES, label="without")
