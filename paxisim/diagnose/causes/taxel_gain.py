"""Taxel gain: each taxel has its own gain, fitted in closed form.

Gains are shrunk towards their common value (empirical Bayes) where the episodes are uninformative or disagree.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import t as student

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import bent_apart
from paxisim.diagnose.causes.kinds import PerChannelCause
from paxisim.diagnose.data.noise import Tolerance, differences
from paxisim.diagnose.data.problem import FloatArray, Problem

GAIN_PRIOR = 0.1  # initial standard deviation of the prior of the gains
MIN_SPREAD = 0.01  # smallest estimate of that standard deviation
MIN_WEIGHT = 1e-3  # relative to the largest weight; less loaded taxels do not inform the prior
BAYES_ITERATIONS = 5  # iterations of the empirical Bayes estimate
MATERIAL_SPREAD = 0.026  # materiality of the standard deviation of the gains


def _solve(
    problem: Problem, x: FloatArray, end: Callable[[FloatArray], FloatArray], near: FloatArray | None
) -> FloatArray:
    """``(pads, rows, cols)`` best-fitting gains, see `drawn`; the arguments are those of `PerChannelCause.solve`.

    Everything after the gains acts on each taxel separately, so a single perturbation of all gains yields all slopes.
    """
    gains = np.ones((x.shape[1], *x.shape[3:])) if near is None else near
    for step in (1.0, 0.8, 0.8) if near is None else (1.0,):
        now = end(x * gains[:, None])
        load = problem.weigh((end(x * (gains[:, None] + 0.02)) - now) / 0.02)
        away = drawn(*_evidence(problem, load, problem.weigh(problem.measured - now), gains))[0]
        gains = np.clip(gains + step * (1 + away - gains), 0.05, 5.0)
    return gains


def _absorbed(
    problem: Problem, load: FloatArray, residual: FloatArray, gains: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    """See `PerChannelCause.absorbed`; the shrinkage of the gains stays as it is."""
    pulls, weights = _evidence(problem, load, residual, gains)
    weight, ridge = weights.sum(axis=0), drawn(pulls, weights)[1]
    return lambda change: load * _shrunk(_by_episode(problem, load * change).sum(axis=0), weight, ridge)[0][:, None]


def _evidence(
    problem: Problem, load: FloatArray, residual: FloatArray, gains: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the arguments of `drawn`, from the effect of adding 1 to all `gains` and from the residual with them.

    Both are ``(T, pads, 3, rows, cols)`` in units of the noise.
    """
    weights = _by_episode(problem, load**2)
    return _by_episode(problem, load * residual) + (gains - 1) * weights, weights


def _by_episode(problem: Problem, values: FloatArray) -> FloatArray:
    """``(episodes, pads, rows, cols)`` sums of ``(T, pads, 3, rows, cols)`` over axes and frames of each episode."""
    if problem.fitted is not None:
        values = values * problem.fitted[:, None, None, None, None]
    return np.stack([values[span].sum(axis=(0, 2)) for span in problem.episodes])


def drawn(pulls: FloatArray, weights: FloatArray) -> tuple[FloatArray, float]:
    """Return the deviations of the gains from 1, and the weight of the shrinkage towards the common gain.

    A misplaced contact or another cause acts for a whole episode, so errors within an episode are correlated. Their
    excess variance is estimated from the scatter of the gain between episodes, and the prior variance from the scatter
    between well-loaded taxels (empirical Bayes).

    Args:
        pulls: ``(episodes, pads, rows, cols)`` sum of load times residual at gains of 1, in units of the noise.
        weights: ``(episodes, pads, rows, cols)`` sum of the squared load, in the same units.
    """
    pull, weight = pulls.sum(axis=0), weights.sum(axis=0)
    informs = weights > MIN_WEIGHT * weights.max()
    degrees = max(int(informs.sum() - informs.any(axis=0).sum()), 1)
    ridge = 1 / GAIN_PRIOR**2
    away = pull / (weight + ridge)
    for _ in range(BAYES_ITERATIONS):
        excess = max(float(np.sum((pulls - weights * away)[informs] ** 2 / weights[informs])) / degrees, 1.0)
        _, common, trust = _shrunk(pull, weight, ridge)
        apart = (pull / np.maximum(weight, 1e-12) - common) ** 2 - excess / np.maximum(weight, 1e-12)
        ridge = excess / max(float(np.sum(trust**2 * apart) / max(np.sum(trust**2), 1e-12)), MIN_SPREAD**2)
        away = common + (pull - common * weight) / (weight + ridge)
    return away, ridge


def _shrunk(pull: FloatArray, weight: FloatArray, ridge: float) -> tuple[FloatArray, float, FloatArray]:
    """Return the shrunk gains, the common gain, and how far each taxel's own gain is trusted."""
    trust = np.where(weight > MIN_WEIGHT * weight.max(), weight / (weight + ridge), 0.0)
    common = float(np.sum(trust * pull / np.maximum(weight, 1e-12)) / max(trust.sum(), 1e-12))
    return common + (pull - common * weight) / (weight + ridge), common, trust


def _error(problem: Problem, prediction: FloatArray, gains: FloatArray) -> FloatArray:
    """``(pads, rows, cols)`` half-width of each taxel's 90% interval.

    It combines the scatter between episodes, the tolerated gain errors of the axes, the tolerated position error of
    contacts and, for barely pressed taxels, the scatter of the other gains.
    """
    count, tolerance = len(problem.episodes), Tolerance()
    load = problem.weigh(prediction) / np.maximum(np.abs(gains), 0.05)[:, None]
    pulls, weights = _evidence(problem, load, problem.residual(prediction), gains)
    weight, prior = weights.sum(axis=0), drawn(pulls, weights)[1]
    episodes = np.sum((pulls - (gains - 1) * weights) ** 2, axis=0) * count / (count - 1)
    axes = np.sum((tolerance.gain * gains[:, None] * np.sum(load**2, axis=0)) ** 2, axis=1)
    moved = [problem.weigh(tolerance.place * change / 2) for change in differences(prediction)]
    places = sum(np.sum(load * change, axis=(0, 2)) ** 2 for change in moved)
    informed = weight > prior
    spread = float(np.std(gains[informed])) if informed.sum() > 1 else GAIN_PRIOR
    error = np.sqrt(np.maximum(episodes, weight) + axes + places + (prior * spread) ** 2) / (weight + prior)
    return error * student.ppf(0.95, count - 1)


def _size(gains: FloatArray, problem: Problem) -> float:
    """Load-weighted standard deviation of the gains, in units of materiality."""
    load = np.sum((problem.simulated * problem.weight) ** 2, axis=(0, 2))
    return float(np.sqrt(np.cov(np.ravel(gains), aweights=load.ravel(), ddof=0)) / MATERIAL_SPREAD)


TAXEL_GAIN = PerChannelCause(
    name="taxel_gain",
    order=75,  # it commutes with the filters, and behind them it does not slow down their fit
    make=lambda v, p: augment.TaxelGain(np.asarray(v)),
    excites="places",
    array="gain",
    unit="1",
    solve=_solve,
    error=_error,
    absorbed=_absorbed,
    misfit=0.01,
    price=3.0,
    size=_size,
    barred=bent_apart,
    words="Each taxel has its own gain.",
    picture="taxel_map",
)
