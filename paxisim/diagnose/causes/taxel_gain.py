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


def taxel_gains(
    problem: Problem, x: FloatArray, end: Callable[[FloatArray], FloatArray], near: FloatArray | None
) -> FloatArray:
    """``(pads, rows, cols)`` best-fitting gains, see `drawn`; the arguments are those of `PerChannelCause.solve`.

    Everything after the gains acts on each taxel separately, so a single perturbation of all gains yields all slopes.
    """
    rounds = 3 if near is None else 1
    gains = np.ones((x.shape[1], *x.shape[3:])) if near is None else near
    for turn in range(rounds):
        now = end(x * gains[:, None])
        slope = (end(x * (gains[:, None] + 0.02)) - now) / 0.02
        load = problem.weigh(slope)
        weights = by_episode(problem, load**2)
        away = drawn(
            by_episode(problem, load * problem.weigh(problem.measured - now)) + (gains - 1) * weights, weights
        )[0]
        change = 1 + away - gains
        gains = np.clip(gains + (change if turn == 0 else 0.8 * change), 0.05, 5.0)
    return gains


def _absorbed(
    problem: Problem, load: FloatArray, residual: FloatArray, gains: FloatArray
) -> Callable[[FloatArray], FloatArray]:
    """See `PerChannelCause.absorbed`; the shrinkage of the gains stays as it is."""
    weights = by_episode(problem, load**2)
    weight = weights.sum(axis=0)
    ridge = drawn(by_episode(problem, load * residual) + (gains - 1) * weights, weights)[1]

    def absorbed(change: FloatArray) -> FloatArray:
        pull = by_episode(problem, load * change).sum(axis=0)
        common = _common(pull / np.maximum(weight, 1e-12), weight, ridge)[0]
        return load * (common + (pull - common * weight) / (weight + ridge))[:, None]

    return absorbed


def by_episode(problem: Problem, values: FloatArray) -> FloatArray:
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
    tells = weights > MIN_WEIGHT * weights.max()
    degrees = max(int(tells.sum() - tells.any(axis=0).sum()), 1)
    bare = pull / np.maximum(weight, 1e-12)
    ridge = 1 / GAIN_PRIOR**2
    away = pull / (weight + ridge)
    for _ in range(BAYES_ITERATIONS):
        left = pulls - weights * away
        excess = max(float(np.sum(left[tells] ** 2 / weights[tells])) / degrees, 1.0)
        common, trust = _common(bare, weight, ridge)
        apart = (bare - common) ** 2 - excess / np.maximum(weight, 1e-12)
        ridge = excess / max(float(np.sum(trust**2 * apart) / max(np.sum(trust**2), 1e-12)), MIN_SPREAD**2)
        away = common + (pull - common * weight) / (weight + ridge)
    return away, ridge


def _common(bare: FloatArray, weight: FloatArray, ridge: float) -> tuple[float, FloatArray]:
    """Return the common gain of the taxels, from each taxel's own, and how far each of these is trusted."""
    trust = np.where(weight > MIN_WEIGHT * weight.max(), weight / (weight + ridge), 0.0)
    return float(np.sum(trust * bare) / max(trust.sum(), 1e-12)), trust


def _error(problem: Problem, prediction: FloatArray, gains: FloatArray) -> FloatArray:
    """``(pads, rows, cols)`` half-width of each taxel's 90% interval.

    It combines the scatter between episodes, the tolerated gain errors of the axes, the tolerated position error of
    contacts and, for barely pressed taxels, the scatter of the other gains.
    """
    count = len(problem.episodes)
    load = problem.weigh(prediction)
    scores = problem.residual(prediction) * load
    load = load / np.maximum(np.abs(gains), 0.05)[:, None]
    squares = load**2
    by_axis, weights = squares.sum(axis=0), by_episode(problem, squares)
    products = weights.sum(axis=0)
    scores = by_episode(problem, scores) / np.maximum(np.abs(gains), 0.05)
    prior = drawn(scores + (gains - 1) * weights, weights)[1]
    total = products + prior
    episodes = np.sum(scores**2, axis=0) * count / (count - 1)
    tolerance = Tolerance()
    axes = np.sum((tolerance.gain * gains[:, None] * by_axis) ** 2, axis=1)
    moved = [tolerance.place * change / 2 for change in differences(prediction)]
    places = sum(np.sum(load * problem.weigh(e), axis=(0, 2)) ** 2 for e in moved)
    told = products > prior
    spread = float(np.std(gains[told])) if told.sum() > 1 else GAIN_PRIOR
    shrunk = (prior * spread) ** 2
    error = np.sqrt(np.maximum(episodes, products) + axes + places + shrunk) / total
    return error * student.ppf(0.95, count - 1)


def _size(gains: FloatArray, problem: Problem) -> float:
    """Load-weighted standard deviation of the gains, in units of materiality."""
    load = np.sum((problem.simulated * problem.weight) ** 2, axis=(0, 2))
    mean = np.average(gains, weights=load)
    return float(np.sqrt(np.average((np.asarray(gains) - mean) ** 2, weights=load)) / MATERIAL_SPREAD)


TAXEL_GAIN = PerChannelCause(
    name="taxel_gain",
    order=75,  # it commutes with the filters, and behind them it does not slow down their fit
    make=lambda v, p: augment.TaxelGain(np.asarray(v)),
    excites="places",
    array="gain",
    unit="1",
    solve=taxel_gains,
    error=_error,
    absorbed=_absorbed,
    misfit=0.01,
    price=3.0,
    size=_size,
    barred=bent_apart,
    words="Each taxel has its own gain.",
    picture="taxel_map",
)
