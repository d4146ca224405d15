"""Model: causes in the order of the chain, run on the simulated stream to give what the sensor reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.chain import Chain
from paxisim.augment.transform import STAGES, Transform
from paxisim.diagnose.cause import Cause
from paxisim.diagnose.problem import FloatArray, Problem

ZERO_ORDER = 76.5
"""Place in the chain at which the zero is added: where `offset` and `drift` are."""

ROUNDING = 1e-6  # of an energy: two that differ by less are the same
TURNS = 3  # Gauss-Newton steps for a zero that the sensor does not read as it is
GRID = sorted(np.linspace(-1.0, 1.0, 13), key=abs)  # steps of the sensor, in which a zero is first looked for
LEAST_CHORD, MOST_CHORD = 0.05, 0.2  # of a step, over which the slope of the mean reading is taken
NOISE_CHORD = 1.5  # times the noise before rounding, which that is otherwise

Fitted = Mapping[str, FloatArray]


class Model:
    """Causes one after another.

    Frames that only memory needs are dropped as soon as no cause with a memory follows. What went into each cause is
    kept, so that a change of one runs only what follows it.

    Attributes:
        problem: The frames that the causes are run on.
        rows: The frames that are compared.
    """

    def __init__(self, problem: Problem, causes: Sequence[Cause], rows: Problem | None = None) -> None:
        """Nothing is run yet."""
        self.problem = problem
        self.rows = rows or problem.compared
        fitted = sorted((c for c in causes if c.course is None), key=lambda c: c.order)
        front = [c for c in fitted if c.order < ZERO_ORDER]
        self._stages: list[Cause | None] = [*front, None, *fitted[len(front) :]]  # None: the zero is added
        self._at = {stage.name: number for number, stage in enumerate(self._stages) if stage is not None}
        self._dropped = 0
        for number, stage in enumerate(self._stages):
            if stage is not None and stage.local is None and stage.has_memory(problem):
                self._dropped = number + 1
        # where memories are run on many frames, numbers of 4 bytes take half the time
        self._simulated = problem.simulated.astype(np.float32) if self._dropped else problem.simulated
        self._into: list[NDArray[np.floating]] = []
        self._zero: FloatArray | float = 0.0
        self.solved: Fitted = {}

    def run(self, values: Fitted, zero: FloatArray | None, begin: str = "", skip: bool = False) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` newtons of the compared frames, before counting.

        Arrays of local causes that `values` lacks are solved for, and are in `solved` afterwards.

        Args:
            values: By cause.
            zero: ``(curves, pads, 3, rows, cols)`` N, amounts of the curves of the problem's zero; None or none of them
                where it has none.
            begin: The only cause whose values have changed since all were run; empty to run all.
            skip: Whether that cause is left out.
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
            if stage.local is not None:
                if stage.name in values:
                    solved[stage.name] = values[stage.name]
                else:
                    solved[stage.name] = self._solve(stage, number, x, values, solved.get(stage.name))
                x = self.rows.run(stage.transform(solved[stage.name], self.rows), x)
                continue
            own = self.rows if number >= self._dropped else self.problem
            x = stage.on(x, values[stage.name], self.problem, own)
        self.solved = solved
        return self._compared(x)

    def _compared(self, x: NDArray[np.floating]) -> FloatArray:
        """What is left of the frames once no memory needs the others."""
        x = x if len(x) == len(self.rows.time) else self.problem.at_compared(x)
        return x.astype(np.float64, copy=False)

    def _solve(self, stage: Cause, number: int, x: FloatArray, values: Fitted, near: FloatArray | None) -> FloatArray:
        assert stage.local is not None

        def read(force: FloatArray) -> FloatArray:
            return self.rows.read(self._behind(number + 1, force, values))

        return stage.local.solve(self.rows, x, read, near)

    def _behind(self, first: int, force: FloatArray, values: Fitted) -> FloatArray:
        """What the stages from one on make of a force; local ones are passed over, as their arrays are not known."""
        for stage in self._stages[first:]:
            if stage is None:
                force = force + self._zero
            elif stage.local is None:
                force = stage.on(force, values[stage.name], self.problem, self.rows)
        return force

    def zero(self, values: Fitted, start: FloatArray) -> FloatArray:
        """``(curves, pads, 3, rows, cols)`` the zero that fits best after `run`, given one to begin with.

        Where counting hides a zero, the constant is first looked for on a grid; then follow Gauss-Newton steps with the
        slopes of the mean reading.
        """
        rows, place = self.rows.at_told, self._stages.index(None)
        assert rows.curves is not None
        force = self._into[place][self.rows.told]
        if place + 1 == len(self._stages) and rows.counting.reads_all:
            return start + rows.zero_of(rows.measured - force - _over_time(rows, start))

        def read(zero: FloatArray, shift: float = 0.0) -> FloatArray:
            x = force + (_over_time(rows, zero) + shift)
            for stage in self._stages[place + 1 :]:
                assert stage is not None
                x = rows.run(stage.transform(values[stage.name], self.problem), x)
            return rows.read(x)

        square = rows.weight**2
        searched = rows.counting.is_steep and np.ptp(rows.curves[0]) == 0
        zero = _from_grid(rows, read, start, square) if searched else start
        step = rows.step or 4 * rows.dither or float(np.median(rows.sigma[:, rows.alive]))
        chord = np.clip(NOISE_CHORD * rows.dither, LEAST_CHORD * step, MOST_CHORD * step)
        most = step / np.maximum(np.abs(rows.curves).max(axis=1), 1.0)[:, None, None, None, None]
        best, least = zero, np.full(zero.shape[1:], np.inf)
        for turn in range(TURNS + 1):
            miss = rows.measured - read(zero)
            left = np.einsum("t...,t...->...", square, miss**2)
            best, least = np.where(left < least, zero, best), np.minimum(left, least)
            if turn < TURNS:
                slope = (read(zero, chord) - read(zero, -chord)) / (2 * chord)
                zero = rows.drawn(zero + np.clip(_amounts(rows.curves, square, slope, miss), -most, most))
        return best


def _over_time(rows: Problem, zero: FloatArray) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` newtons."""
    assert rows.curves is not None
    return np.tensordot(rows.curves.T, zero, 1) + rows.constant


