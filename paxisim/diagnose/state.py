"""State: how far a diagnosis has come, and its steps: causes beside a zero, a zero beside causes, a closer look."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from paxisim import augment
from paxisim.diagnose.cause import DEAD_BAND, MANY, cause
from paxisim.diagnose.find_zero import zero_of
from paxisim.diagnose.fitting import Fit, fit, fit_of, made, predict
from paxisim.diagnose.outliers import without_outliers
from paxisim.diagnose.plan import Plan
from paxisim.diagnose.problem import Problem
from paxisim.diagnose.search import Found, found_with, search
from paxisim.diagnose.under_load import tells_under_load
from paxisim.diagnose.worth import Thresholds
from paxisim.diagnose.zero import Zero, nothing

CLOSER = 0.4  # of what a cause must bring, that it must bring where no sample is far off
CHANCE = 200.0  # energy, in units of the noise, that slow noise brings in a short recording, too
TURNS = 3  # of a dead band and the zero that it holds back
FEWER = 2.0  # times what matters, that a drift must bring to stay, and at last: no other goes one way all along
LEFT = 0.06  # of what the other causes explain, that their forms leave to an offset
ROUNDING = 1e-9  # of an energy: two that differ by less are the same


@dataclass(frozen=True, eq=False)
class State:
    """How far a diagnosis has come.

    Attributes:
        problem: The recording, with the zero known.
        found: Causes that were found in it.
        zero: What is read without a force.
        nearly: By cause that was not found, what it brings as a share of what it must bring.
    """

    problem: Problem
    found: Found
    zero: Zero
    nearly: Mapping[str, float] = field(default_factory=dict)

    def or_better(self, other: State, limits: Thresholds) -> State:
        """This one, or `other` if that leaves less: each name counts as what it must bring."""
        return other if other._left(limits) < self._left(limits) else self

    def _left(self, limits: Thresholds) -> float:
        names = len(self.found.fit.values) + MANY * len(self.zero.gain)
        return float(self.found.fit.energy.sum()) + names * limits.material * self.problem.samples


def first_look(problem: Problem, plan: Plan) -> State:
    """What is found beside the zero that is read before a contact, or with a load where it shows only so."""
    material, hidden = MANY * plan.limits.material, tells_under_load(problem)
    zero = zero_of(problem, problem.simulated, material, plan.limits.episodes, names=plan.slow, resting=not hidden)
    beside = with_zero(problem, zero)
    state = State(beside, search(beside, plan), zero)
    if hidden and zero.gain:  # what another cause does may have been taken for an offset
        alone = State(problem, search(problem, plan), nothing(problem))
        if state.or_better(alone, plan.limits) is alone:
            state = replace(alone, zero=zero)  # to be read again beside them
    return state


def with_slow(state: State, plan: Plan) -> State:
    """With offset and drift read beside the causes, and the causes looked for beside them."""
    plan.tell("reading offset and drift")
    last = _zero_renewed(state, plan)
    if DEAD_BAND in last.found.fit.values and (last.zero.gain or len(last.found.fit.values) > 1):
        begin = _ahead_of_band(state, plan)  # others may have stood in for what it held back
        if begin.zero.gain:
            last = last.or_better(_zero_renewed(begin, plan), plan.limits)
    return last


def closer(state: State, plan: Plan) -> State:
    """With what shows where samples that are far off count little, as several episodes agree."""
    plan.tell("looking again without the samples that are far off")
    share = np.clip(CHANCE / (plan.limits.material * state.problem.samples), CLOSER, 1.0)
    plan = replace(plan, limits=replace(plan.limits, material=float(share) * plan.limits.material, second=True))
    problem, found, zero = state.problem, state.found, state.zero
    near = without_outliers(problem, found.fit.prediction)
    again = zero_beside(near, found.fit, plan)
    if not again.gain.keys() <= zero.gain.keys():
        zero, problem, near = again, with_zero(problem, again), with_zero(near, again)
    second = search(near, plan, list(found.fit.values))
    if DEAD_BAND in found.fit.values and DEAD_BAND not in second.fit.values:  # ahead of which the zero was read
        zero = again = zero_beside(near, second.fit, plan)
        problem = with_zero(problem, zero)
    if zero is again or second.fit.values.keys() != found.fit.values.keys():
        doubted = second.fit.values.keys() - found.fit.values.keys()
        found = found_with(problem, plan, second.fit, doubted)
    return State(problem, found, zero, second.nearly)


def with_zero(problem: Problem, zero: Zero) -> Problem:
    """The problem in which so much is read without a force."""
    return replace(problem, zero=zero.at(problem.time - problem.time[0]))


def zero_beside(problem: Problem, fitted: Fit, plan: Plan, *, drifted: bool = False) -> Zero:
    """What is read without a force beside causes that were fitted.

    Args:
        problem: The recording.
        fitted: The causes.
        plan: Whether offset and drift are looked for, and what they must bring.
        drifted: Whether a drift was found before these causes were known.
    """
    # a dead band holds back small zeros: they are told by what gets through with a load
    chosen = [cause(name) for name in fitted.values if name != DEAD_BAND]
    if DEAD_BAND in fitted.values:
        gate = cast(augment.DeadBand, made(problem, cause(DEAD_BAND), fitted.values[DEAD_BAND]))
        problem = replace(problem, gate=gate)
    bare = predict(replace(problem, zero=0.0), chosen, fitted.values)[0]
    owned = any(item.name == "interference" for item in chosen)
    hidden = tells_under_load(problem)
    limits = plan.limits
    material = MANY * limits.material
    drifts = FEWER * limits.material if (limits.second or drifted) and not hidden else None

    def energy(zero: Zero) -> float:
        return float(np.sum(problem.residual(bare + zero.at(problem.time - problem.time[0])) ** 2))

    if hidden:  # what the other causes' forms leave is there, too
        without = replace(problem, gate=None).residual(problem.simulated + problem.zero)
        explained = np.sum(without**2) - np.sum(problem.residual(bare + problem.zero) ** 2)
        material += LEFT * max(float(explained), 0.0) / problem.samples
    zero = zero_of(problem, bare, material, limits.episodes, drifts=drifts, names=plan.slow, owned=owned)
    if owned and not zero.gain:  # only what the field has of its own, which a coarse sensor may not tell either
        none = nothing(problem)
        return none if energy(none) < (1 - ROUNDING) * energy(zero) else zero
    return zero


def _zero_renewed(state: State, plan: Plan) -> State:
    zero = zero_beside(state.problem, state.found.fit, plan, drifted="drift" in state.zero.gain)
    if not zero.gain and not state.zero.gain:
        return State(state.problem, state.found, zero)
    problem = with_zero(state.problem, zero)
    found = search(problem, plan, list(state.found.fit.values))
    again = zero_beside(problem, found.fit, plan, drifted="drift" in zero.gain)
    renewed = with_zero(problem, again)
    much = MANY * plan.limits.material * problem.samples
    if _energy(renewed, found.fit) < _energy(problem, found.fit) + much:  # else it was lost behind a dead band
        problem, zero = renewed, again
    return State(problem, found, zero)


def _ahead_of_band(state: State, plan: Plan) -> State:
    """The zero and a dead band, each fitted with the other known."""
    band, problem, zero = [cause(DEAD_BAND)], state.problem, state.zero
    fitted = fit(problem, band, state.found.fit.values)
    for _ in range(TURNS):
        zero = zero_beside(problem, fitted, plan)
        problem = with_zero(problem, zero)
        fitted = fit(problem, band, fitted.values)
    return State(problem, found_with(problem, replace(plan, searched=band), fitted, set()), zero)


def _energy(problem: Problem, fitted: Fit) -> float:
    return float(fit_of(problem, fitted.causes, fitted.values).energy.sum())
