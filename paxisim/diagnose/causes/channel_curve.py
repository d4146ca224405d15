"""Channel curve: for sensors whose channels are not forces, each calibrated to the same load (`calibrate_readout`)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import t as student

from paxisim import augment
from paxisim.augment.channel_curve import hats
from paxisim.diagnose.causes.kinds import PerChannelCause
from paxisim.diagnose.data.problem import FloatArray, Problem

KNOTS = 9
MATERIAL_BEND = 0.01  # materiality of the deviation of a curve from a straight line, in units of the peak
_STEP = 0.01  # finite difference at a knot, in units of the peak
_PRIOR = 3.0  # standard deviation of the prior at a knot, in units of the peak; for knots without load


def mixes_alike(problem: Problem) -> str:
    """Why causes that mix or swap channels cannot be tested; empty if they can."""
    return (
        "the simulation is the load used for calibration, so mixing between channels is not identifiable"
        if problem.one_load
        else ""
    )


def no_neighbours(problem: Problem) -> str:
    """Why causes that act between neighbouring taxels cannot be tested; empty if they can."""
    return "a pad of a single taxel has no neighbours" if problem.alive[0, 0].size == 1 else mixes_alike(problem)


def bent_apart(problem: Problem) -> str:
    """Why gains and curves shared by all taxels cannot be tested; empty if they can."""
    return "each channel has its own curve, which includes this effect (channel_curve)" if problem.one_load else ""


def _own_loads(problem: Problem) -> str:
    return (
        ""
        if problem.one_load
        else "the channels are in newtons, so one curve for all taxels is tested instead (stiffening)"
    )


def _ends(problem: Problem) -> tuple[float, float]:
    return problem.least if problem.least < -0.1 * problem.peak else 0.0, problem.peak


def _curve(values: FloatArray, problem: Problem) -> augment.ChannelCurve:
    return augment.ChannelCurve(np.asarray(values), *_ends(problem))


def _solve(
    problem: Problem, y: FloatArray, end: Callable[[FloatArray], FloatArray], near: FloatArray | None
) -> FloatArray:
    """``(KNOTS, pads, 3, rows, cols)`` N, best-fitting errors at the knots; see `PerChannelCause.solve`."""
    low, high = (np.asarray(value) for value in _ends(problem))
    shapes = np.moveaxis(hats(y, low, high, KNOTS), 1, 0)  # (KNOTS, T, ...)
    step = _STEP * problem.peak
    error = np.zeros((KNOTS, *y.shape[1:])) if near is None else near
    used = 1.0 if problem.fitted is None else problem.fitted[:, None, None, None, None]
    for _ in range(2 if near is None else 1):
        bent = y + np.sum(shapes * error[:, None], axis=0)
        now = end(bent)
        slopes = np.stack([(end(bent + step * shape) - now) / step for shape in shapes])
        effects = np.stack([problem.weigh(slope) for slope in slopes]) * used
        right = np.einsum("at...,t...->...a", effects, problem.weigh(problem.measured - now), optimize=True)
        change = np.linalg.solve(_normal(problem, effects), right[..., None])[..., 0]
        error = error + np.moveaxis(change, -1, 0)
    after = problem.measured - end(y + np.sum(shapes * error[:, None], axis=0))
    share = problem.weight**2 * used
    return error + np.sum(share * after, axis=0) / np.maximum(share.sum(axis=0), 1e-12)


def _normal(problem: Problem, effects: FloatArray) -> FloatArray:
    """``(pads, 3, rows, cols, KNOTS, KNOTS)`` normal matrix of the knots' effects, with the prior."""
    normal = np.einsum("at...,bt...->...ab", effects, effects, optimize=True)
    ridge = 1 / (_PRIOR * problem.peak) ** 2 + 1e-7 * np.trace(normal, axis1=-2, axis2=-1)[..., None, None]
    return normal + ridge * np.eye(KNOTS)


def _error(problem: Problem, prediction: FloatArray, fitted: FloatArray) -> FloatArray:
    """``(KNOTS, pads, 3, rows, cols)`` N, half-widths of 90% intervals, with episodes as replicates."""
    low, high = (np.asarray(value) for value in _ends(problem))
    shapes = np.moveaxis(hats(problem.simulated, low, high, KNOTS), 1, 0)
    effects = np.stack([problem.weigh(shape) for shape in shapes])
    rest, inverse = problem.residual(prediction), np.linalg.inv(_normal(problem, effects))
    square = np.zeros(inverse.shape[:-1])
    for span in problem.episodes:
        score = np.einsum("at...,t...->...a", effects[:, span], rest[span], optimize=True)
        square += (inverse @ score[..., None])[..., 0] ** 2
    count = len(problem.episodes)
    width = float(student.ppf(0.95, count - 1)) * np.sqrt(square * count / (count - 1))
    return np.asarray(np.moveaxis(width, -1, 0), dtype=np.float64)


def _bend(values: FloatArray, problem: Problem) -> float:
    """Deviation of the most curved channel from a straight line, in units of materiality."""
    error = np.asarray(values)
    place = np.linspace(-1, 1, len(error))
    slope = np.tensordot(place, error, 1) / np.sum(place**2)
    rest = error - error.mean(axis=0) - place.reshape(-1, 1, 1, 1, 1) * slope
    return float(np.sqrt(np.mean(rest**2, axis=0))[problem.alive].max() / (MATERIAL_BEND * problem.peak))


CHANNEL_CURVE = PerChannelCause(
    name="channel_curve",
    order=74,
    make=_curve,
    excites="staircase",
    array="error",
    unit="N",
    solve=_solve,
    error=_error,
    price=3.0,
    size=_bend,
    barred=_own_loads,
    words="Each channel responds to the load along its own curve.",
    picture="channel_curves",
)
