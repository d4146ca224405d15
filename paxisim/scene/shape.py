"""Fit of the closing of a grasp to the shape of the measured force over time, whatever its gain and delay.

The position of an object along the closing shows in the time at which contact begins and in how the gel stiffens. So a
constant is added to the closing stream that makes the simulated total normal force as similar as possible to the
measured one. The similarity is the largest normalised cross-correlation up to some lag. A gain or a delay of the sensor
does not change it, so both remain identifiable afterwards.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.scene.closing import NO_CONTACT_FORCE, FittedClosing, mean_normal, total_normal

SEARCH_RANGE = 1.0
"""Search range of the closing to either side, in steps of 1 mm."""
MAX_DELAY = 0.25
"""Largest delay (s) between the streams."""
MIN_SIMILARITY = 0.8
"""Smallest similarity at which a closing is taken to explain the measured force."""
_ALIKE = 1.3  # closings fit alike up to this multiple of the least dissimilarity
_TOLD = 1.3  # largest ratio of forces of closings that fit alike
_COARSE = 9  # number of closings in the initial grid search
_TOLERANCE = 5e-3  # in steps of 1 mm


def fit_shape(
    simulated: Callable[[float], NDArray[np.float32]],
    measured: NDArray[np.float32],
    time: NDArray[np.float64],
    step: float,
    episode: int,
    before: FittedClosing | None = None,
) -> FittedClosing:
    """Fit the constant to the shape of the total normal force over time.

    Args:
        simulated: Function that returns the simulated ``(T, pads, 3, rows, cols)`` forces (N) for a constant.
        measured: ``(T, pads, 3, rows, cols)`` measured forces (N).
        time: ``(T,)`` sample times (s).
        step: The constant that moves the closing joint by 1 mm.
        episode: Number of the episode, for messages.
        before: Not used: the search covers the whole range, since several closings may fit alike.

    Raises:
        InvalidValueError: The best constant is at the edge of the search range, or the similarity is too small.
    """
    from scipy.optimize import minimize_scalar

    mean = mean_normal(measured)
    if mean < NO_CONTACT_FORCE:
        note = f"episode {episode}: the mean force is only {mean:.3f} N, so the closing was left as recorded"
        return FittedClosing(0.0, simulated(0.0), (note,))
    own = total_normal(measured)
    most = int(MAX_DELAY / max(float(np.median(np.diff(time))), 1e-6)) if len(time) > 1 else 0
    runs: dict[float, tuple[float, NDArray[np.float32]]] = {}

    def unlike(steps: float) -> float:
        if steps not in runs:
            force = simulated(steps * step)
            runs[steps] = 1.0 - similarity(own, total_normal(force), most), force
        return runs[steps][0]

    grid = np.linspace(-SEARCH_RANGE, SEARCH_RANGE, _COARSE).tolist()
    best = min(grid, key=unlike)
    width = grid[1] - grid[0]
    minimize_scalar(
        unlike, bounds=(best - width, best + width), method="bounded", options={"xatol": _TOLERANCE, "maxiter": 20}
    )
    best = min(runs, key=lambda one: runs[one][0])
    left, force = runs[best]
    alike = [mean_normal(made) for off, made in runs.values() if off <= _ALIKE * left]
    if max(alike) > _TOLD * min(alike):
        raise InvalidValueError(
            f"episode {episode}: the force over time does not determine the closing: closings with a mean force of "
            f"{min(alike):.3g} N to {max(alike):.3g} N fit equally well. Use mode fitted, or record slower presses"
        )
    if abs(best) >= SEARCH_RANGE or left > 1 - MIN_SIMILARITY:
        raise InvalidValueError(
            f"episode {episode}: no closing of up to {SEARCH_RANGE:g} mm more or less gives the simulated force the "
            f"shape of the measured one over time (similarity {1 - left:.2f} of 1): check the drives' offsets and the "
            "object's start pose"
        )
    return FittedClosing(best * step, force)


def similarity(first: NDArray[np.float64], second: NDArray[np.float64], most: int) -> float:
    """Return the largest normalised cross-correlation (0 to 1) of two signals ``(T,)`` at lags of up to `most`."""
    first, second = np.nan_to_num(first), np.nan_to_num(second)
    best = 0.0
    for lag in range(-most, most + 1):
        a, b = first[max(lag, 0) : len(first) + min(lag, 0)], second[max(-lag, 0) : len(second) - max(lag, 0)]
        size = float(np.linalg.norm(a) * np.linalg.norm(b))
        best = max(best, float(a @ b) / size if size > 0 else 0.0)
    return best
