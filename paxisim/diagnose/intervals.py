"""Intervals of fitted parameters, wide enough for errors that episodes and channels have in common."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from paxisim.diagnose.cause import TAXEL_GAIN, Cause, Free, cause
from paxisim.diagnose.diagnosis import FittedParameter, Interval
from paxisim.diagnose.engine import Explanation, Named
from paxisim.diagnose.fitting import PRIOR, Fitted, predict
from paxisim.diagnose.problem import FloatArray, Problem, Tolerance

LEVEL = 0.9
_LEVELS, _PER_OCTAVE = 24, 3  # of force, down from the peak
_LEAST_FRAMES = 20  # of an episode of which every other frame is left out
_STEP = 0.02  # of a parameter's scale, to see what it does


def parameters_of(found: Explanation) -> Mapping[str, tuple[FittedParameter, ...]]:
    """By cause, its fitted numbers with units and 90 % intervals."""
    spreads = _spreads(found)
    return {named.name: tuple(_parameters(found, named, spreads)) for named in found.found}


def _parameters(
    found: Explanation, named: Named, spreads: Mapping[tuple[str, str], float]
) -> Iterator[FittedParameter]:
    free = {item.name: item for item in cause(named.name).free(found.problem)}
    for name, value in named.values.items():
        item = free.get(name)
        if item is not None and np.ndim(value) == 0:
            reach = spreads.get((named.name, name))
            number = float(value)
            if reach is None:
                yield FittedParameter(name, item.unit, Interval(number))
            else:
                low, high = max(number - reach, item.low), min(number + reach, item.high)
                yield FittedParameter(name, item.unit, Interval(number, low, high))
            continue
        unit = "1" if named.name in (TAXEL_GAIN, "dead_taxels") and name != "value" else "N"
        unit = "s" if name == "tau" else unit
        array = np.asarray(value, dtype=float)
        reach_of = _gain_spread(found, array) if named.name == TAXEL_GAIN else None
        for place in np.ndindex(array.shape):
            label = name + "".join(f"_{i}" for i in place)
            number = float(array[place])
            if reach_of is None:
                yield FittedParameter(label, unit, Interval(number))
            else:
                reach = float(reach_of[place])
                yield FittedParameter(label, unit, Interval(number, number - reach, number + reach))


def _spreads(found: Explanation) -> dict[tuple[str, str], float]:
    """Half the width of each parameter's interval.

    Errors that episodes, channels or levels of force have in common do not average out within them: the scores of each
    are summed before they are squared. The last stand for a form that is not quite that of the sensor. To these come
    what a contact that is off its place does, and what fewer frames would change.
    """
    problem = found.problem
    chosen = [named for named in found.found if cause(named.name).probes is not None or named.name == TAXEL_GAIN]
    causes = [cause(named.name) for named in chosen]
    free = [(n, item) for n, c in zip(chosen, causes, strict=True) if n.name != TAXEL_GAIN for item in c.free(problem)]
    if not free or len(problem.episodes) < 3:
        return {}
    values = {n.name: np.array([float(v) for v in n.values.values()]) for n in chosen if n.name != TAXEL_GAIN}  # type: ignore[arg-type]
    linear = _Linear(problem, causes, values, [(named.name, item) for named, item in free])
    count = len(problem.episodes)
    reach = linear.spread() * student.ppf(0.5 + LEVEL / 2, count - 1)
    moved = [linear.moved_by(effect) for effect in _misplaced(problem, linear.prediction)]
    if min(span.stop - span.start for span in problem.episodes) >= 2 * _LEAST_FRAMES:
        halved = _Linear(problem.every(2), causes, values, [(named.name, item) for named, item in free])
        moved.append((halved.step() - linear.step()) / 2)
    reach = np.sqrt(reach**2 + np.sum(np.square(moved), axis=0))
    return {(named.name, item.name): float(r) for (named, item), r in zip(free, reach, strict=True)}


class _Linear:
    """A fit as it is near its values: the residual and its slopes."""

    def __init__(
        self, problem: Problem, causes: Sequence[Cause], values: Fitted, free: Sequence[tuple[str, Free]]
    ) -> None:
        self._problem = problem
        self.prediction = predict(problem, causes, values)[0]
        base = problem.residual(self.prediction)
        slope = np.zeros((len(free), *base.shape))
        for row, (name, item) in enumerate(free):
            index = [f.name for f in cause(name).free(problem)].index(item.name)
            step = _STEP * item.scale * (-1 if values[name][index] + _STEP * item.scale > item.high else 1)
            moved = values[name].copy()
            moved[index] += step
            try:
                after = problem.residual(predict(problem, causes, {**values, name: moved})[0])
                slope[row] = (after - base) / step
            except ValueError:  # values that are allowed one by one, but not together
                continue
        frames = len(base)
        self._base, self._slope = base.reshape(frames, -1), slope.reshape(len(free), frames, -1)
        normal = np.einsum("atc,btc->ab", self._slope, self._slope, optimize=True)
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
        self._inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-6) / np.outer(scale, scale)

    def spread(self) -> FloatArray:
        """Standard errors by the parameter."""
        problem, scores = self._problem, self._slope * self._base
        level = _levels(problem)
        by_episode = np.stack([scores[:, span].sum(axis=1) for span in problem.episodes])  # (episodes, D, channels)
        each = np.array([[np.bincount(level[s].ravel(), row[s].ravel(), _LEVELS) for row in scores] for s in problem.episodes])  # fmt: skip
        cells = np.einsum("eac,ebc->ab", by_episode, by_episode)
        count = len(problem.episodes)
        clusters = (
            (_square(by_episode.sum(axis=2)) * count / (count - 1), 1),
            (_square(by_episode.sum(axis=0).T), 1),
            (_square(each.sum(axis=0).T), 1),
        )
        variances = [np.diag(self._inverse @ middle @ self._inverse) for middle, _ in clusters]
        noise = np.diag(self._inverse @ cells @ self._inverse)  # is in each of them
        together = np.sum(variances, axis=0) - 2 * noise
        return np.sqrt(np.maximum(np.maximum(together, np.max(variances, axis=0)), 0.0))

    def moved_by(self, effect: FloatArray) -> FloatArray:
        """By how much an `effect` ``(T, pads, 3, rows, cols)`` on the reading (N) moves each parameter."""
        weighed = self._problem.weigh(effect).reshape(self._base.shape)
        return -self._inverse @ np.einsum("atc,tc->a", self._slope, weighed)

    def step(self) -> FloatArray:
        """By how much each parameter is from its optimum."""
        return -self._inverse @ np.einsum("atc,tc->a", self._slope, self._base)


def _square(scores: FloatArray) -> FloatArray:
    return scores.T @ scores


def _levels(problem: Problem) -> NDArray[np.intp]:
    """``(T, channels)`` the level of force of each sample, each a fixed ratio above the one below."""
    size = np.abs(problem.simulated).reshape(len(problem.time), -1) / problem.peak
    return np.clip(np.log2(np.maximum(size, 1e-9)) * _PER_OCTAVE + _LEVELS, 0, _LEVELS - 1).astype(np.intp)


def _misplaced(problem: Problem, x: FloatArray) -> Iterator[FloatArray]:
    """What contacts that are off by the tolerance along rows and columns change in `x`."""
    padded = np.pad(x, ((0, 0), (0, 0), (0, 0), (1, 1), (1, 1)))
    place = Tolerance().place
    yield place * (padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]) / 2
    yield place * (padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1]) / 2


def _gain_spread(found: Explanation, gains: FloatArray) -> FloatArray | None:
    """``(pads, rows, cols)`` half the width of each taxel's interval.

    Made of what differs from episode to episode, of gains by which the axes of a taxel may be off, of contacts off
    their place, and, for taxels that were hardly pressed, of how far the gains of the others are spread.
    """
    problem = found.problem
    count = len(problem.episodes)
    if count < 3:
        return None
    load = problem.weigh(found.prediction)
    scores = problem.residual(found.prediction) * load
    load = load / np.maximum(np.abs(gains), 0.05)[:, None]
    by_axis = np.sum(load**2, axis=0)
    products = by_axis.sum(axis=1)
    scores = np.stack([np.sum(scores[span], axis=(0, 2)) for span in problem.episodes]) / np.maximum(
        np.abs(gains), 0.05
    )
    prior = 1 / PRIOR**2
    total = products + prior
    episodes = np.sum(scores**2, axis=0) * count / (count - 1)
    tolerance = Tolerance()
    axes = np.sum((tolerance.gain * gains[:, None] * by_axis) ** 2, axis=1)
    places = sum(np.sum(load * problem.weigh(e), axis=(0, 2)) ** 2 for e in _misplaced(problem, found.prediction))
    told = products > prior
    spread = float(np.std(gains[told])) if told.sum() > 1 else PRIOR
    drawn = (prior * spread) ** 2
    error = np.sqrt(np.maximum(episodes, products) + axes + places + drawn) / total
    return error * student.ppf(0.5 + LEVEL / 2, count - 1)
