"""Model: the causes in chain order, applied to the simulated stream to predict the sensor's reading."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.chain import Chain
from paxisim.augment.transform import STAGES, Transform
from paxisim.diagnose.causes.kinds import Cause, FittedCause, PerChannelCause
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import FITTING

ZERO_ORDER = 76.5
"""Position in the chain at which the zero offset is added, which is that of `offset` and `drift`."""

ROUNDING = 1e-6  # relative difference below which two energies are equal
ZERO_GRID = sorted(np.linspace(-1.0, 1.0, 13), key=abs)  # quantisation steps; initial candidates for a zero offset

Fitted = Mapping[str, FloatArray]


class Model:
    """A chain of causes.

    Frames that only memory effects need are dropped once no cause with memory follows. The input of each cause is kept,
    so that after a change of one cause only the later ones run again.

    Attributes:
        problem: The frames that the causes run on.
        rows: The frames that are compared.
    """

    def __init__(self, problem: Problem, causes: Sequence[Cause], rows: Problem | None = None) -> None:
        """Build the chain; nothing runs yet."""
        self.problem = problem
        self.rows = rows or problem.compared
        stages = [c for c in causes if isinstance(c, (FittedCause, PerChannelCause))]
        stages.sort(key=lambda c: c.order)
        front = [c for c in stages if c.order < ZERO_ORDER]
        # None: the zero offset is added
        self._stages: list[FittedCause | PerChannelCause | None] = [*front, None, *stages[len(front) :]]
        self._at = {stage.name: number for number, stage in enumerate(self._stages) if stage is not None}
        self._dropped = 0
        for number, stage in enumerate(self._stages):
            if stage is not None and stage.has_memory(problem):
                self._dropped = number + 1
        # memory effects run on many frames; single precision halves their time
        self._simulated = problem.simulated.astype(np.float32) if self._dropped else problem.simulated
        self._into: list[NDArray[np.floating]] = []
        self._zero: FloatArray | float = 0.0
        self._last: tuple[NDArray[np.floating] | None, NDArray[np.floating] | None] = None, None  # a force, its basis
        self.solved: Fitted = {}

    def run(self, values: Fitted, zero: FloatArray | None, begin: str = "", skip: bool = False) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` newtons of the compared frames, before counting.

        Arrays of local causes that are missing in `values` are solved for and stored in `solved`.

        Args:
            values: Values by cause.
            zero: ``(curves, pads, 3, rows, cols)`` N, amplitudes of the problem's zero-offset curves; None or empty if
                it has no curves.
            begin: The only cause whose values changed since the last full run; empty to run all causes.
            skip: Whether to leave that cause out.
        """
        first = self._at[begin] if begin else 0
        if not begin:
            self._into = [self._simulated] * len(self._stages)
            self._zero = _over_time(self.rows, zero) if zero is not None and len(zero) else self.rows.constant
        return self._from(first, self._into[first], values, keep=not begin, skip=first if skip else -1)

    def _from(self, first: int, x: NDArray[np.floating], values: Fitted, keep: bool, skip: int = -1) -> FloatArray:
        solved = dict(self.solved) if not keep else {}
        for number in range(first, len(self._stages)):
            if number == self._dropped:
                x = self._compared(x)
            if keep:
                self._into[number] = x
            stage = self._stages[number]
            if number == skip:
                continue
            if stage is None:
                x = x + self._zero
                continue
            if isinstance(stage, PerChannelCause):
                if stage.name in values:
                    solved[stage.name] = values[stage.name]
                else:
                    solved[stage.name] = self._solve(stage, number, x, values, solved.get(stage.name))
                x = self.rows.run(stage.make(solved[stage.name], self.rows), x)
                continue
            x = self._applied(stage, number, x, values[stage.name])
        self.solved = solved
        return self._compared(x)

    def _applied(
        self, stage: FittedCause, number: int, x: NDArray[np.floating], values: FloatArray
    ) -> NDArray[np.floating]:
        """Apply a cause; where it is the last with memory, a known basis is combined at the compared frames only."""
        if stage.basis is None or number + 1 != self._dropped:
            return stage.on(x, values, self.problem, self.rows if number >= self._dropped else self.problem)
        own, key = x is self._simulated, (stage.name, len(self.rows.time))
        before, basis = (x, self.problem.bases.get(key)) if own else self._last
        if before is not x:  # a force that may not come again
            self._last = x, None
            return stage.on(x, values, self.problem, self.problem)
        if basis is None:
            basis = np.stack([self._at_rows(effect) for effect in stage.basis(self.problem, x)])
            self._last = x, basis
            if own:
                self.problem.bases[key] = basis
        return stage.combined(self._at_rows(x), basis, values, self.problem)

    def _at_rows(self, x: NDArray[np.floating]) -> NDArray[np.floating]:
        """The compared frames of `x`."""
        return x if len(x) == len(self.rows.time) else self.problem.at_compared(x)

    def _compared(self, x: NDArray[np.floating]) -> FloatArray:
        """The compared frames of `x`, in double precision."""
        return self._at_rows(x).astype(np.float64, copy=False)

    def _solve(
        self, stage: PerChannelCause, number: int, x: FloatArray, values: Fitted, near: FloatArray | None
    ) -> FloatArray:
        def read(force: FloatArray) -> FloatArray:
            return self.rows.read(self._behind(number + 1, force, values))

        return stage.solve(self.rows, x, read, near)

    def _behind(self, first: int, force: FloatArray, values: Fitted) -> FloatArray:
        """Apply the stages from `first` on to a force, except local causes, whose arrays are not known yet."""
        for stage in self._stages[first:]:
            if stage is None:
                force = force + self._zero
            elif isinstance(stage, FittedCause):
                force = stage.on(force, values[stage.name], self.problem, self.rows)
        return force

    def zero(self, values: Fitted, start: FloatArray) -> FloatArray:
        """``(curves, pads, 3, rows, cols)`` best-fitting zero offset (N) after `run`, given a starting value.

        If quantisation hides an offset, the constant is first searched on a grid. Gauss-Newton steps with the slopes of
        the mean reading follow.
        """
        rows, place = self.rows.at_baseline, self._stages.index(None)
        assert rows.curves is not None
        force = self._into[place][self.rows.baseline.samples]
        if place + 1 == len(self._stages) and rows.noise.reads_all:
            return start + rows.baseline.fit(rows.measured - force - _over_time(rows, start))

        def read(zero: FloatArray, shift: float = 0.0) -> FloatArray:
            x = force + (_over_time(rows, zero) + shift)
            for stage in self._stages[place + 1 :]:
                assert isinstance(stage, FittedCause)
                x = rows.run(stage.transform(values[stage.name], self.problem), x)
            return rows.read(x)

        square = rows.weight**2
        searched = rows.noise.is_steep and rows.curves.constant[0]
        zero = _from_grid(rows, read, start, square) if searched else start
        step = rows.noise.step or 4 * rows.noise.dither or float(np.median(rows.noise.sigma[:, rows.alive]))
        chord = np.clip(FITTING.chord * rows.noise.dither, FITTING.chords[0] * step, FITTING.chords[1] * step)
        most = step / np.maximum(np.abs(rows.curves.values).max(axis=1), 1.0)[:, None, None, None, None]
        best, least = zero, np.full(zero.shape[1:], np.inf)
        for turn in range(FITTING.zero_steps + 1):
            miss = rows.measured - read(zero)
            left = np.einsum("t...,t...->...", square, miss**2)
            best, least = np.where(left < least, zero, best), np.minimum(left, least)
            if turn < FITTING.zero_steps:
                slope = (read(zero, chord) - read(zero, -chord)) / (2 * chord)
                zero = rows.baseline.drawn(
                    zero + np.clip(_amounts(rows.curves.values, square, slope, miss), -most, most)
                )
        return best


