"""Fitting: the parameters of several causes at once, with the real transforms, by damped Gauss-Newton steps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paxisim import augment
from paxisim.augment.transform import STAGES, Transform
from paxisim.diagnose.cause import TAXEL_GAIN, Cause, Free, cause
from paxisim.diagnose.problem import FloatArray, Problem

_PROBE = 0.05  # of a parameter's scale, to see what it does

Fitted = Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class Fit:
    """Causes with fitted parameters.

    Attributes:
        values: By cause, in the order of its `free`, or the array that was solved for.
        energy: ``(episodes,)`` squared residual in units of the noise, freed of each channel's mean.
        problem: What was fitted.
        causes: The causes.
    """

    values: Fitted
    energy: FloatArray
    problem: Problem
    causes: tuple[Cause, ...]

    @property
    def prediction(self) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` newtons, with the problem's zero; made anew, as many fits are kept."""
        return predict(self.problem, self.causes, self.values)[0]


def in_order(members: Sequence[tuple[str, Transform]]) -> augment.Chain:
    """The named transforms as a chain; one that an earlier stage is expected of is wrapped, as that is meant."""
    stage, chained = 0, []
    for _, member in members:
        own = STAGES.index(member.stage)
        chained.append(augment.Chain([member]) if own < stage else member)
        stage = max(stage, own)
    return augment.Chain(chained, [name for name, _ in members])


def chain_of(problem: Problem, causes: Sequence[Cause], values: Fitted) -> augment.Chain:
    """The causes' transforms in the order of the chain."""
    ordered = sorted(causes, key=lambda c: c.order)
    return in_order([(c.name, made(problem, c, values[c.name])) for c in ordered])


def made(problem: Problem, item: Cause, values: FloatArray) -> Transform:
    """A cause's transform with fitted values."""
    return item.make(values if item.solve else [float(v) for v in values], problem)  # type: ignore[arg-type]


class _Stages:
    """Causes one after the other; what went into each is kept, so that a change of one runs only what follows."""

    def __init__(self, problem: Problem, causes: Sequence[Cause]) -> None:
        ordered = sorted(causes, key=lambda item: item.order)
        middle = cause(TAXEL_GAIN).order
        zero_at = sum(item.order <= middle for item in ordered)
        self._problem = problem
        self._stages: list[Cause | None] = [*ordered[:zero_at], None, *ordered[zero_at:]]  # None: the zero is added
        self._at = {item.name: number for number, item in enumerate(self._stages) if item is not None}
        self._into: list[FloatArray] = []
        self._out = problem.simulated
        self._slope: FloatArray | None = None
        self._solved: Fitted = {}

    @property
    def causes(self) -> list[Cause]:
        """In the order of the chain."""
        return [stage for stage in self._stages if stage is not None]

    @property
    def channels(self) -> tuple[int, ...]:
        """Pads, axes, rows and columns."""
        return self._problem.alive.shape

    def predict(self, values: Fitted) -> tuple[FloatArray, Fitted]:
        """What the causes make of the simulated stream, and the values, with the arrays that were solved for."""
        x, full = self._problem.simulated, values
        self._into = []
        for number, stage in enumerate(self._stages):
            self._into.append(x)
            if stage is not None and stage.solve and stage.name not in full:
                full = {**full, stage.name: self._solve(stage, x, number, full, None)}
            x = self._apply(stage, x, full)
        self._solved = {item.name: full[item.name] for item in self._stages if item is not None and item.solve}
        return x, full

    def residual(self, values: Fitted) -> FloatArray:
        """The residual in a row; changes of `values` may then be tried with `moved` and `slope`."""
        self._out = self.predict(values)[0]
        self._slope = None
        return self._residual(self._out)

    def moved(self, values: Fitted, name: str) -> FloatArray:
        """The residual with other values of cause `name`, the others as they were last."""
        return self._residual(self._moved(values, name))

    def slope(self, values: Fitted, name: str) -> FloatArray:
        """By how much the residual changes with a small change of cause `name`, the others as they were last."""
        problem, compared = self._problem, self._problem.compared
        change = problem.at_compared(self._out) - problem.at_compared(self._moved(values, name))
        if not compared.counting.reads_all:
            if self._slope is None:
                self._slope = compared.counting.slope(problem.at_compared(self._out))
            change *= self._slope
        return compared.weigh(change).ravel()

    def _residual(self, prediction: FloatArray) -> FloatArray:
        return self._problem.compared.residual(self._problem.at_compared(prediction)).ravel()

    def _moved(self, values: Fitted, name: str) -> FloatArray:
        begin = self._at[name]
        x = self._into[begin]
        for number, stage in enumerate(self._stages[begin:], start=begin):
            if stage is not None and stage.solve:
                solved = self._solve(stage, x, number, values, self._solved.get(stage.name))
                values = {**values, stage.name: solved}
            x = self._apply(stage, x, values)
        return x

    def _apply(self, stage: Cause | None, x: FloatArray, values: Fitted) -> FloatArray:
        if stage is None:
            return x + self._problem.zero if np.any(self._problem.zero) else x
        return self._problem.run(made(self._problem, stage, values[stage.name]), x)

    def _solve(self, stage: Cause, x: FloatArray, number: int, values: Fitted, near: FloatArray | None) -> FloatArray:
        """What `Cause.solve` gives for the stage, whose own arrays and those of later ones are not known yet."""
        later = [item for item in self._stages[number + 1 :] if item is None or not item.solve]

        def end(force: FloatArray) -> FloatArray:
            for item in later:
                force = self._apply(item, force, values)
            return force

        assert stage.solve is not None
        solved = stage.solve(self._problem, x, end, all(item is None for item in later), near)
        return solved / solved.mean() if self._at.keys() & set(stage.relative_to) else solved


