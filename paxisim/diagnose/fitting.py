"""Fitting: the parameters of several causes at once, on all episodes and on all but each fold.

Damped Gauss-Newton steps with the real transforms. `scipy.optimize.least_squares` needs 2 to 5 times as long here: it
cannot use that a change of one cause runs only what follows it, and it decomposes Jacobians of a million rows where the
normal equations of some ten numbers are enough (`benchmarks/fit_speed.py`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.cause import Cause, Free
from paxisim.diagnose.model import Fitted, Model
from paxisim.diagnose.problem import FloatArray, Problem

PROBE = 0.05  # of a parameter's scale, to see what it does
STEPS = 12  # of Gauss-Newton at most
CONVERGED = 1e-4  # of the energy, below which a step is the last
ZEROS = 4  # times that the zero and the other numbers are fitted in turns, at most
SETTLED = 2e-3  # of the energy, below which a turn is the last
REFITS = 4  # evaluations for a fold at most
UNSETTLED = 0.02  # energy a channel, in units of the noise, that a fold's fit may still gain by another step


@dataclass(frozen=True, eq=False)
class Part:
    """A fit to the episodes of a fold's complement, or to all.

    Attributes:
        values: By cause, in the order of its `parameters`; the arrays of local causes.
        zero: ``(curves, pads, 3, rows, cols)`` N.
    """

    values: Fitted
    zero: FloatArray


@dataclass(frozen=True, eq=False)
class Fit:
    """Causes with fitted parameters.

    Attributes:
        causes: The causes.
        taus: Time constant of the course of each cause that has one, by name.
        whole: The fit to all episodes.
        folds: Those to all but each fold.
        effects: By cause, the energy of what it does to the reading, in units of the noise, the others as they are.
        energy: ``(units,)`` squared residual, in units of the noise, of the whole fit.
        heldout: ``(units,)`` the same of units that took no part in the fit.
    """

    causes: tuple[Cause, ...]
    taus: Mapping[str, float]
    whole: Part
    folds: tuple[Part, ...]
    effects: Mapping[str, float]
    energy: FloatArray
    heldout: FloatArray

    @property
    def names(self) -> tuple[str, ...]:
        """Of the causes."""
        return tuple(item.name for item in self.causes)


class Fitter:
    """Fits sets of causes to one recording.

    Attributes:
        problem: The recording, thinned to the frames that are needed.
        unit: ``(T,)`` of the compared frames, the unit that each belongs to; -1 for the gaps between blocks.
        fold: ``(units,)`` the fold of each unit.
    """

    def __init__(self, problem: Problem, unit: NDArray[np.intp], fold: NDArray[np.intp]) -> None:
        """Nothing is fitted yet.

        Args:
            problem: The recording.
            unit: ``(T,)`` of all its frames.
            fold: ``(units,)``.
        """
        self.whole, self.problem = problem, problem.thinned
        self.unit = self.problem.at_compared(problem.at_thinned(unit))
        self.fold = fold
        self._shared: dict[tuple[tuple[str, float], ...], tuple[Problem, list[Problem]]] = {}

    @cached_property
    def samples(self) -> float:
        """Numbers in the recording over those that are compared: what energies are multiplied by."""
        return self.whole.samples / self.problem.compared.samples

    def fit(self, causes: Sequence[Cause], start: Fit | None = None, constant: FloatArray | None = None) -> Fit:
        """Fit causes to all episodes, and to all but each fold.

        Args:
            causes: What to fit.
            start: A fit to begin with; a cause that is not in it begins with its best start.
            constant: ``(pads, 3, rows, cols)`` N, a reading without force that is there and not fitted.
        """
        taus = self._taus(causes, start)
        rows, parts = self._rows(causes, taus)
        if constant is not None:
            rows, *parts = [replace(own, constant=constant) for own in (rows, *parts)]
        if rows.curves is not None and len(rows.curves) > 1:
            left = self._left(start, rows)
            rows, *parts = [own.shrunk(left) for own in (rows, *parts)]
        model = Model(self.problem, causes, rows)
        shape = (0 if rows.curves is None else len(rows.curves), *rows.alive.shape)
        zero = np.zeros(shape)
        values = {} if start is None else {n: v for n, v in start.whole.values.items() if n in {c.name for c in causes}}
        local = {c.name for c in causes if c.local is not None}
        values = {n: v for n, v in values.items() if n not in local}
        for item in causes:
            if item.local is None and item.course is None and item.name not in values:
                begun = [c for c in causes if c.name in values or c is item or c.local or c.course]
                values[item.name] = _best_start(Model(self.problem, begun, rows), item, values, zero)
        least = _Squares(model, causes)
        values = least.descend(values, zero)
        for _ in range(ZEROS if len(zero) and not (rows.counting.reads_all and not least.bends) else 0):
            # the zero of the model without it: one that was read beside fewer causes holds what those left
            before = least.energy(values, zero)
            moved = model.zero({**values, **model.solved}, zero)
            trial = least.descend(values, moved)
            after = least.energy(trial, moved)
            if after < before:
                values, zero = trial, moved
            if after > (1 - SETTLED) * before:
                break
        residual, slopes = least.linearised(values, zero)
        solved = {**values, **{n: model.solved[n] for n in local}}
        if len(zero):
            zero = zero + rows.zero_of(rows.measured - rows.read(model.run(solved, zero)))
        effects = {n: e * self.samples for n, e in least.effects(values, zero).items()}
        energy, heldout = self._by_unit(residual), np.zeros(len(self.fold))
        folds = []
        for number, part in enumerate(parts):
            own = _Squares(Model(self.problem, causes, part), causes)
            part_values, left = own.refit(values, zero, residual, slopes)
            mine = self.fold == number
            heldout[mine] = self._by_unit(left)[mine]
            part_zero = zero
            if len(zero):
                read = part.read(own.model.run(part_values, zero))
                part_zero = zero + part.zero_of(part.measured - read)
            folds.append(Part(part_values, part_zero))
        return Fit(tuple(causes), taus, Part(solved, zero), tuple(folds), effects, energy, heldout)

    def linearised(
        self, fit: Fit, constant: FloatArray
    ) -> tuple[Problem, list[tuple[str, int, Free]], FloatArray, FloatArray, FloatArray, FloatArray]:
        """A fit as it is near its values.

        Returns:
            The compared frames; the free numbers with their causes and places; the residual; its slopes
            ``(free, numbers)`` in units of the numbers' scales; ``(free,)`` weights of the priors in these units; and
            the prediction (N).
        """
        rows = replace(self._rows(fit.causes, fit.taus)[0], constant=constant)
        squares = _Squares(Model(self.problem, fit.causes, rows), fit.causes)
        values = {n: v for n, v in fit.whole.values.items() if n in {name for name, _, _ in squares.free}}
        residual, slopes = squares.linearised(values, fit.whole.zero)
        return rows, squares.free, residual, slopes, squares.prior, squares.prediction

    def rows(self, causes: Sequence[Cause], taus: Mapping[str, float]) -> Problem:
        """The compared frames, with the curves that the zero follows beside these causes."""
        return self._rows(causes, taus)[0]

    def _by_unit(self, residual: FloatArray) -> FloatArray:
        square = np.sum(residual.reshape(len(self.unit), -1) ** 2, axis=1)
        known = self.unit >= 0
        return np.bincount(self.unit[known], square[known], len(self.fold)) * self.samples

    def _taus(self, causes: Sequence[Cause], start: Fit | None) -> dict[str, float]:
        """The time constant of each course, the one that leaves least of what `start` leaves."""
        taus: dict[str, float] = {}
        for item in causes:
            if item.course is None:
                continue
            if start is not None and item.name in start.taus:
                taus[item.name] = start.taus[item.name]
            elif len(item.course.taus) == 1:
                taus[item.name] = item.course.taus[0]
            else:
                taus[item.name] = self._best_tau(item, causes, taus, start)
        return taus

    def _best_tau(self, item: Cause, causes: Sequence[Cause], taus: dict[str, float], start: Fit | None) -> float:
        assert item.course is not None
        left = self._left(start, self.problem.compared)
        known = [c for c in causes if c.course is not None and c.name in taus]
        energies = []
        for tau in item.course.taus:
            trial, _ = self._rows([*known, item], {**taus, item.name: tau})
            told = trial.told[:, None, None, None, None]
            energies.append(float(np.sum((trial.weigh(left) * told) ** 2)))
        return item.course.taus[int(np.argmin(energies))]

    def _left(self, start: Fit | None, rows: Problem) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N, what a fit without its zero leaves of the compared frames."""
        if start is None:
            return rows.measured - rows.read(self.problem.at_compared(self.problem.simulated))
        causes = [c for c in start.causes if c.course is None]
        bare = replace(rows, curves=None, constant=0.0)
        return rows.measured - rows.read(Model(self.problem, causes, bare).run(start.whole.values, None))

    def _rows(self, causes: Sequence[Cause], taus: Mapping[str, float]) -> tuple[Problem, list[Problem]]:
        """The compared frames with the curves of the zero, and the same for the complement of each fold."""
        courses = [c for c in sorted(causes, key=lambda c: c.order) if c.course is not None]
        key = tuple((c.name, taus[c.name]) for c in courses)
        if key not in self._shared:
            rows = self.problem.compared
            curves = curves_of(rows, courses, taus)
            rows = replace(rows, curves=curves)
            parts = [
                replace(rows, fitted=(self.unit >= 0) & (self.fold[self.unit] != number))
                for number in range(int(self.fold.max()) + 1)
            ]
            self._shared[key] = rows, parts
        return self._shared[key]


