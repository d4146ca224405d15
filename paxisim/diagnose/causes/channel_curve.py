"""Channel curve: for sensors whose channels are not forces, each calibrated to the same load (`calibrate_readout`)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import detrend
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
    why = "the simulation is the load used for calibration, so mixing between channels is not identifiable"
    return why if problem.one_load else ""


def no_neighbours(problem: Problem) -> str:
    """Why causes that act between neighbouring taxels cannot be tested; empty if they can."""
    return "a pad of a single taxel has no neighbours" if problem.alive[0, 0].size == 1 else mixes_alike(problem)


def bent_apart(problem: Problem) -> str:
    """Why gains and curves shared by all taxels cannot be tested; empty if they can."""
    return "each channel has its own curve, which includes this effect (channel_curve)" if problem.one_load else ""


def _own_loads(problem: Problem) -> str:
    why = "the channels are in newtons, so one curve for all taxels is tested instead (stiffening)"
    return "" if problem.one_load else why


def _ends(problem: Problem) -> tuple[float, float]:
    """The loads of the first and the last knot (N)."""
    return problem.least if problem.least < -0.1 * problem.peak else 0.0, problem.peak


def _hats(problem: Problem, load: FloatArray) -> FloatArray:
    """``(KNOTS, T, pads, 3, rows, cols)`` effect of an error of 1 N at each knot (N)."""
    low, high = map(np.asarray, _ends(problem))
    return np.moveaxis(hats(load, low, high, KNOTS), 1, 0)


def _normal(problem: Problem, effects: FloatArray) -> FloatArray:
    """``(pads, 3, rows, cols, KNOTS, KNOTS)`` normal matrix of the knots' effects, with the prior."""
    normal = np.einsum("at...,bt...->...ab", effects, effects, optimize=True)
    ridge = 1 / (_PRIOR * problem.peak) ** 2 + 1e-7 * np.trace(normal, axis1=-2, axis2=-1)[..., None, None]
    return normal + ridge * np.eye(KNOTS)


def _solved(normal: FloatArray, effects: FloatArray, residual: FloatArray) -> FloatArray:
    """``(KNOTS, pads, 3, rows, cols)`` N, the errors whose effects fit a residual best."""
    right = np.einsum("at...,t...->...a", effects, residual, optimize=True)
    return np.moveaxis(np.linalg.solve(normal, right[..., None])[..., 0], -1, 0)


def _solve(
    problem: Problem, y: FloatArray, end: Callable[[FloatArray], FloatArray], near: FloatArray | None
) -> FloatArray:
    """``(KNOTS, pads, 3, rows, cols)`` N, best-fitting errors at the knots; see `PerChannelCause.solve`."""
    shapes, step = _hats(problem, y), _STEP * problem.peak
    error = np.zeros((KNOTS, *y.shape[1:])) if near is None else near
    used = 1.0 if problem.fitted is None else problem.fitted[:, None, None, None, None]
    for _ in range(2 if near is None else 1):
        bent = y + np.sum(shapes * error[:, None], axis=0)
        now = end(bent)
        effects = np.stack([problem.weigh((end(bent + step * shape) - now) / step) for shape in shapes]) * used
        error = error + _solved(_normal(problem, effects), effects, problem.weigh(problem.measured - now))
    after = problem.measured - end(y + np.sum(shapes * error[:, None], axis=0))
    share = problem.weight**2 * used
    return error + np.sum(share * after, axis=0) / np.maximum(share.sum(axis=0), 1e-12)


def _error(problem: Problem, prediction: FloatArray, fitted: FloatArray) -> FloatArray:
    """``(KNOTS, pads, 3, rows, cols)`` N, half-widths of 90% intervals, with episodes as replicates."""
    effects = np.stack([problem.weigh(shape) for shape in _hats(problem, problem.simulated)])
    normal, rest, count = _normal(problem, effects), problem.residual(prediction), len(problem.episodes)
    square = sum(_solved(normal, effects[:, span], rest[span]) ** 2 for span in problem.episodes)
    return float(student.ppf(0.95, count - 1)) * np.sqrt(square * count / (count - 1))


def _bend(values: FloatArray, problem: Problem) -> float:
    """Deviation of the most curved channel from a straight line, in units of materiality."""
    rest = detrend(np.asarray(values), axis=0)
    return float(np.sqrt(np.mean(rest**2, axis=0))[problem.alive].max() / (MATERIAL_BEND * problem.peak))


CHANNEL_CURVE = PerChannelCause(
    name="channel_curve",
    order=74,
    make=lambda values, problem: augment.ChannelCurve(np.asarray(values), *_ends(problem)),
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
