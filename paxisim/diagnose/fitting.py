"""Fitting: several causes at once, to all episodes and to all but each fold.

While sets of causes are compared, the fit without a fold begins with the fit to all episodes, uses its slopes, and is
brought to the least of its own squares. Figures that are reported come from `Fitter.exact`: each fold's fit begins with
the causes' own starts and never meets the samples that judge it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paxisim.diagnose.cause import Cause, Free, courses_of
from paxisim.diagnose.folds import Folds
from paxisim.diagnose.model import Fitted, Model
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.squares import Squares, best_start

Shapes = Mapping[str, tuple[float, ...]]

ZEROS = 4  # times that the zero and the other numbers are fitted in turns, at most
SETTLED = 2e-3  # of the energy, below which a turn is the last


@dataclass(frozen=True, eq=False)
class Part:
    """A fit to the episodes of a fold's complement, or to all.

    Attributes:
        values: By cause, in the order of its `parameters`; the arrays of local causes.
        zero: ``(curves, pads, 3, rows, cols)`` N.
        shapes: Numbers of the shape of each cause that has a course, by name.
        owners: Names of the causes that the curves belong to.
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
        folds: Those to all but each fold.
        constant: ``(pads, 3, rows, cols)`` N or 0, a reading without force that is there and was not fitted.
        effects: By cause, the energy of what it does to the reading, in units of the noise, the others as they are; of
            a course, of what it adds.
        energy: ``(units,)`` squared residual, in units of the noise, of the whole fit.
        heldout: ``(units,)`` the same of units that took no part in the fit.
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
        """Of the fit to all episodes."""
        return self.whole.shapes

    @property
    def zeros(self) -> dict[str, FloatArray]:
        """``(curves, pads, 3, rows, cols)`` N, the amounts of each course, by cause."""
        return {name: self.whole.zero[np.array(self.whole.owners) == name] for name in self.shapes}

    @property
    def names(self) -> tuple[str, ...]:
        """Of the causes."""
        return tuple(item.name for item in self.causes)


