"""Motion: a stream of one episode as a smooth function of time, with its velocity and acceleration.

An encoder shows steps of its resolution. Twice differentiated they would be accelerations of metres a second squared,
as large as those that a contact feels. So the readings are first replaced by the smoothest curve that stays within
half a step of each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, make_smoothing_spline
from scipy.spatial.transform import Rotation, RotationSpline

_SMOOTHEST = 1e5  # weight of the curvature against readings a sample apart: passes what is slower than 0.06 a sample
_ROUNDS = 60
_WITHIN = 1.05  # of half a step: how far the curve may be from a reading


class Curve:
    """One number over time: position, velocity and acceleration, at rest before its first time and after its last."""

    def __init__(self, time: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        """Lay a cubic spline through ``(T, ...)`` values at ``(T,)`` increasing times."""
        self._ends = time[0], time[-1]
        self._spline = CubicSpline(time, values) if len(time) > 1 else None
        self._first = values[0]

    def __call__(self, at: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """``(S, ...)`` positions, velocities and accelerations at ``(S,)`` times."""
        if self._spline is None:
            still = np.zeros((len(at), *np.shape(self._first)))
            return still + self._first, still, still
        inside = ((at >= self._ends[0]) & (at <= self._ends[1])).reshape(-1, *[1] * np.ndim(self._first))
        clipped = np.clip(at, *self._ends)
        return self._spline(clipped), self._spline(clipped, 1) * inside, self._spline(clipped, 2) * inside


class PoseCurve:
    """A pose over time."""

    def __init__(self, time: NDArray[np.float64], poses: NDArray[np.float64]) -> None:
        """Lay splines through ``(T, 3)`` positions or ``(T, 7)`` positions and quaternions w x y z."""
        self._ends = time[0], time[-1]
        self._position = Curve(time, poses[:, :3])
        self._turns = None
        if poses.shape[1] == 7:
            turns = Rotation.from_quat(poses[:, [4, 5, 6, 3]])
            self._first = turns[0]
            self._turns = RotationSpline(time, turns) if len(time) > 1 else None
        else:
            self._first = Rotation.identity()

    def __call__(self, at: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """``(S, 7)`` poses, ``(S, 6)`` velocities and accelerations; turning in the body's own frame, as MuJoCo's."""
        place, speed, push = self._position(at)
        clipped = np.clip(at, *self._ends)
        spin = np.zeros((2, len(at), 3))
        if self._turns is None:
            turns = Rotation.from_quat(np.tile(self._first.as_quat(), (len(at), 1)))
        else:
            turns = self._turns(clipped)
            inside = ((at >= self._ends[0]) & (at <= self._ends[1]))[:, None]
            spin = np.stack([self._turns(clipped, order) * inside for order in (1, 2)])
        quat = turns.as_quat()[:, [3, 0, 1, 2]]
        return np.hstack([place, quat]), np.hstack([speed, spin[0]]), np.hstack([push, spin[1]])


def resolution(values: NDArray[np.float64]) -> float:
    """The step of an encoder that shows in its readings; 0 where none does.

    Readings show a step if all differences between them are multiples of the smallest one, and they repeat.
    """
    known = np.unique(values[np.isfinite(values)])
    if not 2 <= len(known) <= 0.5 * np.isfinite(values).sum():
        return 0.0
    gaps = np.diff(known)
    largest = float(np.abs(known).max())
    gaps = gaps[gaps > 1e-6 * largest]  # of numbers that were float32 once
    if not len(gaps):
        return 0.0
    step = float(gaps.min())
    counts = np.round(gaps / step)
    step = float(gaps.sum() / counts.sum())
    return step if np.all(np.abs(gaps / step - counts) < 0.02 * np.maximum(counts, 1)) else 0.0


def smooth_within(time: NDArray[np.float64], values: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """The smoothest readings within half a `step` of the given ones.

    A smoothing spline whose weights grow, round by round, at the readings from which it is still too far.

    Args:
        time: ``(T,)`` increasing.
        values: ``(T,)`` readings.
        step: The encoder's resolution, in the values' unit.

    Returns:
        ``(T,)`` numbers.
    """
    if step <= 0 or len(values) < 5 or np.ptp(values) < 0.5 * step:
        return values
    at = (time - time[0]) / np.median(np.diff(time))
    readings = (values - values[0]) / (0.5 * step)
    weights = np.full(len(values), 1.0)
    curve = readings
    for _ in range(_ROUNDS):
        curve = make_smoothing_spline(at, readings, weights, lam=_SMOOTHEST)(at)
        off = np.abs(curve - readings)
        if off.max() <= _WITHIN:
            break
        weights *= np.clip(off, 1.0, 10.0) ** 2
    return values[0] + 0.5 * step * curve