def _over_time(rows: Problem, zero: FloatArray) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` newtons, zero offset of each sample."""
    assert rows.curves is not None
    return rows.curves.over_time(zero) + rows.constant


def _from_grid(rows: Problem, read, start: FloatArray, square: FloatArray) -> FloatArray:
    """`start` with the constant of each channel moved to the grid point with the smallest residual."""
    best, least = start, np.full(start.shape[1:], np.inf)
    for share in ZERO_GRID:
        moved = start.copy()
        moved[0] += share * rows.noise.step
        left = np.einsum("t...,t...->...", square, (rows.measured - read(moved)) ** 2)
        better = left < (1 - ROUNDING) * least
        best, least = np.where(better, moved, best), np.where(better, left, least)
    return best


def _amounts(curves: FloatArray, square: FloatArray, slope: FloatArray, miss: FloatArray) -> FloatArray:
    """``(curves, pads, 3, rows, cols)`` Gauss-Newton step (N) of a zero offset for the residual `miss`."""
    count, shape = len(curves), miss.shape[1:]
    flat = (square * slope**2).reshape(len(miss), -1)
    normal = np.einsum("it,jt,tc->cij", curves, curves, flat, optimize=True)
    right = np.einsum("it,tc->ci", curves, (square * slope * miss).reshape(len(miss), -1))
    ridge = 1e-6 * np.trace(normal, axis1=1, axis2=2)[:, None, None] / count + 1.0  # 1/N^2, where data are lacking
    return np.linalg.solve(normal + ridge * np.eye(count), right[..., None])[..., 0].T.reshape(count, *shape)


def in_order(members: Sequence[tuple[str, Transform]]) -> Chain:
    """The named transforms as a chain; one of an earlier stage than its predecessors is wrapped to keep its place."""
    stage, chained = 0, []
    for _, member in members:
        own = STAGES.index(member.stage)
        chained.append(Chain([member]) if own < stage else member)
        stage = max(stage, own)
    return Chain(chained, [name for name, _ in members])
