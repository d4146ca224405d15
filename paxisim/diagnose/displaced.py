"""Displaced: what of a gain in one episode a contact beside its place, a gain or a late time stamp would not bring."""

from __future__ import annotations

import numpy as np

from paxisim.diagnose.noise import differences, rate
from paxisim.diagnose.problem import FloatArray, Problem


def beyond_tolerated(problem: Problem, fewer: FloatArray, more: FloatArray, span: slice) -> float:
    """The energy, in units of the noise, by which a model gains on another in an episode, freed of what is tolerated.

    All shapes that each pad may be off by in this episode (its gain, its contact's place, its time) are taken out of
    the residual and of the change between the two models alike.

    Args:
        problem: The recording.
        fewer: ``(T, pads, 3, rows, cols)`` newtons, a model's prediction.
        more: The same, of the one that gains.
        span: The episode.
    """
    force = fewer[span]
    shapes = np.stack([force, *differences(force), rate(force, problem.time[span])])
    rest = problem.residual(fewer)[span]
    change = rest - problem.residual(more)[span]
    total = 0.0
    for pad in range(force.shape[1]):
        tolerated = (shapes[:, :, pad] * problem.weight[span][:, pad]).reshape(len(shapes), -1)
        both = np.stack([rest[:, pad].ravel(), change[:, pad].ravel()])
        factors = np.linalg.lstsq(tolerated @ tolerated.T, tolerated @ both.T, rcond=None)[0]
        own_rest, own_change = both - factors.T @ tolerated
        total += float(2 * own_change @ own_rest - own_change @ own_change)
    return total
