"""Creep: the reading keeps changing under a constant load and recovers slowly after release."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import Derived, Free, Values
from paxisim.diagnose.data.problem import Problem

HELD_MEANING = "0 if the sensor reads correctly at once, 1 if it reads correctly after creep has ended"

GROWTH_MEANING = "by how much the creeping share is larger at the peak than at small loads, relative to it"

SLOW_MEANING = "share of the amplitude with time constant tau_2; the rest has tau_1"

MAX_PRESSES = 5.0  # times the longest press; of a slower mode less than a fifth shows, and its gauge acts like a gain
MIN_TAU, MAX_TAU = 0.15, 200.0  # s


def _slowest(problem: Problem) -> float:
    """Longest time constant (s) that the recording can show."""
    longest = 0.0
    for span in problem.episodes:
        time = problem.time[span]
        edges = np.flatnonzero(np.diff(problem.at_rest[span], prepend=True, append=True))
        ends = np.minimum(edges, len(time) - 1).reshape(-1, 2)  # first and last frame of each press
        longest = max(longest, float(np.max(time[ends[:, 1]] - time[ends[:, 0]], initial=0.0)))
    return float(np.clip(MAX_PRESSES * longest, 2.0, MAX_TAU))


def _free(problem: Problem) -> tuple[Free, ...]:
    slowest = _slowest(problem)
    return (
        Free("amplitude", "1", 0.0, -0.5, 1.5, 0.05, 0.012),
        Free("tau_1", "s", 0.6, MIN_TAU, min(20.0, slowest), 0.4),
        Free("share_2", "1", 0.0, 0.0, 1.0, 0.3, words=SLOW_MEANING),
        Free("tau_2", "s", min(5.0, slowest), MIN_TAU, slowest, 3.0),
        Free("calibrated_held", "1", 0.0, 0.0, 1.0, 0.3, spread=1.0, words=HELD_MEANING),  # the gauge
        Free("growth", "1", 0.0, -0.5, 8.0, 0.5, spread=1.0, words=GROWTH_MEANING),
    )


def _starts(problem: Problem) -> list[tuple[float, ...]]:
    slowest = _slowest(problem)
    taus = [tau for tau in (0.3, 1.0, 3.0, 10.0) if tau <= slowest]
    return [(0.1, tau, 0.0, min(5.0, slowest) if tau < 3 else 0.5, held, 0.0) for tau in taus for held in (0.0, 1.0)]


def _make(values: Values, problem: Problem) -> augment.Creep:
    amplitude, tau, share, slower, held, growth = values
    amplitude /= 1 + held * amplitude  # relative to what is read at once, so that creep never becomes a low-pass
    return augment.Creep((amplitude * (1 - share), amplitude * share), (tau, slower), held, growth / problem.peak)


def _after(seconds: float) -> Derived:
    """By how much a held load changes the reading within some seconds, which is better known than the amplitude."""

    def change(values: Values, problem: Problem) -> float:
        creep = _make(values, problem)
        return float(np.sum(np.array(creep.amplitude) * -np.expm1(-seconds / np.array(creep.tau))))

    words = f"change of the reading in the first {seconds:g} s of a held load, as a share of the load"
    return Derived(f"creep_in_{seconds:g}_s", "1", change, words)


# The two modes share one amplitude: modes of opposite signs would cancel and fit effects other than creep.
CREEP = FittedCause(
    name="creep",
    order=20,
    make=_make,
    excites="holds",
    free=_free,
    starts=_starts,
    derived=(_after(1.0), _after(10.0)),
    owns_gain=True,
    remembers=True,
    misfit=0.01,
    words="The reading keeps changing under a constant load and recovers slowly after release.",
    picture="holds",
)