def predict(problem: Problem, causes: Sequence[Cause], values: Fitted) -> tuple[FloatArray, Fitted]:
    """What the causes make of the simulated stream, with the problem's zero.

    Args:
        problem: The recording.
        causes: Which ones.
        values: Of each; where the array of one that is solved in closed form is missing, that which fits best is taken.

    Returns:
        ``(T, pads, 3, rows, cols)`` newtons, and the values, with those arrays.
    """
    return _Stages(problem, causes).predict(values)


def fit(problem: Problem, causes: Sequence[Cause], start: Fitted | None = None, steps: int = 8) -> Fit:
    """Fit `causes` to all episodes of a problem, to as many of their frames as are needed.

    Args:
        problem: The recording.
        causes: What to fit.
        start: Values to begin with; a cause that is not in it begins with its best probe.
        steps: Iterations at most.
    """
    whole, problem = problem, problem.thinned
    shared = [c for c in causes if c.solve is None]
    known = {c.name: c.free(problem) for c in shared}
    values = {n: _holding(known[n], v, known) for n, v in (start or {}).items() if n in known}
    for item in shared:
        if item.name not in values:
            begun = [c for c in causes if c.name in values or c.name == item.name or c.solve]
            values[item.name] = _best_probe(problem, item, values, _Stages(problem, begun), known)
    free = [(n, i, f) for n, own in known.items() for i, f in enumerate(own) if not f.is_held(known)]
    stages = _Stages(problem, causes)
    held = np.array([0.0 if f.spread is None else 1 / f.spread for _, _, f in free])
    neutral, scale = np.array([f.neutral for _, _, f in free]), np.array([f.scale for _, _, f in free])

    def away(values: Fitted) -> FloatArray:
        """How far the parameters are from what is expected of them, in units of their spread."""
        return np.asarray(held * (np.array([values[n][i] for n, i, _ in free]) - neutral), dtype=np.float64)

    best, off = stages.residual(values), away(values)
    energy, damping = float(best @ best + off @ off), 1e-3
    for _ in range(steps if free else 0):
        slopes = _slopes(stages, values, free, len(best))
        normal = slopes @ slopes.T + np.diag((held * scale) ** 2)
        right = slopes @ best + held * scale * off
        before = energy
        for _ in range(5):
            ridge = damping * np.diag(np.diag(normal) + 1e-6 * np.trace(normal) + 1e-9)
            change = -np.linalg.solve(normal + ridge, right)
            trial = {n: v.copy() for n, v in values.items()}
            for (n, i, f), amount in zip(free, change, strict=True):
                trial[n][i] = np.clip(trial[n][i] + np.clip(amount, -5, 5) * f.scale, f.low, f.high)
            try:
                new = stages.residual(trial)
            except ValueError:  # values that are allowed one by one, but not together
                damping *= 8
                continue
            expected = away(trial)
            total = float(new @ new + expected @ expected)
            if total < energy:
                values, best, off, energy, damping = trial, new, expected, total, damping / 4
                break
            damping *= 8
        if before - energy < 1e-4 * before:
            break
    return fit_of(whole, causes, values)


