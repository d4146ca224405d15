"""Folds: which samples are held out together.

The unit is the episode, because its samples share the errors of one contact. If a single episode excites a cause, it is
split into two blocks with a gap between them: the cause is fitted to one and tested on the other. In a recording with
few episodes all of them are split into blocks.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.cause import Cause
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.rules import Rules


@dataclass(frozen=True, eq=False)
class Folds:
    """Assignment of samples to units and of units to folds.

    Attributes:
        unit: ``(T,)`` unit of each sample; -1 in the gap between two blocks.
        fold: ``(units,)`` fold of each unit.
        episode: ``(units,)`` episode of each unit.
        split: Indices of the episodes that were split.
    """

    unit: NDArray[np.intp]
    fold: NDArray[np.intp]
    episode: NDArray[np.intp]
    split: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of folds."""
        return int(self.fold.max()) + 1

    @property
    def of_sample(self) -> NDArray[np.intp]:
        """``(T,)`` fold that holds each sample out; the gap after a block takes the fold of the block."""
        unit = np.maximum.accumulate(np.where(self.unit >= 0, self.unit, 0))
        return self.fold[unit]

    def independent(self, gain: FloatArray) -> FloatArray:
        """Sum the gains of the units over each episode; if all episodes are split, return the gains unchanged."""
        count = int(self.episode.max()) + 1
        return gain if len(self.split) == count else np.bincount(self.episode, gain, count).astype(np.float64)


def folds_of(problem: Problem, causes: Iterable[Cause], rules: Rules) -> Folds:
    """The folds of a recording.

    Args:
        problem: The recording.
        causes: The causes to look for.
        rules: Rules, with the largest number of folds and the length of the gaps.
    """
    count = len(problem.episodes)
    lone = _lone(problem, causes, rules) if count >= rules.few_episodes else set()
    blocks = [2 if number in lone else 1 for number in range(count)]
    if count < rules.few_episodes:
        blocks = [-(-rules.few_episodes // count)] * count
    unit, episode = np.full(len(problem.time), -1, dtype=np.intp), []
    gap = int(np.ceil(rules.gap / problem.interval))
    for number, (span, pieces) in enumerate(zip(problem.episodes, blocks, strict=True)):
        edges = np.linspace(span.start, span.stop, pieces + 1).astype(int)
        for start, stop in itertools.pairwise(edges):
            short = gap if stop < span.stop and stop - start > 2 * gap else 0
            unit[start : stop - short] = len(episode)
            episode.append(number)
    fold = np.arange(len(episode)) % min(rules.folds, len(episode))
    split = tuple(number for number, pieces in enumerate(blocks) if pieces > 1)
    return Folds(unit, fold, np.array(episode), split)


def _lone(problem: Problem, causes: Iterable[Cause], rules: Rules) -> set[int]:
    """Indices of the episodes that each hold most of the effect of some cause."""
    problem, found = problem.thinned, set()
    for item in causes:
        for effect in effects(problem, item, problem.simulated):
            energy = energy_by_episode(problem, effect)
            if energy.max() > rules.lone * energy.sum() > 0:
                found.add(int(energy.argmax()))
    return found


def effects(problem: Problem, item: Cause, x: FloatArray) -> list[FloatArray]:
    """Effect of a cause on `x` at each of its starts (N), or for each curve of its course at an amplitude of 1 N."""
    if item.course is not None:
        curves = item.course.curves(problem, item.course.shapes[0])
        return list(curves[..., None, None, None, None])
    if item.change is not None:
        return [item.change(start, problem) for start in item.starts(problem)]
    return [problem.run(item.make(start, problem), x) - x for start in item.starts(problem)]


def energy_by_episode(problem: Problem, effect: FloatArray) -> FloatArray:
    """``(episodes,)`` energy of an effect in units of the noise, after subtracting its mean over the episode."""
    out = []
    for span in problem.episodes:
        own = effect[span] - effect[span].mean(axis=0)
        out.append(float(np.sum((own * problem.weight[span]) ** 2)))
    return np.array(out)
