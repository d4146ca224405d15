"""Ranking: candidates ordered by their linearised held-out gain, computed from least-squares sums.

For each fold, the inner products of all effects with one another and with the residual are kept. From them, any set of
causes is fitted to some folds and tested on the others by solving a small linear system, without access to the data.
The parameters of the causes that the model already has are fitted again with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.causes.kinds import BaselineCause, Cause, FittedCause
from paxisim.diagnose.data.problem import FloatArray
from paxisim.diagnose.rules import FITTING, Rules
from paxisim.diagnose.scorer.fitting import Fit, Fitter
from paxisim.diagnose.scorer.model import Model
from paxisim.parallel import parallel_map


class Ranking:
    """Linearised gains of causes added to a model.

    The gauge of a cause is fitted with it, so that the two are found even if neither gains alone.
    """

    def __init__(self, fitter: Fitter, causes: Sequence[Cause], fit: Fit, rules: Rules) -> None:
        """Compute the sums.

        Args:
            fitter: Fitter with the recording and its folds.
            causes: Candidates; those with starts are ranked.
            fit: Fit of the model.
            rules: Rules of the ranking.
        """
        problem, self._rules = fitter.problem, rules
        self.causes = {c.name: c for c in causes if isinstance(c, FittedCause) and c.name not in fit.names}
        rows = fitter.rows(fit.causes, fit.shapes)
        model = Model(problem, fit.causes, rows)
        prediction = model.run(fit.whole.values, fit.whole.zero)
        moving = [c for c in fit.causes if not isinstance(c, BaselineCause)]
        force = Model(problem, moving, problem).run(fit.whole.values, None)
        stride = max(1, int(rows.samples / FITTING.ranked_values))
        thin = rows.every(stride)
        kept = np.concatenate(rows.sampling.frames(stride))
        unit = fitter.unit[kept]
        fold = np.where(unit >= 0, fitter.fold[unit], -1)
        shape, prediction = prediction.shape, prediction[kept]
        was_read = thin.read(prediction)

        def weighed(change: FloatArray) -> FloatArray:
            change = problem.at_compared(change)[kept]
            read = change if thin.noise.reads_all else thin.read(prediction + change) - was_read
            return thin.weigh(read)

        def through(change: FloatArray) -> FloatArray:
            """Effect of a scene change after the model, in units of the noise."""
            moved = Model(replace(problem, simulated=problem.simulated + change), fit.causes, rows)
            after = moved.run(fit.whole.values, fit.whole.zero)[kept]
            read = after - prediction if thin.noise.reads_all else thin.read(after) - was_read
            return thin.weigh(read)

        squares, _, slopes = fitter.linearised(fit)
        free = squares.free
        values = np.array([float(fit.whole.values[name][i]) for name, i, _ in free])
        moves = np.array([about.low < value < about.high for value, (_, _, about) in zip(values, free, strict=True)])
        columns = [-slope.reshape(shape)[kept] * own for slope, own in zip(slopes, moves, strict=True)]
        owners = [name for name, _, _ in free]

        def seen(item: FittedCause) -> list[FloatArray]:
            see = weighed if item.change is None else through
            return [see(effect) for effect in item.effects(problem, force)]

        for name, own in zip(self.causes, parallel_map(seen, self.causes.values(), fitter.jobs), strict=True):
            columns += own
            owners += [name] * len(own)
        columns.append(weighed(self._rules.gauge_step * force))
        owners.append("")
        self._owner, self._chosen = np.array(owners), np.arange(len(owners)) < len(free)
        away = [(value - about.neutral) / about.scale for value, (_, _, about) in zip(values, free, strict=True)]
        self._prior, self._pull = np.zeros(len(columns)), np.zeros(len(columns))  # weights, and gradients
        self._prior[: len(free)] = fitter.samples * squares.prior * moves
        self._pull[: len(free)] = self._prior[: len(free)] * away
        residual = thin.residual(prediction).reshape(len(kept), -1)
        matrix = np.stack([c.reshape(len(kept), -1) for c in columns])
        count = int(fitter.fold.max()) + 1
        size = len(columns)
        self._products, self._projections = np.zeros((count, size, size)), np.zeros((count, size))
        for number in range(count):
            mine = fold == number
            part, rest = matrix[:, mine].reshape(size, -1), residual[mine].ravel()
            self._products[number], self._projections[number] = part @ part.T, part @ rest
        times = fitter.whole.samples / thin.samples
        self._products *= times
        self._projections *= times

    def gain(self, names: Sequence[str]) -> float:
        """Held-out energy that the causes gain when added to the model.

        A single cause is also tried at each of its starts alone, because several starts together may fit noise. Its
        in-sample gain counts half, because a single fold may be the only one to show it. If the gauge alone would gain
        as much, the cause ranks behind a cause that consists of that gain.
        """
        chosen = self._chosen
        gauged = any(self.causes[n].gauge is not None or self.causes[n].owns_gain for n in names)
        own = np.isin(self._owner, [*names, ""] if gauged else list(names)) | chosen
        sets = [own]
        if len(names) == 1 and (self._owner == names[0]).sum() <= self._rules.single_starts:
            others = own & (self._owner != names[0])
            for column in np.flatnonzero(self._owner == names[0]):
                sets.append(others | (np.arange(len(own)) == column))
        heldout = max(map(self._gain, sets)) - self._gain(chosen)
        promise = max(heldout, self._rules.in_sample * (self._gain(own, False) - self._gain(chosen, False)))
        gauge = self._gain(own & (self._owner == "") | chosen) - self._gain(chosen)
        return promise * (1 - self._rules.gauge_tie) if gauge > (1 - self._rules.gauge_tie) * promise else promise

    def _gain(self, chosen: NDArray[np.bool_], heldout: bool = True) -> float:
        which = np.flatnonzero(chosen)
        if not len(which):
            return 0.0
        products, projections = self._products[:, which[:, None], which], self._projections[:, which]
        total, right = products.sum(axis=0), projections.sum(axis=0)
        ridge = np.diag(1e-6 * np.diag(total) + 1e-9 + self._prior[which])
        right = right - self._pull[which]
        if heldout and len(products) > 1:
            values = np.linalg.solve(total - products + ridge, (right - projections)[..., None])
        else:
            values = np.linalg.solve(total + ridge, right[:, None])[None]
        gains = 2 * projections[:, None] @ values - np.swapaxes(values, 1, 2) @ products @ values
        return float(gains.sum())
