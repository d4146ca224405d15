"""Motion: a stream of one episode as a smooth function of time, with its velocity and acceleration.

Encoder readings show steps of the encoder's resolution. Differentiated twice, these would give accelerations of metres
per second squared, as large as those in a contact. So the readings are first replaced by the smoothest curve that stays
within half a step of each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded
from scipy.spatial.transform import Rotation, RotationSpline

_SMOOTHEST = 1e5  # smoothing parameter for unit sample spacing; passes frequencies below 0.06 rad per sample
_ROUNDS = 60
_WITHIN = 1.05  # largest distance of the curve from a reading, in half steps


class Curve:
    """Position, velocity and acceleration over time, at rest before the first time and after the last."""

    def __init__(self, time: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        """Fit a cubic spline through ``(T, ...)`` values at ``(T,)`` increasing times."""
        self._ends = time[0], time[-1]
        self._spline = CubicSpline(time, values) if len(time) > 1 else None
        self._first = values[0]

    def __call__(self, at: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Return positions, velocities and accelerations, each ``(S, ...)``, at times ``(S,)``."""
        if self._spline is None:
            still = np.zeros((len(at), *np.shape(self._first)))
            return still + self._first, still, still
        inside = ((at >= self._ends[0]) & (at <= self._ends[1])).reshape(-1, *[1] * np.ndim(self._first))
        clipped = np.clip(at, *self._ends)
        return self._spline(clipped), self._spline(clipped, 1) * inside, self._spline(clipped, 2) * inside


class PoseCurve:
    """Pose, velocity and acceleration over time, at rest before the first time and after the last."""

    def __init__(self, time: NDArray[np.float64], poses: NDArray[np.float64]) -> None:
        """Fit splines through ``(T, 3)`` positions or ``(T, 7)`` positions and quaternions w x y z."""
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
        """Return poses ``(S, 7)``, velocities ``(S, 6)`` and accelerations ``(S, 6)`` at times ``(S,)``.

        Angular velocities and accelerations are in the body's own frame, as in MuJoCo.
        """
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


def smooth_within(time: NDArray[np.float64], values: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Smooth readings as far as possible while staying within half a `step` of them.

    Minimises the squared distance from the readings plus that of the second derivative (a Whittaker smoother), while
    increasing the weights of the readings from which it is still too far.

    Args:
        time: ``(T,)`` increasing times.
        values: ``(T,)`` readings.
        step: Resolution of the encoder, in the values' unit.

    Returns:
        ``(T,)`` smoothed readings.
    """
    if step <= 0 or len(values) < 5 or np.ptp(values) < 0.5 * step:
        return values
    at = (time - time[0]) / np.median(np.diff(time))
    readings = (values - values[0]) / (0.5 * step)
    penalty = _SMOOTHEST * _squared_bending(at)
    weights = np.full(len(values), 1.0)
    curve = readings
    for _ in range(_ROUNDS):
        bands = penalty.copy()
        bands[0] += weights
        curve = solveh_banded(bands, weights * readings, lower=True)
        off = np.abs(curve - readings)
        if off.max() <= _WITHIN:
            break
        weights *= np.clip(off, 1.0, 10.0) ** 2
    return values[0] + 0.5 * step * curve


def _squared_bending(at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix whose quadratic form is the integral of the squared second derivative, as its lower bands."""
    steps = np.diff(at)
    spans = 0.5 * (steps[:-1] + steps[1:])
    # the second derivative at each inner sample is a sum of three values with these weights
    weights = np.array(
        [1 / (steps[:-1] * spans), -1 / (steps[:-1] * spans) - 1 / (steps[1:] * spans), 1 / (steps[1:] * spans)]
    )
    bands = np.zeros((3, len(at)))
    for i in range(3):
        for j in range(i, 3):
            bands[j - i, i : i + len(spans)] += spans * weights[i] * weights[j]
    return bands