class Fitter:
    """Fits sets of causes to one recording.

    Attributes:
        whole: The recording.
        problem: The same, thinned to the frames that are needed.
        unit: ``(T,)`` of the compared frames, the unit that each belongs to; -1 for the gaps between blocks.
        fold: ``(units,)`` the fold of each unit.
    """

    def __init__(self, problem: Problem, folds: Folds) -> None:
        """Nothing is fitted yet.

        Args:
            problem: The recording.
            folds: What is held out together.
        """
        self.whole, self.problem = problem, problem.thinned
        self.unit = self.problem.at_compared(problem.at_thinned(folds.unit)).astype(np.intp)
        self.fold = folds.fold
        self._shared: dict[tuple[tuple[str, tuple[float, ...]], ...], tuple[Problem, list[Problem]]] = {}

    @cached_property
    def samples(self) -> float:
        """Numbers in the recording over those that are compared: what energies are multiplied by."""
        return self.whole.samples / self.problem.compared.samples

    def fit(self, causes: Sequence[Cause], start: Fit | None = None, constant: FloatArray | float = 0.0) -> Fit:
        """Fit causes to all episodes, and to all but each fold.

        Args:
            causes: What to fit.
            start: A fit to begin with; a cause that is not in it begins with its best start.
            constant: ``(pads, 3, rows, cols)`` N, a reading without force that is there and not fitted.
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
        """A fit whose folds are fitted without anything of the fit to all episodes."""
        heldout, folds = np.zeros(len(self.fold)), []
        for number in range(int(self.fold.max()) + 1):
            shapes = self._shapes(fit.causes, None, number)
            part = self._for_fit(fit.causes, shapes, None, fit.constant)[1][number]
            own = Squares(Model(self.problem, fit.causes, part), fit.causes)
            values, zero = self._descend(own, fit.causes, {})
            left = own.residual(values, zero)
            heldout[self.fold == number] = self._by_unit(left)[self.fold == number]
            folds.append(_part(own, values, zero, shapes))
        return replace(fit, folds=tuple(folds), heldout=heldout)

    def _descend(self, squares: Squares, causes: Sequence[Cause], start: Fitted) -> tuple[Fitted, FloatArray]:
        """The values and the zero that fit best."""
        model, rows = squares.model, squares.rows
        zero = np.zeros((0 if rows.curves is None else len(rows.curves), *rows.alive.shape))
        shared = [c for c in causes if c.local is None and c.course is None]
        values = {c.name: start[c.name] for c in shared if c.name in start}
        for item in shared:
            if item.name not in values:
                begun = [c for c in causes if c.name in values or c is item or c.local or c.course]
                values[item.name] = best_start(Model(self.problem, begun, rows), item, values, zero)
        values = squares.descend(values, zero)
        if not len(zero) or (rows.counting.reads_all and not squares.bends):
            return values, zero
        # the zero begins at 0: one that was read beside fewer causes holds what those left
        for _ in range(ZEROS):
            before = squares.energy(values, zero)
            moved = model.zero({**values, **model.solved}, zero)
            trial = squares.descend(values, moved)
            after = squares.energy(trial, moved)
            if after < before:
                values, zero = trial, moved
            if after > (1 - SETTLED) * before:
                break
        return values, zero

    def _for_fit(
        self, causes: Sequence[Cause], shapes: Shapes, start: Fit | None, constant: FloatArray | float
    ) -> tuple[Problem, list[Problem]]:
        """The compared frames for a fit to all episodes, and to all but each fold."""
        rows, parts = self._rows(causes, shapes)
        if np.any(constant):
            rows, *parts = [replace(own, constant=constant) for own in (rows, *parts)]
        if rows.curves is not None and len(rows.curves) > 1:
            left = self._left(start, rows)
            rows, *parts = [own.shrunk(left) for own in (rows, *parts)]
        return rows, parts

    def linearised(
        self, fit: Fit
    ) -> tuple[Problem, list[tuple[str, int, Free]], FloatArray, FloatArray, FloatArray, FloatArray]:
        """A fit as it is near its values.

        Returns:
            The compared frames; the free numbers with their causes and places; the residual; its slopes
            ``(free, numbers)`` in units of the numbers' scales; ``(free,)`` weights of the priors in these units; and
            the prediction (N).
        """
        rows = replace(self._rows(fit.causes, fit.shapes)[0], constant=fit.constant)
        squares = Squares(Model(self.problem, fit.causes, rows), fit.causes)
        values = {n: v for n, v in fit.whole.values.items() if n in {name for name, _, _ in squares.free}}
        residual, slopes = squares.linearised(values, fit.whole.zero)
        return rows, squares.free, residual, slopes, squares.prior, squares.prediction

    def rows(self, causes: Sequence[Cause], shapes: Shapes) -> Problem:
        """The compared frames, with the curves that the zero follows beside these causes."""
        return self._rows(causes, shapes)[0]

    def _by_unit(self, residual: FloatArray) -> FloatArray:
        square = np.sum(residual.reshape(len(self.unit), -1) ** 2, axis=1)
        known = self.unit >= 0
        return np.bincount(self.unit[known], square[known], len(self.fold)) * self.samples

    def _shapes(self, causes: Sequence[Cause], start: Fit | None, fold: int | None = None) -> Shapes:
        """The numbers of each course's shape; those of `start` are kept if it has the same courses."""
        wanted = courses_of(causes)
        if start is not None and start.shapes.keys() == {c.name for c in wanted}:
            return dict(start.shapes)
        shapes: dict[str, tuple[float, ...]] = {}
        for item in wanted:
            assert item.course is not None
            tried = item.course.shapes
            shapes[item.name] = tried[0] if len(tried) == 1 else self._best_shape(item, causes, shapes, start, fold)
        return shapes

    def _best_shape(
        self, item: Cause, causes: Sequence[Cause], shapes: Shapes, start: Fit | None, fold: int | None
    ) -> tuple[float, ...]:
        """The shape with which each episode's zero is predicted best by those of the others."""
        assert item.course is not None
        left = self._left(start, self.problem.compared)
        known = [c for c in causes if c.course is not None and c.name in shapes]
        rows, parts = self._rows(known, shapes)
        own = rows if fold is None else parts[fold]
        means, squares = own.means_where_told(left), []
        for shape in item.course.shapes:
            tried = with_curves(own, [*known, item], {**shapes, item.name: shape}).curves
            assert tried is not None
            basis = own.means_where_told(tried.T)
            hat = basis @ np.linalg.pinv(basis)
            leverage = np.minimum(np.diag(hat), 1 - 1e-3)[:, None, None, None, None]
            apart = (means - np.tensordot(hat, means, 1)) / (1 - leverage)
            squares.append(float(np.sum(apart**2, where=rows.alive)))
        as_good = np.array(squares) <= (1 + 1e-6) * min(squares)  # beside a constant many shapes are one
        return item.course.shapes[int(np.argmax(as_good))]

    def _left(self, start: Fit | None, rows: Problem) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N, what a fit without its zero leaves of the compared frames."""
        if start is None:
            return rows.measured - rows.read(self.problem.at_compared(self.problem.simulated))
        causes = [c for c in start.causes if c.course is None]
        bare = replace(rows, curves=None, constant=0.0)
        return rows.measured - rows.read(Model(self.problem, causes, bare).run(start.whole.values, None))

    def _rows(self, causes: Sequence[Cause], shapes: Shapes) -> tuple[Problem, list[Problem]]:
        """The compared frames with the curves of the zero, and the same for the complement of each fold."""
        key = tuple((c.name, shapes[c.name]) for c in courses_of(causes))
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
    """The values with the arrays of local causes, and the zero with what the residual still says of it."""
    rows, model = squares.rows, squares.model
    read = rows.read(model.run(values, zero))
    solved = {**values, **model.solved}
    zero = zero + rows.zero_of(rows.measured - read) if len(zero) else zero
    return Part(solved, zero, shapes, rows.owners)


def with_curves(rows: Problem, causes: Sequence[Cause], shapes: Shapes) -> Problem:
    """The problem with the curves of the causes that have some, in the order of the chain."""
    curves = {c.name: c.course.curves(rows, shapes[c.name]) for c in courses_of(causes) if c.course is not None}
    if not curves:
        return replace(rows, curves=None, owners=())
    owners = tuple(name for name, own in curves.items() for _ in own)
    return replace(rows, curves=np.concatenate(list(curves.values())), owners=owners)
