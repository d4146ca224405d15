"""Kinds: what a cause is. There are four kinds, by how their parameters are found.

`FittedCause`
    A transform of the simulated force, or a change of the simulated scene, with a few parameters.
`PerChannelCause`
    A transform with a parameter for each taxel or channel, found in closed form.
`BaselineCause`
    A zero offset that follows curves over time, whatever the force.
`DetectedCause`
    A fault that a check finds in the streams before anything is fitted.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from paxisim import augment
from paxisim.augment.transform import STAGES, Transform
from paxisim.diagnose.causes.parameters import CausePart, Derived, Free, Gauge, Values
from paxisim.diagnose.data.problem import FloatArray, Problem

AXES = "xyz"
PICTURES = (
    "axes", "channel_curves", "closing", "covariate", "curves", "edges", "gains", "height_map", "holds", "kernel",
    "loops", "mapping", "mount", "plain", "shift", "silent_map", "slip", "small_forces", "steps", "taxel_map", "zero",
    "zero_in_time",
)  # fmt: skip
"""Names of the kinds of picture in a report, which `paxisim.diagnose.report.page.PICTURES` draws."""


def _always(problem: Problem) -> str:
    return ""


def _once(problem: Problem) -> int:
    return 1


@dataclass(frozen=True, eq=False, kw_only=True)
class Cause:
    """A property of a sensor or a scene that the simulation lacks; see the four kinds.

    Attributes:
        name: Name in a diagnosis.
        order: Position in the chain; smaller is nearer to the contact.
        words: Explanation in one short sentence for a reader who does not know the name.
        excites: Name of the motion that excites the cause best, one of `paxisim.diagnose.data.motions.MOTIONS`.
        picture: Kind of picture in a report, one of `PICTURES`.
        covariate: Name of the covariate that the cause requires.
        barred: Function that returns why the cause cannot be identified in this recording; an empty string if it can.
        misfit: Share of the effect's energy that may remain because the fitted form never matches the sensor exactly;
            other causes must gain more than this.
        price: Factor on the required gain. It exceeds 1 for causes with many parameters, which absorb tolerated errors.
        nuisance: Whether the cause is fitted beside all others from the start and named only if it passes the test at
            the end.
        tacit: Whether a nuisance is never named and always stays in the model.
        of_replay: Caveat if the simulation follows the streams of a robot.
        copies: Function that returns how many pads have parameters of their own, whose names end in the pad's index.
            It multiplies the price.
    """

    name: str
    order: float
    words: str = ""
    excites: str = "varied"
    picture: str = "plain"
    covariate: str = ""
    barred: Callable[[Problem], str] = _always
    misfit: float = 0.01
    price: float = 1.0
    nuisance: bool = False
    tacit: bool = False
    of_replay: str = ""
    copies: Callable[[Problem], int] = _once

    @property
    def in_scene(self) -> bool:
        """Whether the cause is inside the scene and not in the sensor."""
        return False

    def parameters(self, problem: Problem) -> tuple[Free, ...]:
        """The scalar parameters that are fitted."""
        return ()

    def effects(self, problem: Problem, x: FloatArray) -> list[FloatArray]:
        """Effects on `x` ``(T, pads, 3, rows, cols)`` N while the cause is small, which together span it; in N."""
        return []

    def amount(self, values: FloatArray, problem: Problem) -> float:
        """Size of the values, in units of the smallest size of interest."""
        return np.inf

    def has_memory(self, problem: Problem) -> bool:
        """Whether the effect on a frame depends on earlier frames."""
        return False


def _no_starts(problem: Problem) -> Sequence[Values]:
    return ()


@dataclass(frozen=True, eq=False, kw_only=True)
class FittedCause(Cause):
    """A transform of the simulated force with a few parameters, or a change of the simulated scene.

    Attributes:
        make: Function that returns the transform with the given values: the parameters in the order of `free`. The
            model has intervals for the fields of a user-defined transform only if `paxisim.augment.parameter` declares
            them.
        free: Function that returns the parameters to fit, given the problem.
        starts: Function that returns starting values of the fit, one set for each form that the effect may take.
            Together they should span the effect while it is small, because candidates are ranked by them.
        basis: For a transform linear in its own parameters: function that returns their effects at 1 on a force (N).
            They are computed once for each force instead of once for each change of a parameter.
        change: For a cause inside the scene: function that returns the change of the simulated force (N). It replaces
            the transform.
        derived: Numbers that a reader understands, which are reported before the parameters.
        parts: Parts of the cause, if it has several; each is judged by itself once the cause is found.
        gauge: Gain that the calibration convention adds, if any.
        owns_gain: Whether the parameters themselves include the gain of the calibration convention.
        size: Function that returns the size of the values in units of the smallest size of interest; default: derived
            from `Free.material`.
        remembers: Whether only motions at several speeds separate the cause from other memory effects.
        limits: Least and largest value of parameters beyond which another cause is at work, by name.
        beyond: Name of that other cause.
        fixed: Names of parameters that stay neutral, because the parts that they belong to were left out.
    """

    make: Callable[[Values, Problem], Transform]
    free: Callable[[Problem], tuple[Free, ...]]
    starts: Callable[[Problem], Sequence[Values]] = _no_starts
    basis: Callable[[Problem, NDArray[np.floating]], Sequence[NDArray[np.floating]]] | None = None
    change: Callable[[Values, Problem], FloatArray] | None = None
    derived: tuple[Derived, ...] = ()
    parts: tuple[CausePart, ...] = ()
    gauge: Gauge | None = None
    owns_gain: bool = False
    size: Callable[[Values, Problem], float] | None = None
    remembers: bool = False
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    beyond: str = ""
    fixed: frozenset[str] = frozenset()

    @property
    def in_scene(self) -> bool:
        """See `Cause.in_scene`."""
        return self.change is not None

    def parameters(self, problem: Problem) -> tuple[Free, ...]:
        """The fitted parameters, those of the gauge last."""
        own = (free for free in self.free(problem) if free.name not in self.fixed)
        return (*own, *(self.gauge.free if self.gauge else ()))

    def transform(self, values: FloatArray, problem: Problem) -> Transform:
        """The transform with fitted values, including those of the gauge."""
        own, gain = self._parted(values, problem)
        made = self.make(own, problem)
        if self.gauge is None or np.all(gain == 1):
            return made
        after: Transform = augment.AxisGain(tuple(gain))
        if STAGES.index(made.stage) > STAGES.index(after.stage):  # the gain is part of the calibration
            after = augment.Chain([after])
        return augment.Chain([made, after], [self.name, self.gauge.name])

    def _parted(self, values: Values, problem: Problem) -> tuple[list[float], FloatArray]:
        """The values of all of `free`, and the ``(3,)`` gain of the gauge, from the values of `parameters`."""
        count = len(self.gauge.free) if self.gauge else 0
        own = [float(v) for v in values]
        own, shares = own[: len(own) - count], own[len(own) - count :]
        if self.fixed:
            given = iter(own)
            own = [f.neutral if f.name in self.fixed else next(given) for f in self.free(problem)]
        if self.gauge is None:
            return own, np.ones(3)
        return own, 1 + np.array([shares[-1], shares[-1], shares[0]]) * (self.gauge.gain(own, problem) - 1)

    def combined(
        self, x: NDArray[np.floating], basis: NDArray[np.floating], values: FloatArray, problem: Problem
    ) -> NDArray[np.floating]:
        """The same as `on`, given the `basis` of `x`."""
        own, gain = self._parted(values, problem)
        self.make(own, problem)  # raises if it refuses these values
        y = x + np.tensordot(np.asarray(own, dtype=basis.dtype), basis, 1)
        return y if np.all(gain == 1) else y * gain.astype(y.dtype)[:, None, None]

    def on(self, x: NDArray[np.floating], values: FloatArray, problem: Problem, frames: Problem) -> FloatArray:
        """Apply the cause to a force.

        Args:
            x: ``(T, pads, 3, rows, cols)`` N.
            values: Values of the cause.
            problem: The recording that the values refer to.
            frames: The part of the recording that `x` belongs to.
        """
        if self.change is not None:
            return x + self.change(values, frames)
        return frames.run(self.transform(values, problem), x)

    def effects(self, problem: Problem, x: FloatArray) -> list[FloatArray]:
        """See `Cause.effects`: the effect at each of its starts."""
        if self.basis is not None:
            return list(self.basis(problem, x))
        starts = self._starts(problem)
        if self.change is not None:
            return [self.change(start, problem) for start in starts]
        return [problem.run(self.make(start, problem), x) - x for start in starts]

    def has_memory(self, problem: Problem) -> bool:
        """See `Cause.has_memory`."""
        return self.change is None and self.transform(self.places(problem)[0], problem).has_memory

    def places(self, problem: Problem) -> list[FloatArray]:
        """Starting values of `parameters`; with a gauge, each start is combined with both ends of the gauge."""
        varied = [f.name not in self.fixed for f in self.free(problem)]
        starts = [np.asarray(start, dtype=np.float64)[varied] for start in self._starts(problem)]
        if self.gauge is None:
            return starts
        return [np.append(s, [end] * len(self.gauge.free)) for s in starts for end in (0.0, 1.0)]

    def _starts(self, problem: Problem) -> Sequence[Values]:
        """The starts with the fixed parameters neutral, without those that then have no effect."""
        if not self.fixed:
            return self.starts(problem)
        free = self.free(problem)
        starts = [self._without(self.fixed, start, problem) for start in self.starts(problem)]
        acts = [any(f.material and v != f.neutral for f, v in zip(free, start, strict=True)) for start in starts]
        return list(compress(starts, acts)) or [[f.neutral for f in free]]

    def _without(self, names: Collection[str], own: Values, problem: Problem) -> list[float]:
        """Values of `free` with the parameters of these names neutral."""
        return [f.neutral if f.name in names else float(v) for f, v in zip(self.free(problem), own, strict=True)]

    def lacking(self, part: CausePart) -> FittedCause:
        """The cause without one of its parts, whose parameters stay neutral."""
        return replace(
            self, fixed=self.fixed.union(part.parameters), parts=tuple(p for p in self.parts if p is not part)
        )

    def beyond_limits(self, values: Values, problem: Problem) -> dict[str, float]:
        """The parameters that are beyond their limits, with their values."""
        given = {free.name: float(value) for free, value in zip(self.parameters(problem), values, strict=True)}
        return {n: given[n] for n, (low, high) in self.limits.items() if n in given and not low <= given[n] <= high}

    def within_limits(self) -> FittedCause:
        """The cause with its parameters bounded by their limits."""

        def free(problem: Problem) -> tuple[Free, ...]:
            bounds = ((f, self.limits.get(f.name, (f.low, f.high))) for f in self.free(problem))
            return tuple(replace(f, low=low, high=high) for f, (low, high) in bounds)

        return replace(self, free=free)

    def amount(self, values: FloatArray, problem: Problem) -> float:
        """See `Cause.amount`."""
        return self._amount(self._parted(values, problem)[0], problem)

    def amount_of(self, part: CausePart, values: Values, problem: Problem) -> float:
        """Size of one part of the values, in units of the smallest size of interest."""
        others = {free.name for free in self.free(problem)}.difference(part.parameters)
        return self._amount(self._without(others, self._parted(values, problem)[0], problem), problem)

    def _amount(self, own: Values, problem: Problem) -> float:
        if self.size is not None:
            return self.size(own, problem)
        pairs = zip(own, self.free(problem), strict=True)
        return max((abs(v - f.neutral) / f.material for v, f in pairs if f.material), default=np.inf)


Absorbed = Callable[[Problem, FloatArray, FloatArray, FloatArray], Callable[[FloatArray], FloatArray]]


@dataclass(frozen=True, eq=False, kw_only=True)
class PerChannelCause(Cause):
    """A transform with a parameter for each taxel or channel, fitted in closed form.

    Attributes:
        make: Function that returns the transform with the given array.
        array: Name of the array in reports and in the transform.
        unit: Unit of its values, ``"1"`` if dimensionless.
        solve: Function that returns the best-fitting array, given the problem, the input force, a function that maps
            the output force to the reading, and a starting array or None.
        error: Function that returns the half-widths of the array's 90 % intervals, given a problem of at least three
            episodes, the prediction of the whole model (N) and the array.
        size: Function that returns the size of the array in units of the smallest size of interest.
        absorbed: Function that returns how much of a small change of the residual the array absorbs when it is solved
            for again, as a function of that change. It is given the problem, the effect of adding 1 to the whole
            array, the residual (both in units of the noise) and the array. None if only solving tells.
    """

    make: Callable[[FloatArray, Problem], Transform]
    array: str
    unit: str
    solve: Callable[[Problem, FloatArray, Callable[[FloatArray], FloatArray], FloatArray | None], FloatArray]
    error: Callable[[Problem, FloatArray, FloatArray], FloatArray]
    size: Callable[[FloatArray, Problem], float]
    absorbed: Absorbed | None = None

    def amount(self, values: FloatArray, problem: Problem) -> float:
        """See `Cause.amount`."""
        return self.size(values, problem)


@dataclass(frozen=True, eq=False, kw_only=True)
class BaselineCause(Cause):
    """A force-independent offset: time curves shared by all channels, with one amplitude per curve and channel.

    Attributes:
        make: Function that returns the transform, given the amplitudes and the shape parameters.
        amounts: Name of the amplitudes in reports and in the transform.
        curves: Function that returns the ``(curves, T)`` curves, given the recording and the shape parameters.
        numbers: Meaning of each shape parameter, by its name in reports and in the transform.
        shapes: Values of the shape parameters to try, the simplest first.
        planes: Whether the cause owns a constant offset: a plane over each pad's axis plus a multiple of its
            amplitudes. `offset` is then named only for the rest of the zero offset.
        unpressed_rival: Name of a cause with the same effect on taxels that are never pressed.
    """

    make: Callable[[FloatArray, tuple[float, ...], Problem], Transform]
    amounts: str
    curves: Callable[[Problem, Values], FloatArray]
    numbers: Mapping[str, str] = field(default_factory=dict)
    shapes: tuple[tuple[float, ...], ...] = ((),)
    planes: bool = False
    unpressed_rival: str = ""

    def effects(self, problem: Problem, x: FloatArray) -> list[FloatArray]:
        """See `Cause.effects`: each curve of the simplest shape at an amplitude of 1 N."""
        return list(self.curves(problem, self.shapes[0])[..., None, None, None, None])


@dataclass(frozen=True, eq=False)
class Reading:
    """A fault that a check detected in the recording.

    Attributes:
        transform: The fault as a transform.
        values: Its parameters by name.
        problem: The recording to use in all later steps.
        rounds: Whether the fault is the rounding that `Problem.read` already models.
    """

    transform: Transform
    values: Mapping[str, float | FloatArray]
    problem: Problem
    rounds: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class DetectedCause(Cause):
    """A fault that a check finds in the streams before the search.

    Attributes:
        read: Function that returns the fault, or None if there is none.
    """

    read: Callable[[Problem], Reading | None]


def baseline_causes(causes: Sequence[Cause]) -> list[BaselineCause]:
    """The causes with a zero offset, in chain order."""
    return sorted((c for c in causes if isinstance(c, BaselineCause)), key=lambda c: c.order)
