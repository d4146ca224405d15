"""Folds: which samples are held out together.

The unit is the episode, as samples within one share the errors of its contact. An episode that alone excites a cause is
split into two blocks with a gap between them, so that the cause can be fitted to one and judged on the other. The
episodes of a short recording are split likewise.
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
    """What is held out together.

    Attributes:
        unit: ``(T,)`` the unit that each sample belongs to; -1 in the gap between two blocks.
        fold: ``(units,)`` the fold of each unit.
        episode: ``(units,)`` the episode of each unit.
        split: Numbers of the episodes that were split.
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
        """``(T,)`` the fold that leaves each sample out; for the gap after a block, that of the block."""
        unit = np.maximum.accumulate(np.where(self.unit >= 0, self.unit, 0))
        return self.fold[unit]

    def independent(self, gain: FloatArray) -> FloatArray:
        """A gain of each unit, summed over episodes; of a recording of few episodes, which are all split, as it is."""
        count = int(self.episode.max()) + 1
        return gain if len(self.split) == count else np.bincount(self.episode, gain, count).astype(np.float64)


def folds_of(problem: Problem, causes: Iterable[Cause], rules: Rules) -> Folds:
    """The folds of a recording.

    Args:
        problem: The recording.
        causes: That are looked for.
        rules: How many folds there are at most, and how long the gaps.
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
    """Numbers of the episodes that show most of what some cause would do."""
    problem, found = problem.thinned, set()
    for item in causes:
        for effect in effects(problem, item, problem.simulated):
            energy = energy_by_episode(problem, effect)
            if energy.max() > rules.lone * energy.sum() > 0:
                found.add(int(energy.argmax()))
    return found


def effects(problem: Problem, item: Cause, x: FloatArray) -> list[FloatArray]:
    """What a cause does to `x` at each of its starts (N), or by the curves that it follows, of 1 N each."""
    if item.course is not None:
        curves = item.course.curves(problem, item.course.shapes[0])
        return list(curves[..., None, None, None, None])
    if item.change is not None:
        return [item.change(start, problem) for start in item.starts(problem)]
    return [problem.run(item.make(start, problem), x) - x for start in item.starts(problem)]


def energy_by_episode(problem: Problem, effect: FloatArray) -> FloatArray:
    """``(episodes,)`` energy of an effect in units of the noise, freed of a constant of each episode."""
    out = []
    for span in problem.episodes:
        own = effect[span] - effect[span].mean(axis=0)
        out.append(float(np.sum((own * problem.weight[span]) ** 2)))
    return np.array(out)
