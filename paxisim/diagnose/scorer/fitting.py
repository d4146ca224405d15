"""Fitting: joint fits of several causes, to all episodes and to the complement of each fold.

To compare sets of causes quickly, the fit to a fold's complement starts from the fit to all episodes, reuses its
Jacobian, and minimises its own sum of squares. Reported figures come from `Fitter.exact`: each of its fits starts from
the causes' own starts and never uses the held-out samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paxisim.diagnose.causes.kinds import BaselineCause, Cause, FittedCause, baseline_causes
from paxisim.diagnose.causes.parameters import CausePart
from paxisim.diagnose.data.baseline import Curves
from paxisim.diagnose.data.folds import Folds
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import FITTING
from paxisim.diagnose.scorer.model import Fitted, Model
from paxisim.diagnose.scorer.squares import Squares, best_start
from paxisim.parallel import parallel_map

Shapes = Mapping[str, tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class Part:
    """A fit to the complement of a fold, or to all episodes.

    Attributes:
        values: Fitted values by cause, in the order of its `parameters`, or the array of a local cause.
        zero: ``(curves, pads, 3, rows, cols)`` N, amplitudes of the curves of the zero offset.
        shapes: Shape parameters of each cause of the baseline, by name.
        owners: Name of the cause that each curve belongs to.
    """

    values: Fitted
    zero: FloatArray
    shapes: Shapes
    owners: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Fit:
    """Causes with fitted parameters.

    Attributes:
        causes: The causes.
        whole: The fit to all episodes.
        folds: The fit to the complement of each fold.
        constant: ``(pads, 3, rows, cols)`` N or 0, a known constant offset that was not fitted.
        effects: By cause, the energy of its effect on the reading with the other causes unchanged, in units of the
            noise; for a cause of the baseline, the energy of the offset that it adds.
        energy: ``(units,)`` squared residual of the fit to all episodes, in units of the noise.
        heldout: ``(units,)`` squared residual of each unit when held out, in units of the noise.
    """

    causes: tuple[Cause, ...]
    whole: Part
    folds: tuple[Part, ...]
    constant: FloatArray | float
    effects: Mapping[str, float]
    energy: FloatArray
    heldout: FloatArray

    @property
    def shapes(self) -> Shapes:
        """Shape parameters of the fit to all episodes."""
        return self.whole.shapes

    @property
    def zeros(self) -> dict[str, FloatArray]:
        """``(curves, pads, 3, rows, cols)`` N, the amplitudes of the curves of each cause of the baseline."""
        return {name: self.whole.zero[np.array(self.whole.owners) == name] for name in self.shapes}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the causes."""
        return tuple(item.name for item in self.causes)

    def lacking(self, name: str, part: CausePart, problem: Problem) -> Fit:
        """The same without a part of one of the causes, as a start for a fit without that part."""
        whole = next(item for item in self.causes if item.name == name)
        assert isinstance(whole, FittedCause)
        kept = np.array([about.name not in part.parameters for about in whole.parameters(problem)])
        causes = tuple(whole.lacking(part) if item is whole else item for item in self.causes)
        values = {**self.whole.values, name: self.whole.values[name][kept]}
        return replace(self, causes=causes, whole=replace(self.whole, values=values))


