"""Held out: how good a model is on episodes that took no part in its fit, and what noise alone would leave."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from paxisim.diagnose.cause import cause
from paxisim.diagnose.diagnosis import HeldOut, Interval
from paxisim.diagnose.each import each
from paxisim.diagnose.engine import Explanation
from paxisim.diagnose.problem import FloatArray, Problem

FOLDS = 8
DRAWS = 400  # of the bootstrap
LEVEL = 0.9  # of the intervals
LONE = 0.5  # of a gain, that one episode has which is held out half by half
CHOSEN = "Causes were chosen on all episodes; their numbers were fitted without those held out."
LEAST_ROOM = 0.02  # of the floor, that the error must be above it for anything to be explained
_EQUAL = 1e-5  # of the force, by which streams without noise may differ
_ALIKE = 0.02  # of the force, by which the simulations of a repeated motion may differ


@dataclass(frozen=True, eq=False)
class Squares:
    """Squared errors in N^2, summed over each episode and the channels that answer.

    Attributes:
        before: ``(episodes,)`` of the simulation.
        after: ``(episodes,)`` of the model, fitted on other episodes.
        floor: ``(episodes,)`` what noise would leave.
        force: ``(episodes,)`` the measured force.
        prediction: ``(T, pads, 3, rows, cols)`` the held-out predictions, N.
        source: Where the floor is read from.
        lone: Numbers of episodes that were held out in halves, as each alone shows most of what was found, or of a
            field, which could not be fitted to the others.
    """

    before: FloatArray
    after: FloatArray
    floor: FloatArray
    force: FloatArray
    prediction: FloatArray
    source: str
    lone: tuple[int, ...] = ()


def folds_of(problem: Problem) -> list[list[int]]:
    """The episodes that are held out together, those of a fold far apart."""
    count = len(problem.episodes)
    return [list(range(fold, count, min(FOLDS, count))) for fold in range(min(FOLDS, count))]


def hold_out(found: Explanation, simulated: FloatArray, jobs: int = 1) -> Squares:
    """Errors of the model on episodes it was not fitted to; with a single episode, on that one.

    An episode that alone shows most of what was found, or of a field, is held out one half after the other.

    Args:
        found: The causes, with the way to fit them again.
        simulated: ``(T, pads, 3, rows, cols)`` the recording's simulation as it came, N.
        jobs: Processors to use.
    """
    problem = found.problem
    count = len(problem.episodes)
    prediction = found.prediction
    lone = _lone(found) if count > 1 else ()
    if count > 1 and found.found:
        prediction = prediction.copy()

        def predicted(split: tuple[list[slice], list[slice]]) -> None:
            others, held_out = split
            refitted = found.fit_on(others)
            for span in held_out:
                prediction[span] = refitted[span]

        each(predicted, _splits(problem, lone), jobs)
    problem = found.judged
    after = problem.measured - problem.read(prediction)
    coarse = any(named.name == "quantisation" for named in found.found)  # then rounding is part of what is wrong
    floor, source = _noise(problem, prediction, after, coarse)
    return Squares(
        _squares(problem, problem.measured - (simulated if coarse else problem.read(simulated))),
        _squares(problem, after),
        floor,
        _squares(problem, problem.measured),
        prediction,
        source,
        lone,
    )


def _lone(found: Explanation) -> tuple[int, ...]:
    """The episodes that alone show most of what was found, or of a field: without them it could not be fitted."""
    gains = [found.empty_energy - found.energy] if found.found else []
    gains += [named.energy_gain for named in found.found if cause(named.name).covariate]
    gains = [np.maximum(gain, 0.0) for gain in gains]
    return tuple(sorted({int(np.argmax(gain)) for gain in gains if gain.max() > LONE * gain.sum()}))


def _splits(problem: Problem, lone: Collection[int]) -> Iterator[tuple[list[slice], list[slice]]]:
    """Samples to fit to, and those to be judged by that fit."""
    for fold in folds_of(problem):
        others = [span for number, span in enumerate(problem.episodes) if number not in fold]
        whole = [problem.episodes[number] for number in fold if number not in lone]
        if whole:
            yield others, whole
        for span in (problem.episodes[number] for number in fold if number in lone):
            middle = (span.start + span.stop) // 2
            halves = slice(span.start, middle), slice(middle, span.stop)
            for own, other in (halves, halves[::-1]):
                yield sorted([*others, other], key=lambda s: s.start), [own]


def _squares(problem: Problem, values: FloatArray) -> FloatArray:
    return np.array([np.sum(values[span] ** 2, where=problem.alive) for span in problem.episodes])


def _noise(problem: Problem, prediction: FloatArray, after: FloatArray, coarse: bool) -> tuple[FloatArray, str]:
    """``(episodes,)`` squares that noise and rounding make (N^2), and where they are read.

    A channel that is pressed is rounded, one at rest need not be; noise that wanders slowly hardly shows in the
    differences from frame to frame, so the variance at rest is taken, within what such noise can make of them. Where
    rounding is a cause, what the model says of it is no noise; where noise hardly reaches the next count, its size is
    known as a bound only, and what the model leaves is no more than it.
    """
    repeated = _repeated(problem)
    if repeated is not None:
        return np.array([repeated * (span.stop - span.start) for span in problem.episodes]), "repeated motions"
    steps = np.concatenate([np.diff(after[span], axis=0) for span in problem.episodes])
    calm = np.concatenate([problem.at_rest[span][1:] for span in problem.episodes])
    if calm.sum() >= 50:
        fast = np.mean(steps[calm] ** 2, axis=0) / 2
        variance = np.clip(np.var(after[problem.at_rest], axis=0), fast, 2.5 * fast)
    else:
        variance = np.median(steps**2, axis=0) / 0.455 / 2
    rounding = problem.counting.left if coarse else problem.step**2 / 12
    each = np.where(np.abs(prediction) > problem.step / 4, np.maximum(variance, rounding), variance)
    floor = np.array([np.sum(each[span], where=problem.alive) for span in problem.episodes])
    if coarse:
        floor *= min(1.0, float(_squares(problem, after).sum() / max(floor.sum(), 1e-12)))
    return floor, "high-frequency differences"


def _repeated(problem: Problem) -> float | None:
    """Half the squared difference of measurements whose simulations are one and the same motion."""
    found = []
    for one, other in itertools.combinations(problem.episodes, 2):
        length = one.stop - one.start
        if length != other.stop - other.start:
            continue
        force = float(np.mean(problem.simulated[one] ** 2))
        if force < 1e-4 * problem.peak**2 or len(found) > 20:
            continue
        if np.mean((problem.simulated[one] - problem.simulated[other]) ** 2) < _ALIKE**2 * force:
            apart = problem.measured[one] - problem.measured[other]
            found.append(float(np.sum(apart**2, where=problem.alive)) / 2 / length)
    return float(np.median(found)) if found else None


def draws_of(episodes: int, seed: int) -> FloatArray:
    """``(DRAWS, episodes)`` how often each episode comes when as many are drawn with replacement."""
    chosen = np.random.default_rng(seed).integers(episodes, size=(DRAWS, episodes))
    return np.stack([np.bincount(row, minlength=episodes) for row in chosen]).astype(float)


def bounds(values: FloatArray) -> tuple[float, float] | tuple[None, None]:
    """The ends of the interval that holds `LEVEL` of the values."""
    values = values[np.isfinite(values)]
    if not len(values):
        return None, None
    low, high = np.quantile(values, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return float(low), float(high)


def explained_share(squares: Squares, after: FloatArray, seed: int) -> Interval | None:
    """The share of the error above the floor that is gone, None if the error is not above it."""
    room = squares.before - squares.floor
    if room.sum() <= max(LEAST_ROOM * squares.floor.sum(), _EQUAL**2 * squares.force.sum()):
        return None
    share = (squares.before - after).sum() / room.sum()
    if len(room) < 3:
        return Interval(float(share))
    draws = draws_of(len(room), seed)
    rooms = draws @ room
    shares = np.where(rooms > 0, draws @ (squares.before - after) / np.where(rooms > 0, rooms, 1.0), np.nan)
    return Interval(float(share), *bounds(shares))


def figures(squares: Squares, seed: int, ceiling: FloatArray | None, note: str) -> HeldOut:
    """The figures that a reader is given.

    Args:
        squares: Errors.
        seed: Of the bootstrap over episodes.
        ceiling: ``(episodes,)`` squared errors (N^2) of the black box, None if it was not run.
        note: What to say of the figures.
    """

    def normalised(values: FloatArray) -> float:
        return float(np.sqrt(values.sum() / max(squares.force.sum(), 1e-12)))

    if squares.lone:
        several = len(squares.lone) > 1
        numbers = " and ".join(str(number + 1) for number in squares.lone)
        those = f"Episodes {numbers}, which alone show" if several else f"Episode {numbers}, which alone shows"
        most = f"{those} most{' of a cause' if several else ''}, {'were' if several else 'was'}"
        note = f"{note} {most} held out one half after the other.".strip()
    if len(squares.after) > 1 and np.any(squares.after != squares.before):
        note = f"{note} {CHOSEN}".strip()
    black = None if ceiling is None else explained_share(squares, ceiling, seed)
    gains = (squares.before - squares.after) / np.maximum(squares.before, 1e-12)
    return HeldOut(
        nrmse_before=normalised(squares.before),
        nrmse_after=normalised(squares.after),
        noise_floor=normalised(squares.floor),
        noise_source=squares.source,
        explained=explained_share(squares, squares.after, seed),
        gain_per_episode=tuple(float(gain) for gain in gains),
        ceiling_nrmse=None if ceiling is None else normalised(ceiling),
        ceiling_explained=None if black is None else black.value,
        note=note,
    )


def gains_of(found: Explanation, squares: Squares, seed: int) -> Mapping[str, Interval]:
    """What each cause takes away of the explainable error, the others fitted again.

    The fit's gain by cause is reduced to what is gained on held-out episodes. That can be explained whatever the floor
    says, which counts rounding that may itself be a cause; with nothing above the floor it is a share of the whole.
    """
    room, kept = squares.before - squares.floor, squares.before - squares.after
    alone = len(found.found) == 1
    shares = {}
    for named in found.found:
        whole = np.maximum(named.energy_gain if alone else found.empty_energy - found.energy, 0.0)

        def share(times: FloatArray, part: FloatArray = named.energy_gain, whole: FloatArray = whole) -> FloatArray:
            of_fit = np.clip((times @ part) / np.maximum(times @ whole, 1e-9), -1.0, 1.0)
            above = times @ room > LEAST_ROOM * (times @ squares.floor)
            explainable = np.where(above, np.maximum(times @ room, times @ kept), times @ squares.before)
            return of_fit * (times @ kept) / np.maximum(explainable, 1e-12)

        value = float(share(np.ones(len(room))))
        limits = (None, None) if len(room) < 3 else bounds(share(draws_of(len(room), seed)))
        shares[named.name] = Interval(value, *limits)
    return shares


def survives(gain: FloatArray, least: float, seed: int) -> float:
    """How often, when episodes are drawn anew, a gain is more than `least`."""
    if len(gain) < 2:
        return 0.5 * float(gain.sum() > least)
    return float(np.mean(draws_of(len(gain), seed) @ gain > least))
