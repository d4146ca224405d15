"""Gains: one for each taxel, in closed form, drawn together where the episodes tell little of one or disagree."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from paxisim.diagnose.cause import GAIN_PRIOR
from paxisim.diagnose.problem import FloatArray, Problem

LEAST_SPREAD = 0.01  # of the gains, below which it is not told
TELLS = 1e-3  # of the best pressed taxel's weight, below which one tells nothing of spread or excess
ROUNDS = 5


def taxel_gains(
    problem: Problem, x: FloatArray, end: Callable[[FloatArray], FloatArray], last: bool, near: FloatArray | None
) -> FloatArray:
    """``(pads, rows, cols)`` gains that fit best, see `drawn`; the arguments are those of `Cause.solve`.

    What comes after the gains acts on each taxel alone, so that one small change of all of them shows every slope.
    """
    rounds = 1 if last or near is not None else 3
    gains = np.ones((x.shape[1], *x.shape[3:])) if near is None else near
    for turn in range(rounds):
        now = end(x * gains[:, None])
        slope = x if last else (end(x * (gains[:, None] + 0.02)) - now) / 0.02
        load = problem.weigh(slope)
        weights = by_episode(problem, load**2)
        away = drawn(by_episode(problem, load * problem.residual(now)) + (gains - 1) * weights, weights)[0]
        change = 1 + away - gains
        gains = np.clip(gains + (change if turn == 0 else 0.8 * change), 0.05, 5.0)
    return gains


def by_episode(problem: Problem, values: FloatArray) -> FloatArray:
    """``(episodes, pads, rows, cols)`` sums of ``(T, pads, 3, rows, cols)`` over each episode's frames and the axes."""
    return np.stack([values[span].sum(axis=(0, 2)) for span in problem.episodes])


def drawn(pulls: FloatArray, weights: FloatArray) -> tuple[FloatArray, float]:
    """How far gains are from 1, and the weight with which each is drawn to the gain that all have in common.

    A contact that is not where it was simulated is so for its whole episode, and what another cause does is there in
    each: then frames tell less than their noise would let them. How much less shows in the gains that the episodes
    would have apart, and how far gains are from one another in those that are told well (empirical Bayes).

    Args:
        pulls: ``(episodes, pads, rows, cols)`` load times what gains of 1 leave, summed, in units of the noise.
        weights: The same of the load squared.
    """
    pull, weight = pulls.sum(axis=0), weights.sum(axis=0)
    tells, told = weights > TELLS * weights.max(), weight > TELLS * weight.max()
    degrees = max(int(tells.sum() - tells.any(axis=0).sum()), 1)
    bare = pull / np.maximum(weight, 1e-12)
    ridge = 1 / GAIN_PRIOR**2
    away = pull / (weight + ridge)
    for _ in range(ROUNDS):
        left = pulls - weights * away
        excess = max(float(np.sum(left[tells] ** 2 / weights[tells])) / degrees, 1.0)
        trust = np.where(told, weight / (weight + ridge), 0.0)
        common = float(np.sum(trust * bare) / max(trust.sum(), 1e-12))
        apart = (bare - common) ** 2 - excess / np.maximum(weight, 1e-12)
        ridge = excess / max(float(np.sum(trust**2 * apart) / max(np.sum(trust**2), 1e-12)), LEAST_SPREAD**2)
        away = common + (pull - common * weight) / (weight + ridge)
    return away, ridge