def _from_grid(rows: Problem, read, start: FloatArray, square: FloatArray) -> FloatArray:
    """`start` with the constant of each channel moved to where the least is left."""
    best, least = start, np.full(start.shape[1:], np.inf)
    for share in GRID:
        moved = start.copy()
        moved[0] += share * rows.step
        left = np.einsum("t...,t...->...", square, (rows.measured - read(moved)) ** 2)
        better = left < (1 - ROUNDING) * least
        best, least = np.where(better, moved, best), np.where(better, left, least)
    return best


def _amounts(curves: FloatArray, square: FloatArray, slope: FloatArray, miss: FloatArray) -> FloatArray:
    """``(curves, pads, 3, rows, cols)`` by how much to move a zero so that a miss goes away."""
    count, shape = len(curves), miss.shape[1:]
    flat = (square * slope**2).reshape(len(miss), -1)
    normal = np.einsum("it,jt,tc->cij", curves, curves, flat, optimize=True)
    right = np.einsum("it,tc->ci", curves, (square * slope * miss).reshape(len(miss), -1))
    ridge = 1e-6 * np.trace(normal, axis1=1, axis2=2)[:, None, None] / count + 1.0  # 1/N^2, where nothing is told
    return np.linalg.solve(normal + ridge * np.eye(count), right[..., None])[..., 0].T.reshape(count, *shape)


def in_order(members: Sequence[tuple[str, Transform]]) -> Chain:
    """The named transforms as a chain; one that an earlier stage is expected of is wrapped, as that is meant."""
    stage, chained = 0, []
    for _, member in members:
        own = STAGES.index(member.stage)
        chained.append(Chain([member]) if own < stage else member)
        stage = max(stage, own)
    return Chain(chained, [name for name, _ in members])