def _holding(free: Sequence[Free], values: FloatArray, beside: Iterable[str]) -> FloatArray:
    """The values, with those neutral that are held beside causes of these names."""
    return np.array([f.neutral if f.is_held(beside) else v for f, v in zip(free, values, strict=True)])


def _slopes(stages: _Stages, values: Fitted, free: Sequence[tuple[str, int, Free]], size: int) -> FloatArray:
    """``(free, size)`` by how much the residual changes with each number, in units of its scale."""
    slopes = np.zeros((len(free), size))
    shape = stages.channels
    tried: dict[tuple[str, str], FloatArray] = {}
    for row, (name, index, about) in enumerate(free):
        if about.together:
            key = name, about.together
            if key not in tried:
                moved = values[name].copy()
                moved[[i for n, i, f in free if (n, f.together) == key]] += _PROBE * about.scale
                tried[key] = stages.slope({**values, name: moved}, name).reshape(-1, *shape) / _PROBE
            slopes[row].reshape(-1, *shape)[(slice(None), *about.channel)] = tried[key][(slice(None), *about.channel)]
        else:
            step = _step(values, name, index, about)
            slopes[row] = stages.slope(_moved(values, name, index, step), name) * (about.scale / step)
    return slopes


def fit_of(problem: Problem, causes: Sequence[Cause], values: Fitted) -> Fit:
    """A fit with given values."""
    prediction, values = predict(problem, causes, values)
    weighed = problem.residual(prediction)
    energy = np.array([np.sum(weighed[span] ** 2) for span in problem.episodes])
    return Fit(values, energy, problem, tuple(causes))


def _step(values: Fitted, name: str, index: int, free: Free) -> float:
    """How far to move a parameter to see its effect: inwards at a bound."""
    step = _PROBE * free.scale
    return -step if values[name][index] + step > free.high else step


def _moved(values: Fitted, name: str, index: int, step: float) -> Fitted:
    moved = values[name].copy()
    moved[index] += step
    return {**values, name: moved}


def _best_probe(problem: Problem, item: Cause, values: Fitted, stages: _Stages, beside: Iterable[str]) -> FloatArray:
    """The probe, taken as far as it helps, with which a cause begins beside `values` and others of these names."""
    free = item.free(problem)
    neutral = np.array([f.neutral for f in free])
    if all(f.together for f in free):  # many that are told from one another at once
        return _unrounded(problem, item, values, neutral, stages)
    low, high = np.array([f.low for f in free]), np.array([f.high for f in free])
    defining = np.array([f.material is not None for f in free])
    base = stages.residual({**values, item.name: neutral})
    best, least = neutral, base @ base
    assert item.probes is not None
    for given in item.probes(problem):
        probe = _holding(free, np.asarray(given, dtype=float), beside)
        whole = stages.moved({**values, item.name: probe}, item.name)
        effect = whole - base
        amount = -(effect @ base) / max(effect @ effect, 1e-12)
        for share in (amount, 1.0):
            trial = np.where(defining, np.clip(neutral + share * (probe - neutral), low, high), probe)
            same = np.array_equal(trial, probe)
            new = whole if same else stages.moved({**values, item.name: trial}, item.name)
            if new @ new < least:
                best, least = trial, new @ new
    return best


def _unrounded(problem: Problem, item: Cause, values: Fitted, neutral: FloatArray, stages: _Stages) -> FloatArray:
    """Where a cause begins that a sensor's steps hide while it is small: where it would be if it read all forces."""
    if problem.counting.reads_all:
        return neutral
    smooth = replace(problem, step=0.0, clips=False)
    found = fit(smooth, stages.causes, {**values, item.name: neutral}, steps=2).values[item.name]
    base, moved = (stages.residual({**values, item.name: own}) for own in (neutral, found))
    return found if moved @ moved < base @ base else neutral
