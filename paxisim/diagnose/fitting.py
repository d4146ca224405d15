"""Fitting: the parameters of several causes at once, with the real transforms, by damped Gauss-Newton steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paxisim import augment
from paxisim.augment.transform import STAGES, Transform
from paxisim.diagnose.cause import TAXEL_GAIN, Cause, Free, cause
from paxisim.diagnose.problem import FloatArray, Problem

_PROBE = 0.05  # of a parameter's scale, to see what it does
_PRIOR = 0.1  # of a taxel's gain about 1: what keeps a gain that nothing was pressed on at 1

Fitted = Mapping[str, FloatArray]


@dataclass(frozen=True, eq=False)
class Fit:
    """Causes with fitted parameters.

    Attributes:
        values: By cause, in the order of its `free`, or the array that was solved for.
        prediction: ``(T, pads, 3, rows, cols)`` newtons, with the problem's zero.
        energy: ``(episodes,)`` squared residual in units of the noise, freed of each channel's mean.
    """

    values: Fitted
    prediction: FloatArray
    energy: FloatArray


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


def predict(problem: Problem, causes: Sequence[Cause], values: Fitted) -> tuple[FloatArray, Fitted]:
    """What the causes make of the simulated stream, with the problem's zero.

    Args:
        problem: The recording.
        causes: Which ones.
        values: Of each; where the array of one that is solved in closed form is missing, that which fits best is taken.

    Returns:
        ``(T, pads, 3, rows, cols)`` newtons, and the values, with those arrays.
    """
    ordered = sorted(causes, key=lambda c: c.order)
    y, done = problem.simulated, 0
    for place, item in enumerate(ordered):
        if item.solve is None:
            continue
        y = _run(problem, ordered[done:place], values, y)
        if item.name not in values:
            behind = [c for c in ordered[place + 1 :] if c.solve is None]
            known = values
            solved = item.solve(problem, y, lambda force: _end(problem, behind, known, force), not behind)  # noqa: B023
            values = {**values, item.name: solved}
        y = problem.run(made(problem, item, values[item.name]), y)
        done = place + 1
    return _end(problem, ordered[done:], values, y), values


def _end(problem: Problem, ordered: Sequence[Cause], values: Fitted, force: FloatArray) -> FloatArray:
    """What the causes make of `force`, the zero put in where it belongs."""
    middle = cause(TAXEL_GAIN).order
    force = _run(problem, [c for c in ordered if c.order < middle], values, force) + problem.zero
    return _run(problem, [c for c in ordered if c.order > middle], values, force)


def _run(problem: Problem, causes: Sequence[Cause], values: Fitted, force: FloatArray) -> FloatArray:
    return problem.run(chain_of(problem, causes, values), force) if causes else force


def fit(problem: Problem, causes: Sequence[Cause], start: Fitted | None = None, steps: int = 8) -> Fit:
    """Fit `causes` to all of a problem.

    Args:
        problem: The recording.
        causes: What to fit.
        start: Values to begin with; a cause that is not in it begins with its best probe.
        steps: Iterations at most.
    """
    shared = [c for c in causes if c.solve is None]
    known = {c.name for c in shared}
    values = {n: np.asarray(v, dtype=float) for n, v in (start or {}).items() if n in known}

    def residual(values: Fitted) -> FloatArray:
        some = [c for c in causes if c.name in values or c.solve]
        return problem.residual(predict(problem, some, values)[0]).ravel()

    for item in sorted(shared, key=lambda c: c.name not in values):
        if item.name not in values:
            values[item.name] = _best_probe(problem, item, values, residual)
    free = [(c.name, i, f) for c in shared for i, f in enumerate(c.free(problem))]
    best = residual(values)
    energy, damping = float(best @ best), 1e-3
    for _ in range(steps if free else 0):
        slopes = np.empty((len(free), len(best)))
        for row, (name, index, about) in enumerate(free):
            step = _step(values, name, index, about)
            slopes[row] = (residual(_moved(values, name, index, step)) - best) * (about.scale / step)
        normal, right = slopes @ slopes.T, slopes @ best
        before = energy
        for _ in range(5):
            ridge = damping * np.diag(np.diag(normal) + 1e-6 * np.trace(normal) + 1e-9)
            change = -np.linalg.solve(normal + ridge, right)
            trial = {n: v.copy() for n, v in values.items()}
            for (n, i, f), amount in zip(free, change, strict=True):
                trial[n][i] = np.clip(trial[n][i] + np.clip(amount, -5, 5) * f.scale, f.low, f.high)
            try:
                new = residual(trial)
            except ValueError:  # values that are allowed one by one, but not together
                damping *= 8
                continue
            if new @ new < energy:
                values, best, energy, damping = trial, new, float(new @ new), damping / 4
                break
            damping *= 8
        if before - energy < 1e-4 * before:
            break
    return fit_of(problem, causes, values)


def fit_of(problem: Problem, causes: Sequence[Cause], values: Fitted) -> Fit:
    """A fit with given values."""
    prediction, values = predict(problem, causes, values)
    weighed = problem.residual(prediction)
    return Fit(values, prediction, np.array([np.sum(weighed[span] ** 2) for span in problem.episodes]))


def _step(values: Fitted, name: str, index: int, free: Free) -> float:
    """How far to move a parameter to see its effect: inwards at a bound."""
    step = _PROBE * free.scale
    return -step if values[name][index] + step > free.high else step


def _moved(values: Fitted, name: str, index: int, step: float) -> Fitted:
    moved = values[name].copy()
    moved[index] += step
    return {**values, name: moved}


def _best_probe(problem, item, values, residual):  # type: ignore[no-untyped-def]
    """The probe, taken as far as it helps, with which a cause begins."""
    free = item.free(problem)
    neutral = np.array([f.neutral for f in free])
    low, high = np.array([f.low for f in free]), np.array([f.high for f in free])
    base = residual({**values, item.name: neutral})
    best, least = neutral, base @ base
    for probe in item.probes(problem):
        probe = np.asarray(probe, dtype=float)
        effect = residual({**values, item.name: probe}) - base
        amount = -(effect @ base) / max(effect @ effect, 1e-12)
        defining = np.array([f.material is not None for f in free])
        for share in (amount, 1.0):
            trial = np.where(defining, np.clip(neutral + share * (probe - neutral), low, high), probe)
            new = residual({**values, item.name: trial})
            if new @ new < least:
                best, least = trial, new @ new
    return best


def taxel_gains(problem: Problem, y: FloatArray, end: Callable[[FloatArray], FloatArray], last: bool) -> FloatArray:
    """``(pads, rows, cols)`` gains that fit best, drawn to 1 where little was pressed; see `Cause.solve`.

    What comes after the gains acts on each taxel alone, so that one small change of all of them shows every slope.
    """
    gains = np.ones((y.shape[1], *y.shape[3:]))
    for number in range(1 if last else 3):
        now = end(y * gains[:, None])
        slope = y if last else (end(y * (gains[:, None] + 0.02)) - now) / 0.02
        load = problem.weigh(slope)
        rest = problem.residual(now)
        change = np.sum(load * rest, axis=(0, 2)) / (np.sum(load**2, axis=(0, 2)) + 1 / _PRIOR**2)
        gains = np.clip(gains + (change if number == 0 else 0.8 * change), 0.05, 5.0)
    return gains
