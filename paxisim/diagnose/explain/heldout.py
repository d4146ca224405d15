"""Held out: errors of a model on held-out samples, and the noise floor."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paxisim.diagnose.data.problem import FloatArray, Problem, showing
from paxisim.diagnose.explain.explanation import Explanation, reading_without
from paxisim.diagnose.result import HeldOut, Interval
from paxisim.diagnose.rules import STREAMS

RESAMPLES = 400  # bootstrap resamples
CONFIDENCE_LEVEL = 0.9  # confidence level of the intervals
CHOSEN = "The causes were selected on the same held-out episodes; their parameters were fitted without them."
NOT_HELD_OUT = "Episode {} was not held out, because only there the sensor had not been pressed before."
MIN_EXPLAINABLE = 0.02  # least explainable error, relative to the noise floor
EQUAL_STREAMS = 1e-5  # difference, relative to the force, up to which noise-free streams count as equal
SLOW_NOISE = 2.5  # largest ratio of the variance at rest to that of the fast noise


@dataclass(frozen=True, eq=False)
class SquaredErrors:
    """Squared errors in N^2, summed over each episode and the channels in use.

    Attributes:
        before: ``(episodes,)`` errors of the simulation.
        after: ``(episodes,)`` held-out errors of the model.
        without: ``(episodes,)`` held-out errors of the model refitted without a cause, by its name.
        floor: ``(episodes,)`` noise floor.
        force: ``(episodes,)`` squares of the measured force.
        source: What the noise floor was estimated from.
        split: Indices of the episodes that were split into blocks, which were held out in turn.
        never_held_out: Indices of the episodes that were never held out.
    """

    before: FloatArray
    after: FloatArray
    without: Mapping[str, FloatArray]
    floor: FloatArray
    force: FloatArray
    source: str
    split: tuple[int, ...]
    never_held_out: tuple[int, ...]

    @property
    def room(self) -> FloatArray:
        """``(episodes,)`` explainable error: the error of the simulation above the noise floor."""
        return self.before - self.floor


def squares_of(found: Explanation, jobs: int = 1) -> SquaredErrors:
    """Squared errors of the simulation and the model on held-out samples."""
    problem, simulated = found.off.judged, found.off.raw.simulated
    coarse = any(reading.rounds for reading in found.off.readings.values())  # then rounding is one of the causes
    after = problem.measured - problem.read(found.heldout)
    floor, source = _noise(problem, found.heldout, after, coarse)
    return SquaredErrors(
        before=by_episode(problem, problem.measured - (simulated if coarse else problem.read(simulated))),
        after=by_episode(problem, after),
        without={
            named.name: by_episode(problem, problem.measured - reading_without(found, named, jobs=jobs))
            for named in found.named
        },
        floor=floor,
        force=by_episode(problem, problem.measured),
        source=source,
        split=found.folds.split,
        never_held_out=found.folds.never_held_out,
    )


def by_episode(problem: Problem, values: FloatArray) -> FloatArray:
    """``(episodes,)`` squares of ``(T, pads, 3, rows, cols)`` values, summed over the channels in use."""
    return np.array([np.sum(values[span] ** 2, where=problem.alive) for span in problem.episodes])


def _noise(problem: Problem, prediction: FloatArray, after: FloatArray, coarse: bool) -> tuple[FloatArray, str]:
    """``(episodes,)`` noise floor (N^2) including rounding, and the source of the estimate.

    Rounding errors are certain only under load. Slow noise hardly shows in frame-to-frame differences, so the variance
    at rest is used, limited to 1 to `SLOW_NOISE` times the variance that these differences imply. If rounding is a
    cause, only the part of it that the model cannot predict counts as noise, and the floor is capped at the model's
    residual: where noise rarely reaches the next count, only an upper bound of it is known.
    """
    repeated = _repeated(problem)
    if repeated is not None:
        return np.array([repeated * (span.stop - span.start) for span in problem.episodes]), "repeated motions"
    steps = np.concatenate([np.diff(after[span], axis=0) for span in problem.episodes])
    calm = np.concatenate([problem.at_rest[span][1:] for span in problem.episodes])
    if calm.sum() >= 50:
        fast = np.mean(steps[calm] ** 2, axis=0) / 2
        variance = np.clip(np.var(after[problem.at_rest], axis=0), fast, SLOW_NOISE * fast)
    else:
        variance = np.median(steps**2, axis=0) / 0.455 / 2
    rounding = problem.noise.left if coarse else problem.noise.step**2 / 12
    each = np.where(np.abs(prediction) > problem.noise.step / 4, np.maximum(variance, rounding), variance)
    floor = np.array([np.sum(each[span], where=problem.alive) for span in problem.episodes])
    if coarse:
        floor *= min(1.0, float(by_episode(problem, after).sum() / max(floor.sum(), 1e-12)))
    return floor, "high-frequency differences"


def _repeated(problem: Problem) -> float | None:
    """Half the squared difference (N^2 per frame) between repeats of a simulated motion; None for a pair or none.

    A single pair may be one measurement that was stored twice.
    """
    found, simulated = [], problem.simulated
    for one, other in itertools.combinations(problem.episodes, 2):
        length = one.stop - one.start
        if length != other.stop - other.start or len(found) > 20:
            continue
        force = float(np.mean(simulated[one] ** 2))
        if force < 1e-4 * problem.peak**2:
            continue
        if np.mean((simulated[one] - simulated[other]) ** 2) < STREAMS.same_motion**2 * force:
            apart = problem.measured[one] - problem.measured[other]
            found.append(float(np.sum(apart**2, where=problem.alive)) / 2 / length)
    return float(np.median(found)) if len(found) > 1 else None


def _resampled(values: FloatArray, seed: int) -> FloatArray:
    """``(..., RESAMPLES)`` sums of ``(..., units)`` values over units drawn with replacement, for a bootstrap."""
    count = values.shape[-1]
    return values[..., np.random.default_rng(seed).integers(count, size=(RESAMPLES, count))].sum(axis=-1)


def _share(gained: FloatArray, room: FloatArray, seed: int) -> Interval:
    """The gain ``(episodes,)`` N^2 as a share of an error ``(episodes,)`` N^2, with a 90 % interval over episodes."""
    value = float(gained.sum() / room.sum())
    if len(room) < 3 or not np.ptp(gained):
        return Interval(value)
    own, whole = _resampled(np.array([gained, room]), seed)
    shares = np.where(whole > 0, own / np.where(whole > 0, whole, 1.0), value)
    low, high = np.quantile(shares, [(1 - CONFIDENCE_LEVEL) / 2, (1 + CONFIDENCE_LEVEL) / 2])
    return Interval(value, float(low), float(high))


def explained_share(squares: SquaredErrors, after: FloatArray, seed: int) -> Interval | None:
    """Share of the explainable error that is removed; None if the error does not exceed the noise floor."""
    if squares.room.sum() <= max(MIN_EXPLAINABLE * squares.floor.sum(), EQUAL_STREAMS**2 * squares.force.sum()):
        return None
    return _share(squares.before - after, squares.room, seed)


def gain_of(squares: SquaredErrors, without: FloatArray, seed: int) -> Interval:
    """Share of the explainable error that a cause removes, given the errors ``(episodes,)`` N^2 without it.

    If the error does not exceed the noise floor, it is the share of the whole error.
    """
    above = squares.room.sum() > MIN_EXPLAINABLE * squares.floor.sum()
    room = np.maximum(squares.room, squares.before - squares.after) if above else squares.before
    return _share(without - squares.after, room, seed)


def affected_gain_of(squares: SquaredErrors, without: FloatArray, seed: int) -> Interval:
    """Share of the error that a cause removes in the episodes that it affects, so that others do not dilute it."""
    gain = without - squares.after
    shown = showing(gain)
    return _share(gain[shown], squares.before[shown], seed) if shown.any() else Interval(0.0)


def figures(squares: SquaredErrors, seed: int, ceiling: FloatArray | None, note: str) -> HeldOut:
    """The held-out figures, given the squared errors ``(episodes,)`` N^2 of the black box, if it ran, and a caveat."""

    def normalised(values: FloatArray) -> float:
        return float(np.sqrt(values.sum() / max(squares.force.sum(), 1e-12)))

    notes = [note] if note else []
    if squares.split:
        numbers = ", ".join(str(number + 1) for number in squares.split)
        those = f"Episodes {numbers} were" if len(squares.split) > 1 else f"Episode {numbers} was"
        notes.append(f"{those} split into blocks that were held out in turn.")
    notes += [NOT_HELD_OUT.format(number + 1) for number in squares.never_held_out]
    if np.any(squares.after != squares.before):
        notes.append(CHOSEN)
    black = None if ceiling is None else explained_share(squares, ceiling, seed)
    gains = (squares.before - squares.after) / np.maximum(squares.before, 1e-12)
    return HeldOut(
        nrmse_before=normalised(squares.before),
        nrmse_after=normalised(squares.after),
        noise_floor=normalised(squares.floor),
        noise_source=squares.source,
        explained=explained_share(squares, squares.after, seed),
        gain_per_episode=tuple(map(float, gains)),
        ceiling_nrmse=None if ceiling is None else normalised(ceiling),
        ceiling_explained=None if black is None else black.value,
        note=" ".join(notes),
    )


def survives(gain: FloatArray, needed: float, seed: int) -> float:
    """How often the summed gain of resampled held-out units exceeds `needed`; at most 0.5 for a single unit."""
    if len(gain) < 2:
        return 0.5 * float(gain.sum() > needed)
    return float(np.mean(_resampled(gain, seed) > needed))
