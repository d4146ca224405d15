"""Squares: the sum of squares of a model as a function of its parameters, and its minimisation.

The minimisation takes damped Gauss-Newton steps with the real transforms. `scipy.optimize.least_squares` takes up to 4
times as long here: it cannot exploit that a change of one cause reruns only the later ones, and it decomposes Jacobians
of 100,000 rows where the normal equations of about ten parameters suffice (`benchmarks/fit_speed.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from paxisim.diagnose.causes.kinds import Cause, FittedCause, PerChannelCause, baseline_causes
from paxisim.diagnose.data.problem import FloatArray
from paxisim.diagnose.rules import FITTING
from paxisim.diagnose.scorer.model import ZERO_ORDER, Fitted, Model


class Squares:
    """The sum of squares of a model as a function of its parameters.

    Attributes:
        free: Free parameters as tuples of the cause's name, the index within the cause and the parameter.
        prediction: ``(T, pads, 3, rows, cols)`` N, the prediction of the last call of `residual`.
    """

    def __init__(self, model: Model, causes: Sequence[Cause]) -> None:
        """Collect the free parameters; nothing runs yet."""
        self.model, self.rows, self.causes = model, model.rows, causes
        shared = [c for c in causes if isinstance(c, FittedCause)]
        self._per_channel = [c for c in causes if isinstance(c, PerChannelCause)]
        self.free = [(c.name, i, f) for c in shared for i, f in enumerate(c.parameters(model.problem))]
        self.bends = any(c.order > ZERO_ORDER for c in shared)
        spreads = np.array([np.inf if f.spread is None else f.spread for _, _, f in self.free])
        self._held = np.where(np.isfinite(spreads), 1 / spreads, 0.0)
        self.prediction: FloatArray = np.zeros(0)
        self._kept: FloatArray | None = None  # the Jacobian
        self._whole_step = self.rows.noise.is_steep
        self._neutral = np.array([f.neutral for _, _, f in self.free])
        self._scale = np.array([f.scale for _, _, f in self.free])

    @property
    def prior(self) -> FloatArray:
        """``(free,)`` weights of the priors, in units of the parameters' scales."""
        return np.asarray((self._held * self._scale) ** 2, dtype=np.float64)

    def residual(self, values: Fitted, zero: FloatArray) -> FloatArray:
        """``(residuals,)`` residual at these values, in units of the noise."""
        self.prediction = self.model.run(values, zero)
        return self.rows.residual(self.prediction).ravel()

    def _used(self, residual: FloatArray) -> FloatArray:
        """The residual of the samples that take part in the fit."""
        if self.rows.fitted is None:
            return residual
        return residual.reshape(len(self.rows.time), -1)[self.rows.fitted].ravel()

    def _used_rows(self, slopes: FloatArray) -> FloatArray:
        """The Jacobian of the samples that take part in the fit."""
        if self.rows.fitted is None:
            return slopes
        return slopes.reshape(len(slopes), len(self.rows.time), -1)[:, self.rows.fitted].reshape(len(slopes), -1)

    def _away(self, values: Fitted) -> FloatArray:
        """Deviation of each parameter from its prior mean, in units of the prior's standard deviation."""
        now = np.array([float(values[n][i]) for n, i, _ in self.free])
        return np.asarray(self._held * (now - self._neutral), dtype=np.float64)

    def descend(self, values: Fitted, zero: FloatArray) -> Fitted:
        """The values after Gauss-Newton steps, each damped until it decreases the energy.

        Where the noise rarely reaches the next count, steps with the slope over a whole count come first, because the
        staircase has many local minima. They end near the best one, which its own slope then finds.
        """
        values = self._descended(values, zero)
        if self._whole_step and self.free:
            self._whole_step, self._kept = False, None
            values = self._descended(values, zero)
            self._whole_step, self._kept = True, None
        return values

    def _descended(self, values: Fitted, zero: FloatArray) -> Fitted:
        """The values after steps with one kind of slope.

        The Jacobian is most of the work, so it is reused as long as the decrease is close to the predicted one.
        """
        best, off = self._used(self.residual(values, zero)), self._away(values)
        energy, damping = float(best @ best + off @ off), 1e-3
        for _ in range(FITTING.steps if self.free else 0):
            fresh = self._kept is None
            if self._kept is None:
                self._kept = self._used_rows(self._slopes(values))
            slopes, before = self._kept, energy
            normal = slopes @ slopes.T + np.diag(self.prior)
            right = slopes @ best + self._held * self._scale * off
            promise = 0.0
            for _ in range(FITTING.dampings if fresh else 1):
                ridge = damping * np.diag(np.diag(normal) + 1e-6 * np.trace(normal) + 1e-9)
                step = self._step(normal + ridge, right, values)
                promise = -float(2 * right @ step + step @ normal @ step)
                if promise < FITTING.converged * before:
                    return values
                trial = self._moved(values, step)
                try:
                    new = self._used(self.residual(trial, zero))
                except ValueError:  # each value is allowed, but not the combination
                    damping *= 8
                    continue
                away = self._away(trial)
                total = float(new @ new + away @ away)
                if total < energy:
                    values, best, off, energy, damping = trial, new, away, total, damping / 4
                    break
                damping *= 8
            else:  # the last run used rejected values; restore the model's state
                self.residual(values, zero)
            gained = before - energy
            if fresh and gained < FITTING.converged * before:
                break
            if gained < FITTING.trusted * promise:
                self._kept = None
        return values

    def linearised(self, values: Fitted, zero: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The residual at these values and its ``(free, residuals)`` Jacobian, per unit of each parameter's scale.

        The Jacobian with which a descent to these values ended is near enough.
        """
        residual = self.residual(values, zero)
        known = self._kept is not None and self.rows.fitted is None
        return residual, self._kept if known else self._slopes(values)  # type: ignore[return-value]

    def effects(self, values: Fitted, zero: FloatArray) -> dict[str, float]:
        """Energy of each cause's effect on the residual, or of its zero offset; call `linearised` first.

        Args:
            values: Values by cause.
            zero: ``(curves, pads, 3, rows, cols)`` N, amplitudes of the zero offset's curves.
        """
        solved, out = self.model.solved, {}
        base = self.rows.read(self.prediction)
        for item in self.causes:
            if isinstance(item, (FittedCause, PerChannelCause)):
                without = self.rows.read(self.model.run({**values, **solved}, None, begin=item.name, skip=True))
                self.model.solved = solved
                out[item.name] = float(np.sum(self.rows.weigh(base - without) ** 2))
        for item in baseline_causes(self.causes):
            assert self.rows.curves is not None
            own = self.rows.curves.owned_by(item.name)
            added = np.tensordot(self.rows.curves.values[own].T, zero[own], 1)
            out[item.name] = float(np.sum((added * self.rows.weight) ** 2))
        return out

    def refit(
        self, values: Fitted, zero: FloatArray, residual: FloatArray, slopes: FloatArray
    ) -> tuple[Fitted, FloatArray]:
        """The values fitted to the samples in use, and the residual of all frames.

        The steps minimise the residual of these samples with the Jacobian of the fit to all episodes.
        """
        if not self.free:
            left = self.residual(values, zero)
            return {**values, **self.model.solved}, left
        slopes = self._used_rows(slopes)
        normal = slopes @ slopes.T + np.diag(self.prior)
        best, left, solved, damping = values, residual, None, 1e-6
        least = self._energy(residual, values)
        for _ in range(FITTING.refits):
            right = slopes @ self._used(left) + self._held * self._scale * self._away(best)
            step = self._step(normal + damping * np.diag(np.diag(normal) + 1e-9), right, best)
            promise = -float(2 * right @ step + step @ normal @ step)
            if solved is not None and promise < FITTING.unsettled * self.rows.alive.sum():
                break
            trial = self._moved(best, step)
            try:
                new = self.residual(trial, zero)
            except ValueError:  # each value is allowed, but not the combination
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
        """Sum of squares at these values, including the priors."""
        return self._energy(self.residual(values, zero), values)

    def _energy(self, residual: FloatArray, values: Fitted) -> float:
        used, off = self._used(residual), self._away(values)
        return float(used @ used + off @ off)

    def _step(self, normal: FloatArray, right: FloatArray, values: Fitted) -> FloatArray:
        """The step to the minimum of a quadratic within the bounds, in units of the parameters' scales.

        A parameter that would leave its bounds is set to the bound, and the others are solved for again.
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
        """The values after a step in units of their scales, clipped to their bounds."""
        moved = {n: v.copy() for n, v in values.items()}
        for (n, i, f), amount in zip(self.free, change, strict=True):
            moved[n][i] = np.clip(moved[n][i] + np.clip(amount, -5, 5) * f.scale, f.low, f.high)
        return moved

    def _slopes(self, values: Fitted) -> FloatArray:
        """``(free, residuals)`` derivatives of the residual by each parameter, in units of its scale."""
        slopes = np.zeros((len(self.free), self.rows.measured.size))
        counting = self.rows.noise
        steep = 1.0 if counting.reads_all else counting.slope(self.prediction, self._whole_step)
        known, absorbed = dict(values), None
        if len(self._per_channel) == 1 and self._per_channel[0].absorbed is not None:  # not solved for each parameter
            known |= self.model.solved
            absorbed = self._absorbed(self._per_channel[0], known, steep)

        def effect(name: str, moved: FloatArray) -> FloatArray:
            kept = self.model.solved
            change = self.prediction - self.model.run({**known, name: moved}, None, begin=name)
            self.model.solved = kept
            seen = self.rows.weigh(change * steep)
            return seen if absorbed is None else seen - absorbed(seen)

        for row, (name, index, about) in enumerate(self.free):
            for step in (FITTING.step, -FITTING.step):
                moved = values[name].copy()
                moved[index] += step * about.scale
                if moved[index] <= about.high:
                    with suppress(ValueError):  # each value is allowed, but not the combination
                        slopes[row] = effect(name, moved).ravel() / step
                        break
        return slopes

    def _absorbed(
        self, item: PerChannelCause, known: Fitted, steep: FloatArray | float
    ) -> Callable[[FloatArray], FloatArray]:
        """How much of a change of the residual a cause absorbs, see `PerChannelCause.absorbed`."""
        assert item.absorbed is not None
        name, kept = item.name, self.model.solved
        moved = self.model.run({**known, name: known[name] + FITTING.channel_step}, None, begin=name)
        self.model.solved = kept
        load = self.rows.weigh((moved - self.prediction) * steep / FITTING.channel_step)
        return item.absorbed(self.rows, load, self.rows.residual(self.prediction), known[name])


def best_start(model: Model, item: FittedCause, values: Fitted, zero: FloatArray) -> FloatArray:
    """The best start of a cause beside `values`, also tried at an amplitude scaled by linear least squares."""
    problem, rows = model.problem, model.rows
    free = item.parameters(problem)
    neutral = np.array([f.neutral for f in free])
    low, high = np.array([f.low for f in free]), np.array([f.high for f in free])

    def left(trial: FloatArray, begin: str = item.name) -> FloatArray:
        residual = rows.residual(model.run({**values, item.name: trial}, zero, begin=begin))
        return (residual if rows.fitted is None else residual[rows.fitted]).ravel()

    base = left(neutral, "")
    best, least = neutral, float(base @ base)
    counted = np.array([f.material is not None for f in free])
    for start in item.places(problem):
        new = left(start)
        effect = new - base
        share = -float(effect @ base) / max(float(effect @ effect), 1e-12)
        trials = [(start, new)]
        if counted.any():  # scale the parameters to which the effect is nearly proportional
            moved = np.where(counted, np.clip(neutral + share * (start - neutral), low, high), start)
            trials.append((moved, left(moved)))
        for trial, rest in trials:
            if rest @ rest < least:
                best, least = trial, float(rest @ rest)
    return best
