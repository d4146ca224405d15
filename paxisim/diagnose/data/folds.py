"""Folds: which samples are held out together.

The unit is the episode, because its samples share the errors of one contact. If a single episode excites a cause, it is
split into two blocks with a gap between them: the cause is fitted to one and tested on the other. In a recording with
few episodes all of them are split into blocks. The first press of a recording without breaks is held out only if it is
split: no other press finds the sensor untouched, so none shows how a sensor with memory reads it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import Rules


@dataclass(frozen=True, eq=False)
class Folds:
    """Assignment of samples to units and of units to folds.

    Attributes:
        unit: ``(T,)`` unit of each sample; -1 in the gap between two blocks.
        fold: ``(units,)`` fold of each unit; -1 for one that is never held out.
        episode: ``(units,)`` episode of each unit.
        split: Indices of the episodes that were split.
    """

    unit: NDArray[np.intp]
    fold: NDArray[np.intp]
    episode: NDArray[np.intp]
    split: tuple[int, ...]

    @property
    def never_held_out(self) -> tuple[int, ...]:
        """Indices of the episodes that are never held out."""
        return tuple(dict.fromkeys(self.episode[self.fold < 0].tolist()))

    @property
    def count(self) -> int:
        """Number of folds."""
        return int(self.fold.max()) + 1

    @property
    def of_sample(self) -> NDArray[np.intp]:
        """``(T,)`` fold that holds each sample out, or -1; the gap after a block takes the fold of the block."""
        unit = np.maximum.accumulate(np.where(self.unit >= 0, self.unit, 0))
        return self.fold[unit]

    def independent(self, gain: FloatArray) -> FloatArray:
        """Sum the gains of the units over each episode; if all episodes are split, return the gains unchanged."""
        count = int(self.episode.max()) + 1
        return gain if len(self.split) == count else np.bincount(self.episode, gain, count).astype(np.float64)


def folds_of(problem: Problem, effects: Iterable[FloatArray], rules: Rules) -> Folds:
    """The folds of a recording.

    Args:
        problem: The recording.
        effects: ``(T, ...)`` N, effects of the causes to look for, on the frames of `problem.thinned`.
        rules: Rules, with the largest number of folds and the length of the gaps.
    """
    count = len(problem.episodes)
    if count >= rules.few_episodes:
        halves = _halves(problem, effects, rules)
        cuts = [[halves[number]] if number in halves else [] for number in range(count)]
    else:
        pieces = -(-rules.few_episodes // count)
        cuts = [np.linspace(span.start, span.stop, pieces + 1)[1:-1].astype(int) for span in problem.episodes]
    unit, episode = np.full(len(problem.time), -1, dtype=np.intp), []
    gap = int(np.ceil(rules.gap / problem.interval))
    for number, (span, inner) in enumerate(zip(problem.episodes, cuts, strict=True)):
        for start, stop in itertools.pairwise([span.start, *inner, span.stop]):
            short = gap if stop < span.stop and stop - start > 2 * gap else 0
            unit[start : stop - short] = len(episode)
            episode.append(number)
    tested = np.ones(len(episode), dtype=bool)
    if count >= rules.few_episodes and problem.runs_on and problem.has_contact:
        first = next(number for number, span in enumerate(problem.episodes) if problem.simulated[span].any())
        tested = (np.array(episode) != first) | (len(cuts[first]) > 0)
    fold = np.where(tested, (np.cumsum(tested) - 1) % min(rules.folds, tested.sum()), -1)
    split = tuple(number for number, inner in enumerate(cuts) if len(inner))
    return Folds(unit, fold, np.array(episode), split)


def _halves(problem: Problem, effects: Iterable[FloatArray], rules: Rules) -> dict[int, int]:
    """The sample at which to split each episode that holds most of the effect of some cause, by its index.

    It is in the middle of the episode, unless one half then has hardly any of the effect, as that before the contact;
    then half of the effect is before it. If an episode holds most of several effects, their samples' median is taken.
    """
    thinned, found = problem.thinned, dict[int, list[int]]()
    stride = problem.sampling.fitted
    for effect in effects:
        energies = [_energy(thinned, effect, span) for span in thinned.episodes]
        sums = np.array([own.sum() for own in energies])
        if sums.max() > rules.lone * sums.sum() > 0:
            number = int(sums.argmax())
            span, half = thinned.episodes[number], len(energies[number]) // 2
            halves = slice(span.start, span.start + half), slice(span.start + half, span.stop)
            parts = [_energy(thinned, effect, part).sum() for part in halves]
            if min(parts) < rules.half * sum(parts):
                half = int(np.searchsorted(np.cumsum(energies[number]), sums[number] / 2))
            found.setdefault(number, []).append(problem.episodes[number].start + stride * half)
    return {number: int(np.median(cuts)) for number, cuts in found.items()}


def _energy(problem: Problem, effect: FloatArray, span: slice) -> FloatArray:
    """``(T,)`` energy of an effect in a span of samples, in units of the noise, without its mean over the span."""
    own = (effect[span] - effect[span].mean(axis=0)) * problem.weight[span]
    return np.sum(own**2, axis=(1, 2, 3, 4))
