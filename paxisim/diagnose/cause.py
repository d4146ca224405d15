"""Cause: a transform and all that is needed to look for it. Each cause is one file in `causes/`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from paxisim import augment
from paxisim.augment.transform import STAGES, Transform
from paxisim.diagnose.problem import FloatArray, Problem

Values = Sequence[float]

AXES = "xyz"


@dataclass(frozen=True)
class Free:
    """One number that is fitted.

    Attributes:
        name: What a report calls it.
        unit: Its unit, ``"1"`` for a pure number.
        neutral: The value at which the cause does nothing, or the value expected where the data do not decide.
        low: Least value.
        high: Largest value.
        scale: By how much it typically moves; the fit steps in these units.
        material: The cause is named only if one of its numbers is at least this far from neutral. None for numbers
            that do not count, such as time constants.
        spread: Standard deviation of a prior about `neutral`; None for no prior.
        words: What it means, where the name does not say it.
    """

    name: str
    unit: str
    neutral: float
    low: float
    high: float
    scale: float
    material: float | None = None
    spread: float | None = None
    words: str = ""


@dataclass(frozen=True)
class Gauge:
    """The gain that a calibration convention brings with a cause.

    A sensor that creeps reads right at once if it was calibrated with quick presses, and after a while if it was
    calibrated with held loads. The second sensor has a gain below 1 besides the creep; that gain is not a cause of its
    own. One number from 0 to 1 says where between the two conventions the sensor was calibrated; it is fitted with the
    cause and reported as one of its parameters. Where the gain depends on how large the forces are, shear has a number
    of its own.

    Attributes:
        name: Of the number. At 0 the cause's transform reads right as it is, at 1 it is multiplied by `gain`.
        gain: The gain at the other convention, given the cause's values and the recording; one for all axes, or
            ``(3,)``.
        words: What 0 and 1 mean.
        by_axis: Whether the gain is one for each axis.
    """

    name: str
    gain: Callable[[Values, Problem], float | FloatArray]
    words: str
    by_axis: bool = False

    @property
    def free(self) -> tuple[Free, ...]:
        """Its numbers: for all axes, or for normal force and for shear."""
        names = (self.name, f"{self.name}_shear") if self.by_axis else (self.name,)
        return tuple(Free(name, "1", 0.0, 0.0, 1.0, 0.3, spread=1.0, words=self.words) for name in names)


@dataclass(frozen=True, eq=False)
class Local:
    """Numbers of each taxel or channel, fitted in closed form.

    Attributes:
        name: What the array is called, in a report and in the transform.
        unit: Its unit, ``"1"`` for a pure number.
        solve: The array that fits best, given the problem, the force that comes in, a function that says what is read
            of the force that goes out, and an array to begin with or None.
        error: Half the widths of the 90 % intervals of the array, given the problem of three or more episodes, what the
            whole model makes of it (N), and the array.
    """

    name: str
    unit: str
    solve: Callable[[Problem, FloatArray, Callable[[FloatArray], FloatArray], FloatArray | None], FloatArray]
    error: Callable[[Problem, FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Course:
    """A reading without force that follows curves in time which all channels share, each by amounts of its own.

    Attributes:
        name: What the amounts are called, in a report and in the transform.
        curves: ``(curves, T)``, given the recording and the numbers of their shape.
        numbers: What those numbers are called, in a report and in the transform, and what they mean.
        shapes: Values of the numbers that are tried, the simplest first.
    """

    name: str
    curves: Callable[[Problem, Values], FloatArray]
    numbers: Mapping[str, str] = field(default_factory=dict)
    shapes: tuple[tuple[float, ...], ...] = ((),)


@dataclass(frozen=True, eq=False)
class Reading:
    """What a deterministic check read off the recording.

    Attributes:
        transform: The fault.
        values: Its figures by name.
        problem: The recording as it is compared from here on.
        rounds: Whether what it does is the rounding that `Problem.read` already knows of.
    """

    transform: Transform
    values: Mapping[str, float | FloatArray]
    problem: Problem
    rounds: bool = False


def _nothing(problem: Problem) -> tuple[Free, ...]:
    return ()


def _no_starts(problem: Problem) -> Sequence[Values]:
    return ()


def _always(problem: Problem) -> str:
    return ""


@dataclass(frozen=True, eq=False)
class Cause:
    """Something that a sensor or a scene does and the simulation lacks.

    A cause is fitted (`free` and `starts`, or `local`, or `course`) or read off the recording (`read`). One that is
    fitted is a transform of the simulated force, or a change of the scene that is simulated (`change`).

    Attributes:
        name: As it appears in a diagnosis.
        order: Its place in the chain; smaller is nearer to the contact.
        make: The transform with these values: the numbers in the order of `free`, or the array of `local`. Fields of a
            transform of your own get intervals in the model only if `paxisim.augment.parameter` declares them.
        excites: Name of the motion, one of `paxisim.diagnose.advice.MOTIONS`, that shows this cause best.
        free: The numbers that are fitted, given the problem.
        starts: Values to begin the fit with, for each form that the effect may take. Together they should span what
            the cause does while it is small, as candidates are ranked by them.
        gauge: The gain that comes with the cause's calibration convention, if there is one.
        change: For a cause inside the scene: what it adds to the simulated force (N), in place of a transform.
        local: For a cause with a number for each taxel or channel, fitted in closed form.
        course: For a cause that adds a reading without force.
        read: For a cause that is read off the recording before the search.
        nuisance: Whether it is fitted beside all others from the beginning, and named only if it counts in the end.
        tacit: Of a nuisance, whether it is never named, and stays in the model.
        remembers: Whether only motions of several speeds tell it from the other causes that remember.
        unpressed_rival: Name of a cause that does the same on taxels that nothing presses.
        planes: Whether the cause comes with a constant, a plane over each pad's axis and a multiple of its amounts, so
            that `offset` is named only for what is left of the zero beside it.
        covariate: Name of the covariate that it needs.
        misfit: Share of its gain that is left for others to explain, as no form is exactly the sensor's.
        price: How many times the usual gain it must bring: more than 1 for a cause with many numbers, in which
            tolerated errors gather.
        size: How large the values are, in units of the smallest size of interest; default: by `Free.material`.
        barred: Why it cannot be told in this recording; an empty string if it can.
        words: What it is, in one short sentence for a reader who has never met the name.
        picture: The kind of picture that shows it in a report, a key of `paxisim.diagnose.report.kinds.PICTURES`.
    """

    name: str
    order: float
    make: Callable[[Values, Problem], Transform]
    excites: str = "varied"
    free: Callable[[Problem], tuple[Free, ...]] = _nothing
    starts: Callable[[Problem], Sequence[Values]] = _no_starts
    gauge: Gauge | None = None
    change: Callable[[Values, Problem], FloatArray] | None = None
    local: Local | None = None
    course: Course | None = None
    read: Callable[[Problem], Reading | None] | None = None
    nuisance: bool = False
    tacit: bool = False
    remembers: bool = False
    unpressed_rival: str = ""
    planes: bool = False
    covariate: str = ""
    misfit: float = 0.01
    price: float = 1.0
    size: Callable[[Values, Problem], float] | None = None
    barred: Callable[[Problem], str] = _always
    words: str = ""
    picture: str = "plain"

    def parameters(self, problem: Problem) -> tuple[Free, ...]:
        """The fitted numbers, those of the gauge last."""
        return (*self.free(problem), *(self.gauge.free if self.gauge else ()))

    def transform(self, values: FloatArray, problem: Problem) -> Transform:
        """The transform with fitted values, the gauge's included."""
        if self.local or self.course:
            return self.make(values, problem)  # type: ignore[arg-type]
        numbers = [float(v) for v in values]
        if self.gauge is None:
            return self.make(numbers, problem)
        count = len(self.gauge.free)
        own, shares = numbers[:-count], numbers[-count:]
        made = self.make(own, problem)
        gain = 1 + np.array([shares[-1], shares[-1], shares[0]]) * (self.gauge.gain(own, problem) - 1)
        if np.all(gain == 1):
            return made
        after: Transform = augment.AxisGain(tuple(gain))
        if STAGES.index(made.stage) > STAGES.index(after.stage):  # it stands for a calibration, not for the magnets
            after = augment.Chain([after])
        return augment.Chain([made, after], [self.name, self.gauge.name])

    def on(self, x: NDArray[np.floating], values: FloatArray, problem: Problem, frames: Problem) -> FloatArray:
        """What it makes of a force.

        Args:
            x: ``(T, pads, 3, rows, cols)`` N.
            values: Its values.
            problem: The recording, which its values refer to.
            frames: The frames of the recording that `x` is of.
        """
        if self.change is not None:
            return x + self.change(values, frames)  # type: ignore[arg-type]
        return frames.run(self.transform(values, problem), x)  # type: ignore[arg-type]

    def has_memory(self, problem: Problem) -> bool:
        """Whether what it does to a frame depends on those before."""
        return self.change is None and self.transform(self.places(problem)[0], problem).has_memory

    def places(self, problem: Problem) -> list[FloatArray]:
        """The starts, those of a gauge at both of its ends."""
        starts = [np.asarray(values, dtype=np.float64) for values in self.starts(problem)]
        if self.gauge is None:
            return starts
        return [np.append(s, [end] * len(self.gauge.free)) for s in starts for end in (0.0, 1.0)]

    def amount(self, values: FloatArray, problem: Problem) -> float:
        """How large the values are, in units of the smallest size of interest."""
        if self.size is not None:
            return self.size(values, problem)  # type: ignore[arg-type]
        pairs = zip(values, self.free(problem), strict=False)
        return max((abs(float(v) - f.neutral) / f.material for v, f in pairs if f.material), default=np.inf)


def courses_of(causes: Sequence[Cause]) -> list[Cause]:
    """The causes that have a course, in the order of the chain."""
    return sorted((c for c in causes if c.course is not None), key=lambda c: c.order)


def one_away(count: int, index: int, neutral: float, step: float) -> list[float]:
    """Neutral values, but for one that is a step away: a start of a cause with several parameters."""
    values = [neutral] * count
    values[index] += step
    return values
