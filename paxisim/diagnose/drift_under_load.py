"""Drift under load: a zero that drifts where steps hide it while nothing is pressed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.sums import Sums
from paxisim.diagnose.under_load import PRIOR, UnderLoad, at_edges, goes_with_load, quiet_frames, under_load
from paxisim.diagnose.zero import Zero, best_tau, course

CLEARLY_DRIFT = 30.0
"""Energy, in units of the noise, by which a drift alone must do better than an offset."""

RELINEARISED = 2
"""Times; what is read of a drift from 0 is no straight image of it where readings are cut."""


def drift_under_load(
    problem: Problem,
    prediction: FloatArray,
    constant: UnderLoad,
    matters: Callable[[FloatArray], bool],
    with_offset: bool,
) -> tuple[Zero | None, UnderLoad]:
    """The zero with a drift that steps hide, if a constant does not do as well; and that constant, settled."""
    time = problem.time - problem.time[0]
    always = np.ones_like(time)
    every = np.ones(len(time), dtype=bool)
    # whole counts of it show without a load
    quiet = quiet_frames(problem)
    left = problem.measured - problem.read(prediction + constant.zero)
    tau = best_tau(lambda tau: Sums(problem, left, [always, course(time, tau)], quiet).explained().sum())
    curve = course(time, tau)
    begin = Sums(problem, left, [always, curve], quiet).values(PRIOR)
    begin[:, 0] += constant.values[:, 0]
    known = (begin @ np.stack([always, curve])).T.reshape(left.shape)
    both, still = constant, np.stack([constant.values[:, 0], np.zeros(len(begin))], axis=1)
    for _ in range(RELINEARISED):
        miss, slope = at_edges(problem, prediction + known)
        rest = miss + slope * known
        tau = best_tau(
            lambda tau, r=rest, s=slope: Sums(problem, r, [always, course(time, tau)], every, s).explained().sum()
        )
        curve = course(time, tau)
        both = under_load(problem, prediction, [always, curve], begin, still)
        begin, known = both.values, both.zero
    # a constant that has not settled would be worse than a drift for that alone
    again = under_load(problem, prediction, [always], both.zero.mean(axis=0).reshape(-1, 1), constant.values)
    constant = max(constant, again, key=lambda fit: fit.gain.sum())
    offset, amplitude = both.values.T
    # it may have begun before the recording, not long before: what goes with it is its own
    ratio = float(np.clip(np.sum(amplitude * offset) / max(np.sum(amplitude**2), 1e-12), 0.0, 1.0))
    one = ratio + curve
    near = amplitude + (offset - ratio * amplitude) / max(float(one.mean()), 0.1)
    tied = under_load(problem, prediction, [one], near[:, None], amplitude[:, None])
    beside = both.gain - constant.gain  # which may be worse than nothing
    clearly = tied.gain.sum() > constant.gain.sum() + CLEARLY_DRIFT
    two = with_offset and matters(beside) and matters(both.gain) and matters(both.gain - tied.gain)
    if two and not goes_with_load(problem, prediction, constant):
        gains = {"drift": beside, "offset": both.gain - tied.gain}
    elif matters(tied.gain) and (clearly or (matters(beside) and not with_offset)):
        amplitude, gains = tied.values[:, 0], {"drift": tied.gain}
        offset = ratio * amplitude
    else:
        return None, constant

    def shaped(values: FloatArray) -> FloatArray:
        return np.where(problem.alive, values.reshape(problem.alive.shape), 0.0)

    return Zero(shaped(offset), shaped(amplitude), tau, gains), constant
