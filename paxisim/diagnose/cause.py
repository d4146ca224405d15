"""Cause: a transform and what is needed to search for it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from paxisim.augment.transform import Transform
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.errors import InvalidValueError, UnknownNameError

Values = Sequence[float]

MANY = 7.0
"""What a cause with a number for each taxel or channel costs, see `Cause`."""

Solve = Callable[[Problem, FloatArray, Callable[[FloatArray], FloatArray], bool, "FloatArray | None"], FloatArray]

FORM = 0.002
"""Share of a cause's gain that most others may bring besides, see `Cause`; measured by `benchmarks/form_shares.py`."""

UNLIKE = 0.0005
"""The same for those that look like no other."""

TAXEL_GAIN = "taxel_gain"
"""The one cause with a number for each taxel; it is fitted in closed form."""

STATIC = ("axis_gain", "stiffening", "crosstalk")
"""Causes that act on how hard a taxel is pressed."""

AXES = "xyz"

DEAD_BAND = "dead_band"
"""The one cause that holds back a zero."""

GAIN_PRIOR = 0.1
"""Spread of taxels' gains about 1 that is expected before a recording has told of it."""


@dataclass(frozen=True)
class Free:
    """One number that is fitted.

    Attributes:
        name: What it is called in a report.
        unit: Its unit, ``"1"`` for a pure number.
        neutral: The value at which the cause does nothing, or at which it does not matter.
        low: Least value.
        high: Largest value.
        scale: By how much it typically moves; the search steps in these units.
        material: A cause is named only if one of its numbers is this far from neutral; None for a number that it is not
            named for, such as a time constant.
        spread: How far from neutral it may be expected: it stays there as long as the data do not say otherwise. None
            where the data always do.
        together: Numbers of a cause with the same word here act on other channels each, and are tried together.
        channel: Pad and axis that such a number acts on alone.
        held_beside: Names of causes beside which it stays neutral, as they do what it does.
    """

    name: str
    unit: str
    neutral: float
    low: float
    high: float
    scale: float
    material: float | None = None
    spread: float | None = None
    together: str = ""
    channel: tuple[int, int] = (0, 0)
    held_beside: tuple[str, ...] = ()

    def is_held(self, beside: Iterable[str]) -> bool:
        """Whether it stays neutral beside causes of these names."""
        return not set(self.held_beside).isdisjoint(beside)


@dataclass(frozen=True)
class Cause:
    """Something that a sensor does and the simulation lacks.

    Attributes:
        name: As it appears in a diagnosis.
        order: Where it sits in the chain, smaller is nearer to the contact.
        free: What is fitted, given the problem (its peak force, its number of pads ...).
        make: The transform with these values, in the order of `free`. Of a transform of one's own, only fields that are
            declared with `paxisim.augment.parameter` get intervals in the model, as others cannot be drawn.
        probes: Sets of values whose effects, taken together, span what the cause can do while it is small. The search
            ranks causes by them; give several where the effect changes its shape, as with time constants. None for a
            cause that is not searched for but read off the data.
        covariate: Name of the covariate that it needs, empty for none.
        simpler: Names of causes that it can imitate with fewer numbers; it is named only if it does better than they.
        ahead: By what share of its gain it must be better than those.
        behind: By what share of its gain, given its values, it must be better than another cause, by its name, which it
            does not imitate but whose form costs that one as much.
        told_beside: By name of another cause, the only numbers that tell it from that one where both are in.
        costs: How many times the energy that matters it must bring: more than 1 for one with many numbers, in which
            what no calibration has removed gathers.
        form: Share of its gain that another cause, by its name, may bring besides, as no form fits exactly what a
            sensor does; that one's `mistaken` where it is not listed.
        absorbs: The same where those of `absorbers` are fitted besides, which take up what its form misses; a cause
            that brings less than its share in `form` may bring more than this.
        absorbers: Names of causes.
        mistaken: Share of another cause's gain that this one may bring only because that one's form does not fit.
        faint: Factor on the energy that matters, that is enough without samples far off, as chance brings less.
        beyond: How far `values` are from what those could do, in units of what matters: at least 1 to be named.
        solve: For one with a number for each taxel or channel: the array that fits best, in closed form, given the
            problem, what comes in, a function that says what the causes behind it make of what goes out, whether there
            are none, and an array near it, if one is known. It then has no `free`, and `make` takes the array.
        solves: What that array is called, in a report and in the transform.
        relative_to: Names of causes that scale all taxels alike: beside one of them that array is 1 on average, as
            nothing tells which of the two has a factor that all have in common.
        barred: Why it cannot be told in a problem; empty if it can.
    """

    name: str
    order: float
    free: Callable[[Problem], tuple[Free, ...]]
    make: Callable[[Values, Problem], Transform]
    probes: Callable[[Problem], Sequence[Values]] | None
    covariate: str = ""
    simpler: tuple[str, ...] = ()
    ahead: float = 0.08
    behind: Mapping[str, Callable[[Values, Problem], float]] = field(default_factory=dict)
    told_beside: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    costs: float = 1.0
    form: Mapping[str, float] = field(default_factory=dict)
    absorbs: Mapping[str, float] = field(default_factory=dict)
    absorbers: tuple[str, ...] = ()
    mistaken: float = FORM
    faint: float = 1.0
    beyond: Callable[[Values, Problem], float] = lambda values, problem: np.inf
    solve: Solve | None = None
    solves: str = ""
    relative_to: tuple[str, ...] = ()
    barred: Callable[[Problem], str] = lambda problem: ""

    @property
    def gives_way(self) -> tuple[str, ...]:
        """Names of the causes that are taken in its place if it is hardly better."""
        return (*self.simpler, *self.behind)

    @property
    def is_searched(self) -> bool:
        """Whether it is fitted; else it is read off the data, and has no rivals."""
        return self.probes is not None or self.solve is not None

    def size(self, values: Values, problem: Problem, beside: Iterable[str] = ()) -> float:
        """How far it is from neutral, in units of what matters: at least 1 to be named.

        Args:
            values: Of it.
            problem: The recording.
            beside: Names of the causes beside which it is to be told.
        """
        beyond = self.beyond(values, problem)
        free = self.free(problem)
        if self.solve is not None or not free:
            return beyond
        telling = [self.told_beside[name] for name in beside if name in self.told_beside]
        sizes = [
            abs(v - f.neutral) / max(f.material, 1e-12)
            for v, f in zip(values, free, strict=True)
            if f.material is not None and all(f.name in names for names in telling)
        ]
        return min(beyond, max(sizes, default=0.0))


def one_away(size: int, index: int, neutral: float, step: float) -> list[float]:
    """Neutral values, but for one, a step away: what to probe a cause of several parameters with."""
    values = [neutral] * size
    values[index] += step
    return values


_CAUSES: dict[str, Cause] = {}


def register_cause(cause: Cause) -> None:
    """Add a cause to those that are searched for from now on.

    Raises:
        InvalidValueError: There is one of that name already.
    """
    if cause.name in _CAUSES:
        raise InvalidValueError(f"there is a cause {cause.name!r} already; choose another name")
    _CAUSES[cause.name] = cause


def known_causes() -> tuple[str, ...]:
    """The names of all causes, in the order of the chain."""
    from paxisim.diagnose import causes as _  # noqa: F401  # registers ours

    return tuple(sorted(_CAUSES, key=lambda name: _CAUSES[name].order))


def cause(name: str) -> Cause:
    """The cause of that name.

    Raises:
        UnknownNameError: There is none.
    """
    known = known_causes()
    if name not in known:
        raise UnknownNameError("cause", name, known)
    return _CAUSES[name]