class Fitter:
    """Fits sets of causes to one recording.

    Attributes:
        whole: The recording.
        problem: The recording, thinned to the frames that a fit needs.
        unit: ``(T,)`` unit of each compared frame; -1 in the gaps between blocks.
        fold: ``(units,)`` fold of each unit.
        jobs: Number of processors.
    """

    def __init__(self, problem: Problem, folds: Folds, jobs: int = 1) -> None:
        """Prepare the fits; nothing is fitted yet.

        Args:
            problem: The recording.
            folds: The folds.
            jobs: Number of processors.
        """
        self.whole, self.problem, self.jobs = problem, problem.thinned, jobs
        self.unit = self.problem.at_compared(problem.at_thinned(folds.unit)).astype(np.intp)
        self.fold = folds.fold
        self._shared: dict[tuple[tuple[str, tuple[float, ...]], ...], tuple[Problem, list[Problem]]] = {}

    @cached_property
    def samples(self) -> float:
        """Ratio of all samples to the compared samples; energies are scaled by it."""
        return self.whole.samples / self.problem.compared.samples

    def fit(self, causes: Sequence[Cause], start: Fit | None = None, constant: FloatArray | float = 0.0) -> Fit:
        """Fit causes to all episodes, and to the complement of each fold.

        Args:
            causes: The causes to fit.
            start: Fit to start from; a cause that it lacks starts from the best of its own starts.
            constant: ``(pads, 3, rows, cols)`` N, a known constant offset that is not fitted.
        """
        shapes = self._shapes(causes, start)
        rows, parts = self._for_fit(causes, shapes, start, constant)
        squares = Squares(Model(self.problem, causes, rows), causes)
        values, zero = self._descend(squares, causes, {} if start is None else start.whole.values)
        residual, slopes = squares.linearised(values, zero)
        whole = _part(squares, values, zero, shapes)
        energies = {n: e * self.samples for n, e in squares.effects(values, whole.zero).items()}
        heldout, folds = np.zeros(len(self.fold)), []
        for number, part in enumerate(parts):
            own = Squares(Model(self.problem, causes, part), causes)
            part_values, left = own.refit(values, zero, residual, slopes)
            heldout[self.fold == number] = self._by_unit(left)[self.fold == number]
            folds.append(_part(own, part_values, zero, shapes))
        return Fit(tuple(causes), whole, tuple(folds), constant, energies, self._by_unit(residual), heldout)

    def exact(self, fit: Fit) -> Fit:
        """The fit with its folds refitted from scratch, without any use of the fit to all episodes."""
        heldout = np.zeros(len(self.fold))

        def refit(number: int) -> Part:
            shapes = self._shapes(fit.causes, None, number)
            part = self._for_fit(fit.causes, shapes, None, fit.constant)[1][number]
            own = Squares(Model(self.problem, fit.causes, part), fit.causes)
            values, zero = self._descend(own, fit.causes, {})
            left = own.residual(values, zero)
            heldout[self.fold == number] = self._by_unit(left)[self.fold == number]
            return _part(own, values, zero, shapes)

        folds = parallel_map(refit, range(int(self.fold.max()) + 1), self.jobs)
        return replace(fit, folds=tuple(folds), heldout=heldout)

    def _descend(self, squares: Squares, causes: Sequence[Cause], start: Fitted) -> tuple[Fitted, FloatArray]:
        """The best-fitting values and zero offset."""
        model, rows = squares.model, squares.rows
        zero = np.zeros((0 if rows.curves is None else len(rows.curves), *rows.alive.shape))
        shared = [c for c in causes if isinstance(c, FittedCause)]
        values = {c.name: start[c.name] for c in shared if c.name in start}
        for item in shared:
            if item.name not in values:
                begun = [c for c in causes if c.name in values or c is item or not isinstance(c, FittedCause)]
                values[item.name] = best_start(Model(self.problem, begun, rows), item, values, zero)
        values = squares.descend(values, zero)
        if not len(zero) or (rows.noise.reads_all and not squares.bends):
            return values, zero
        # start the zero offset at 0: an estimate with fewer causes contains the effects of the missing ones
        for _ in range(FITTING.zero_rounds):
            before = squares.energy(values, zero)
            moved = model.zero({**values, **model.solved}, zero)
            trial = squares.descend(values, moved)
            after = squares.energy(trial, moved)
            if after < before:
                values, zero = trial, moved
            if after > (1 - FITTING.settled) * before:
                break
        return values, zero

    def _for_fit(
        self, causes: Sequence[Cause], shapes: Shapes, start: Fit | None, constant: FloatArray | float
    ) -> tuple[Problem, list[Problem]]:
        """The compared frames for a fit to all episodes, and to the complement of each fold."""
        rows, parts = self._rows(causes, shapes)
        if np.any(constant):
            rows, *parts = [replace(own, constant=constant) for own in (rows, *parts)]
        if rows.curves is not None and len(rows.curves) > 1:
            left = self._left(start, rows)
            rows, *parts = [replace(own, curves=own.baseline.shrunk(left)) for own in (rows, *parts)]
        return rows, parts

    def linearised(self, fit: Fit) -> tuple[Squares, FloatArray, FloatArray]:
        """The sum of squares about a fit, the residual there, and its ``(free, residuals)`` Jacobian."""
        rows = replace(self._rows(fit.causes, fit.shapes)[0], constant=fit.constant)
        squares = Squares(Model(self.problem, fit.causes, rows), fit.causes)
        values = {n: v for n, v in fit.whole.values.items() if n in {name for name, _, _ in squares.free}}
        return squares, *squares.linearised(values, fit.whole.zero)

    def rows(self, causes: Sequence[Cause], shapes: Shapes) -> Problem:
        """The compared frames, with the zero-offset curves of these causes."""
        return self._rows(causes, shapes)[0]

    def _by_unit(self, residual: FloatArray) -> FloatArray:
        square = np.sum(residual.reshape(len(self.unit), -1) ** 2, axis=1)
        known = self.unit >= 0
        return np.bincount(self.unit[known], square[known], len(self.fold)) * self.samples

    def _shapes(self, causes: Sequence[Cause], start: Fit | None, fold: int | None = None) -> Shapes:
        """Shape parameters of each cause of the baseline; those of `start` are kept if it has the same ones."""
        wanted = baseline_causes(causes)
        if start is not None and start.shapes.keys() == {c.name for c in wanted}:
            return dict(start.shapes)
        shapes: dict[str, tuple[float, ...]] = {}
        for item in wanted:
            tried = item.shapes
            shapes[item.name] = tried[0] if len(tried) == 1 else self._best_shape(item, causes, shapes, start, fold)
        return shapes

    def _best_shape(
        self, item: BaselineCause, causes: Sequence[Cause], shapes: Shapes, start: Fit | None, fold: int | None
    ) -> tuple[float, ...]:
        """The shape with which each episode's zero offset is best predicted from the other episodes."""
        left = self._left(start, self.problem.compared)
        known = [c for c in causes if isinstance(c, BaselineCause) and c.name in shapes]
        rows, parts = self._rows(known, shapes)
        own = rows if fold is None else parts[fold]
        means, squares = own.baseline.means(left), []
        for shape in item.shapes:
            tried = with_curves(own, [*known, item], {**shapes, item.name: shape}).curves
            assert tried is not None
            basis = own.baseline.means(tried.values.T)
            hat = basis @ np.linalg.pinv(basis)
            leverage = np.minimum(np.diag(hat), 1 - 1e-3)[:, None, None, None, None]
            apart = (means - np.tensordot(hat, means, 1)) / (1 - leverage)
            squares.append(float(np.sum(apart**2, where=rows.alive)))
        as_good = np.array(squares) <= (1 + 1e-6) * min(squares)  # with a constant, many shapes are equivalent
        return item.shapes[int(np.argmax(as_good))]

    def _left(self, start: Fit | None, rows: Problem) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N, residual of a fit on the compared frames, without its zero offset."""
        if start is None:
            return rows.measured - rows.read(self.problem.at_compared(self.problem.simulated))
        causes = [c for c in start.causes if not isinstance(c, BaselineCause)]
        bare = replace(rows, curves=None, constant=0.0)
        return rows.measured - rows.read(Model(self.problem, causes, bare).run(start.whole.values, None))

    def _rows(self, causes: Sequence[Cause], shapes: Shapes) -> tuple[Problem, list[Problem]]:
        """The compared frames with the zero-offset curves, and the same for the complement of each fold."""
        key = tuple((c.name, shapes[c.name]) for c in baseline_causes(causes))
        if key not in self._shared:
            rows = self.problem.compared
            rows = with_curves(rows, causes, shapes)
            parts = [
                replace(rows, fitted=(self.unit >= 0) & (self.fold[self.unit] != number))
                for number in range(int(self.fold.max()) + 1)
            ]
            self._shared[key] = rows, parts
        return self._shared[key]


def _part(squares: Squares, values: Fitted, zero: FloatArray, shapes: Shapes) -> Part:
    """The fit, with the arrays of local causes and the zero offset updated from the residual."""
    rows, model = squares.rows, squares.model
    read = rows.read(model.run(values, zero))
    solved = {**values, **model.solved}
    zero = zero + rows.baseline.fit(rows.measured - read) if len(zero) else zero
    return Part(solved, zero, shapes, () if rows.curves is None else rows.curves.owners)


def with_curves(rows: Problem, causes: Sequence[Cause], shapes: Shapes) -> Problem:
    """The problem with the curves of the causes of the baseline, in chain order."""
    curves = {c.name: c.curves(rows, shapes[c.name]) for c in baseline_causes(causes)}
    if not curves:
        return replace(rows, curves=None)
    owners = tuple(name for name, own in curves.items() for _ in own)
    return replace(rows, curves=Curves(np.concatenate(list(curves.values())), owners))
