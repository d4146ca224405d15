"""The closing of an episode, fitted to the course of the measured force, whatever its gain and its delay.

Where an object lies along the closing shows in when contact begins, and in how the gel stiffens. So a constant is added
to the closing stream, such that the simulated total normal force is as similar to the measured one as it can be: the
largest of the normalised cross-correlations up to some lag. A gain and a delay of the sensor do not change it, so these
can still be told afterwards.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.scene.closing import QUIET, FittedClosing, mean_normal, total_normal

REACH = 1.0
"""Steps of 1 mm to either side in which the closing is searched."""
LAG = 0.25
"""Seconds by which the streams may be apart, at most."""
SIMILAR = 0.8
"""Similarity below which no closing explains the course of the force."""
_COARSE = 9  # closings that are tried first
_TOLERANCE = 5e-3  # steps of 1 mm


def fit_shape(
    simulated: Callable[[float], NDArray[np.float32]],
    measured: NDArray[np.float32],
    time: NDArray[np.float64],
    step: float,
    episode: int,
) -> FittedClosing:
    """Fit the constant.

    Args:
        simulated: The ``(T, pads, 3, rows, cols)`` forces for a constant.
        measured: The measured ones.
        time: ``(T,)`` when they were measured (s).
        step: The constant that moves the closing joint by 1 mm.
        episode: Its number, for messages.

    Raises:
        InvalidValueError: The best constant is at the end of the search, or even with it the courses are not alike.
    """
    from scipy.optimize import minimize_scalar

    mean = mean_normal(measured)
    if mean < QUIET:
        note = f"episode {episode}: the mean force is only {mean:.3f} N, so the closing was left as recorded"
        return FittedClosing(0.0, simulated(0.0), (note,))
    own = total_normal(measured)
    most = int(LAG / max(float(np.median(np.diff(time))), 1e-6)) if len(time) > 1 else 0
    runs: dict[float, tuple[float, NDArray[np.float32]]] = {}

    def unlike(steps: float) -> float:
        if steps not in runs:
            force = simulated(steps * step)
            runs[steps] = 1.0 - similarity(own, total_normal(force), most), force
        return runs[steps][0]

    grid = np.linspace(-REACH, REACH, _COARSE).tolist()
    best = min(grid, key=unlike)
    width = grid[1] - grid[0]
    minimize_scalar(
        unlike, bounds=(best - width, best + width), method="bounded", options={"xatol": _TOLERANCE, "maxiter": 20}
    )
    best = min(runs, key=lambda one: runs[one][0])
    left, force = runs[best]
    if abs(best) >= REACH or left > 1 - SIMILAR:
        raise InvalidValueError(
            f"episode {episode}: no closing of up to {REACH:g} mm more or less makes the course of the simulated force "
            f"like the measured one (similarity {1 - left:.2f} of 1): check the drives' offsets and where the object "
            "starts"
        )
    return FittedClosing(best * step, force)


def similarity(first: NDArray[np.float64], second: NDArray[np.float64], most: int) -> float:
    """The largest normalised cross-correlation of two ``(T,)`` courses, shifted by up to `most` samples; 0 to 1."""
    first, second = np.nan_to_num(first), np.nan_to_num(second)
    best = 0.0
    for lag in range(-most, most + 1):
        a, b = first[max(lag, 0) : len(first) + min(lag, 0)], second[max(-lag, 0) : len(second) - max(lag, 0)]
        size = float(np.linalg.norm(a) * np.linalg.norm(b))
        best = max(best, float(a @ b) / size if size > 0 else 0.0)
    return best
