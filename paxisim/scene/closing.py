"""Fit of the closing of a grasp to the measured total force.

On a gel, a tenth of a millimetre amounts to newtons, and few grippers know their opening that well. So a constant is
added to the closing stream that makes the mean of the total normal force over the grasp equal to the measured mean.
A delay does not change the mean, and a filter hardly does, so both remain identifiable afterwards. A gain does not.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError

_REACH = 3.0  # search range of the closing to either side, in steps of 1 mm
_TOLERANCE = 0.005  # as a fraction of the measured mean
_NEAR = 0.05  # the same, if no two closings bracket the solution
_MOST_RUNS = 20
NO_CONTACT_FORCE = 0.02
"""Mean force (N) below which there is no contact."""


@dataclass(frozen=True, eq=False)
class FittedClosing:
    """Result of `fit_closing`.

    Attributes:
        closing: Constant added to the closing stream, in its unit.
        force: The simulated forces with this constant.
        notes: The reason if the closing was not fitted.
        slope: Change of the mean force with the constant (N per unit of the stream) near the fit; 0 if unknown.
    """

    closing: float
    force: NDArray[np.float32]
    notes: tuple[str, ...] = ()
    slope: float = 0.0


def fit_closing(
    simulated: Callable[[float], NDArray[np.float32]],
    measured: NDArray[np.float32],
    time: NDArray[np.float64],
    step: float,
    episode: int,
    before: FittedClosing | None = None,
) -> FittedClosing:
    """Fit the constant to the mean of the total normal force.

    Args:
        simulated: Function that returns the simulated ``(T, pads, 3, rows, cols)`` forces (N) for a constant.
        measured: ``(T, pads, 3, rows, cols)`` measured forces (N).
        time: Sample times (s); not used, because the mean does not depend on them.
        step: The constant that moves the closing joint by 1 mm.
        episode: Number of the episode, for messages.
        before: Fit of another grasp, which is likely to be near this one.

    Raises:
        InvalidValueError: No constant of up to 3 mm gives the measured mean force.
    """
    wanted = mean_normal(measured)
    runs: dict[float, float] = {}
    kept: dict[float, NDArray[np.float32]] = {}

    def error(closing: float) -> float:
        if closing not in runs:
            kept[closing] = simulated(closing)
            runs[closing] = mean_normal(kept[closing]) - wanted
        return runs[closing]

    def fits() -> bool:
        return abs(runs[_best(runs)]) <= _TOLERANCE * wanted

    if wanted < NO_CONTACT_FORCE:
        note = f"episode {episode}: the mean force is only {wanted:.3f} N, so the closing was left as recorded"
        error(0.0)
        return FittedClosing(0.0, kept[0.0], (note,))
    if before is not None and before.slope:
        start = before.closing - error(before.closing) / before.slope
        if not fits() and abs(start) < _REACH * step:
            error(start)
    bracket = (0.0, 0.0) if runs and fits() else _bracket(error, step, _best(runs) if runs else 0.0)
    if bracket is None:
        best = _best(runs)
        if abs(runs[best]) <= _NEAR * wanted:  # elsewhere, the simulated hand may lose the object
            return FittedClosing(best, kept[best])
        raise InvalidValueError(
            f"episode {episode}: no closing of up to {_REACH:g} mm more or less gives the measured mean force of "
            f"{wanted:.3g} N (as recorded, the scene gives {error(0.0) + wanted:.3g} N): check the drives' offsets and "
            "the object's start pose"
        )
    while not fits():
        low, high = bracket
        if len(runs) >= _MOST_RUNS or abs(high - low) < 1e-5 * step:
            break
        # regula falsi on the square root of force, which grows about linearly with depth, kept inside the bracket
        a, b = (np.sqrt(max(error(x) + wanted, 0.0)) - np.sqrt(wanted) for x in bracket)
        share = np.clip(a / (a - b), 0.01, 0.99)
        middle = float(low + share * (high - low))
        bracket = (middle, high) if error(middle) < 0 else (low, middle)
    best = _best(runs)
    return FittedClosing(best, kept[best], slope=_slope(runs))


def _best(runs: Mapping[float, float]) -> float:
    return min(runs, key=lambda one: abs(runs[one]))


def _slope(runs: Mapping[float, float]) -> float:
    """Return the slope between the two runs nearest to the solution (N per unit of the stream); 0 if there is one."""
    near = sorted(runs, key=lambda one: abs(runs[one]))[:2]
    return (runs[near[1]] - runs[near[0]]) / (near[1] - near[0]) if len(near) > 1 else 0.0


def _bracket(error: Callable[[float], float], step: float, centre: float) -> tuple[float, float] | None:
    """Return two constants that bracket the solution: the first gives too little force, the second too much."""
    start = error(centre)
    for sign in (1, -1):
        inner = centre
        for reach in (0.1, 0.3, 1.0, _REACH):
            outer = centre + sign * reach * step
            if (error(outer) < 0) != (start < 0):
                return (inner, outer) if start < 0 else (outer, inner)
            if abs(error(outer)) > abs(error(inner)):
                break  # the error grows: search in the other direction
            inner = outer
    return None


def mean_normal(force: NDArray[np.float32]) -> float:
    """Return the mean over time of the total normal force (N)."""
    return float(np.nanmean(total_normal(force))) if len(force) else 0.0


def pad_normal(force: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the total normal force of each pad ``(T, pads)`` (N)."""
    return force[:, :, 2].astype(np.float64).sum(axis=(2, 3))


def total_normal(force: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the total normal force ``(T,)`` (N), summed over all taxels."""
    return force[:, :, 2].astype(np.float64).sum(axis=(1, 2, 3))