def curves_of(rows: Problem, causes: Sequence[Cause], taus: Mapping[str, float]) -> FloatArray | None:
    """``(curves, T)`` the courses of the causes that have one, in the order of the chain; None if none has."""
    seconds = rows.time - rows.time[0]
    ordered = sorted(causes, key=lambda c: c.order)
    curves = [c.course.curve(seconds, taus[c.name]) for c in ordered if c.course is not None]
    return np.stack(curves) if curves else None


class _Squares:
    """The sum of squares of a model as a function of its causes' numbers."""

    def __init__(self, model: Model, causes: Sequence[Cause]) -> None:
        self.model, self.rows, self.causes = model, model.rows, causes
        shared = [c for c in causes if c.local is None and c.course is None]
        self.free = [(c.name, i, f) for c in shared for i, f in enumerate(c.parameters(model.problem))]
        self.bends = any(c.order > 77 for c in shared)
        spreads = np.array([np.inf if f.spread is None else f.spread for _, _, f in self.free])
        self._held = np.where(np.isfinite(spreads), 1 / spreads, 0.0)
        self.prediction: FloatArray = np.zeros(0)
        self._neutral = np.array([f.neutral for _, _, f in self.free])
        self._scale = np.array([f.scale for _, _, f in self.free])

    @property
    def prior(self) -> FloatArray:
        """``(free,)`` weights of the priors, in units of the scales."""
        return (self._held * self._scale) ** 2

    def residual(self, values: Fitted, zero: FloatArray) -> FloatArray:
        self.prediction = self.model.run(values, zero if len(zero) else None)
        return self.rows.residual(self.prediction).ravel()

    def _used(self, residual: FloatArray) -> FloatArray:
        """The residual of the samples that take part in the fit."""
        if self.rows.fitted is None:
            return residual
        return residual.reshape(len(self.rows.time), -1)[self.rows.fitted].ravel()

    def _away(self, values: Fitted) -> FloatArray:
        """How far the numbers are from what is expected of them, in units of their spread."""
        return self._held * (np.array([values[n][i] for n, i, _ in self.free]) - self._neutral)

    def descend(self, values: Fitted, zero: FloatArray) -> Fitted:
        """The values after Gauss-Newton steps, damped until each leaves less."""
        best, off = self.residual(values, zero), self._away(values)
        energy, damping = float(best @ best + off @ off), 1e-3
        for _ in range(STEPS if self.free else 0):
            slopes = self._slopes(values, len(best))
            normal = slopes @ slopes.T + np.diag(self.prior)
            right = slopes @ best + self._held * self._scale * off
            before = energy
            for _ in range(5):
                ridge = damping * np.diag(np.diag(normal) + 1e-6 * np.trace(normal) + 1e-9)
                trial = self._moved(values, self._step(normal + ridge, right, values))
                try:
                    new = self.residual(trial, zero)
                except ValueError:  # values that are allowed one by one, but not together
                    damping *= 8
                    continue
                away = self._away(trial)
                total = float(new @ new + away @ away)
                if total < energy:
                    values, best, off, energy, damping = trial, new, away, total, damping / 4
                    break
                damping *= 8
            if before - energy < CONVERGED * before:
                break
        return values

    def linearised(self, values: Fitted, zero: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The residual at these values and its slopes, ``(free, numbers)``."""
        residual = self.residual(values, zero)
        return residual, self._slopes(values, len(residual))

    def effects(self, values: Fitted, zero: FloatArray) -> dict[str, float]:
        """By cause that has numbers or an array, the energy of what it does to the residual, after `linearised`."""
        solved, out = self.model.solved, {}
        base = self.rows.read(self.prediction)
        for item in self.causes:
            if item.course is None:
                without = self.rows.read(self.model.run({**values, **solved}, None, begin=item.name, skip=True))
                self.model.solved = solved
                out[item.name] = float(np.sum(self.rows.weigh(base - without) ** 2))
        return out

    def refit(
        self, values: Fitted, zero: FloatArray, residual: FloatArray, slopes: FloatArray
    ) -> tuple[Fitted, FloatArray]:
        """The values that fit the part, and the residual of all frames.

        The part's own residual is brought to its least by steps that use the slopes of the whole fit.
        """
        if not self.free:
            left = self.residual(values, zero)
            return {**values, **self.model.solved}, left
        count = len(self.rows.time)
        assert self.rows.fitted is not None
        slopes = slopes.reshape(len(slopes), count, -1)[:, self.rows.fitted].reshape(len(slopes), -1)
        normal = slopes @ slopes.T + np.diag(self.prior)
        best, left, solved, damping = values, residual, None, 1e-6
        least = self._energy(residual, values)
        for _ in range(REFITS):
            right = slopes @ self._used(left) + self._held * self._scale * self._away(best)
            step = self._step(normal + damping * np.diag(np.diag(normal) + 1e-9), right, best)
            promise = -float(2 * right @ step + step @ normal @ step)
            if solved is not None and promise < UNSETTLED * self.rows.alive.sum():
                break
            trial = self._moved(best, step)
            try:
                new = self.residual(trial, zero)
            except ValueError:  # values that are allowed one by one, but not together
                damping *= 100
                continue
            energy = self._energy(new, trial)
            if energy < least:
                best, left, solved, least = trial, new, self.model.solved, energy
            else:
                damping = max(100 * damping, 1e-3)
        if solved is None:
            left = self.residual(best, zero)
            solved = self.model.solved
        return {**best, **solved}, left

    def energy(self, values: Fitted, zero: FloatArray) -> float:
        """Of the residual at these values, with the priors."""
        return self._energy(self.residual(values, zero), values)

    def _energy(self, residual: FloatArray, values: Fitted) -> float:
        used, off = self._used(residual), self._away(values)
        return float(used @ used + off @ off)

    def _step(self, normal: FloatArray, right: FloatArray, values: Fitted) -> FloatArray:
        """The step to the least of a quadratic within the bounds, in units of the scales.

        A number that would leave its bounds is put on the bound, and the others are solved for again.
        """
        now = np.array([values[n][i] for n, i, _ in self.free])
        low = (np.array([f.low for _, _, f in self.free]) - now) / self._scale
        high = (np.array([f.high for _, _, f in self.free]) - now) / self._scale
        step, moving = np.zeros(len(now)), np.ones(len(now), dtype=bool)
        for _ in range(len(now)):
            rest = right[moving] + normal[np.ix_(moving, ~moving)] @ step[~moving]
            step[moving] = -np.linalg.solve(normal[np.ix_(moving, moving)], rest)
            outside = moving & ((step < low - 1e-9) | (step > high + 1e-9))
            if not outside.any():
                break
            step = np.where(outside, np.clip(step, low, high), step)
            moving &= ~outside
        return step

    def _moved(self, values: Fitted, change: FloatArray) -> Fitted:
        """The values after a step, in units of their scales, within their bounds."""
        moved = {n: v.copy() for n, v in values.items()}
        for (n, i, f), amount in zip(self.free, change, strict=True):
            moved[n][i] = np.clip(moved[n][i] + np.clip(amount, -5, 5) * f.scale, f.low, f.high)
        return moved

    def _slopes(self, values: Fitted, size: int) -> FloatArray:
        """``(free, size)`` by how much the residual changes with each number, in units of its scale."""
        slopes = np.zeros((len(self.free), size))
        shape = self.rows.alive.shape
        counting = self.rows.counting
        steep = 1.0 if counting.reads_all else counting.slope(self.prediction)
        known = {n: v for n, v in values.items()}
        tried: dict[tuple[str, str], FloatArray] = {}

        def effect(name: str, moved: FloatArray) -> FloatArray:
            kept = self.model.solved
            change = self.prediction - self.model.run({**known, name: moved}, None, begin=name)
            self.model.solved = kept
            return self.rows.weigh(change * steep)

        for row, (name, index, about) in enumerate(self.free):
            if about.together:
                key = name, about.together
                if key not in tried:
                    moved = values[name].copy()
                    moved[[i for n, i, f in self.free if (n, f.together) == key]] += PROBE * about.scale
                    tried[key] = effect(name, moved).reshape(-1, *shape) / PROBE
                slopes[row].reshape(-1, *shape)[(slice(None), *about.channel)] = tried[key][(slice(None), *about.channel)]
                continue
            step = PROBE * about.scale
            step = -step if values[name][index] + step > about.high else step
            moved = values[name].copy()
            moved[index] += step
            slopes[row] = effect(name, moved).ravel() * (about.scale / step)
        return slopes


def _best_start(model: Model, item: Cause, values: Fitted, zero: FloatArray) -> FloatArray:
    """The start, taken as far as it helps, with which a cause begins beside `values`."""
    problem, rows = model.problem, model.rows
    free = item.parameters(problem)
    neutral = np.array([f.neutral for f in free])
    if all(f.together for f in free):  # linear in many numbers, which are told apart at once
        return neutral
    low, high = np.array([f.low for f in free]), np.array([f.high for f in free])
    base = rows.residual(model.run({**values, item.name: neutral}, zero if len(zero) else None)).ravel()
    best, least = neutral, float(base @ base)
    counted = np.array([f.material is not None for f in item.free(problem)] + [False] * (item.gauge is not None))
    for start in item.places(problem):
        new = rows.residual(model.run({**values, item.name: start}, None, begin=item.name)).ravel()
        effect = new - base
        share = -float(effect @ base) / max(float(effect @ effect), 1e-12)
        trials = [(start, new)]
        if counted.any():  # along the amount, which the effect is nearly proportional to
            moved = np.where(counted, np.clip(neutral + share * (start - neutral), low, high), start)
            trials.append((moved, rows.residual(model.run({**values, item.name: moved}, None, begin=item.name)).ravel()))
        for trial, left in trials:
            if left @ left < least:
                best, least = trial, float(left @ left)
    return best
