"""Fits: what has been fitted so far, by the set of causes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from paxisim.diagnose.cause import Cause
from paxisim.diagnose.each import each
from paxisim.diagnose.fitting import Fit, fit
from paxisim.diagnose.problem import Problem

WORSE = 1.0005  # times the energy of fewer causes, from which on a fit has ended in the wrong place


class Fits:
    """The fits of sets of causes to a recording, each made once.

    Attributes:
        problem: The recording.
        by_name: The causes to choose from.
        jobs: Processors to use.
    """

    def __init__(self, problem: Problem, causes: Sequence[Cause], jobs: int = 1) -> None:
        """Nothing is fitted yet."""
        self.problem, self.jobs = problem, jobs
        self.by_name = {item.name: item for item in causes}
        self._made: dict[frozenset[str], Fit] = {}
        self._tried: set[tuple[frozenset[str], frozenset[str]]] = set()

    def of(self, names: Sequence[str], start: Fit | None = None) -> Fit:
        """The fit of a set of causes, begun with the values of another where it has them.

        One that is worse than that of fewer of its causes has ended in the wrong place, and is begun from there again.
        """
        key = frozenset(names)
        if key not in self._made:
            self._made[key] = self._begun(names, start)
        for fewer in [key - {name} for name in names]:
            less = self._made.get(fewer)
            if less is not None and (key, fewer) not in self._tried and _left(self._made[key]) > WORSE * _left(less):
                self._tried.add((key, fewer))
                self._made[key] = min(self._made[key], self._begun(names, less), key=_left)
        return self._made[key]

    def _begun(self, names: Sequence[str], start: Fit | None) -> Fit:
        known = {} if start is None else {n: v for n, v in start.values.items() if n in names}
        return fit(self.problem, [self.by_name[n] for n in names], known)

    def with_each(self, fewer: Sequence[str], names: Iterable[str], start: Fit | None = None) -> dict[str, Fit]:
        """By name, the fit of `fewer` and that one."""
        names = list(names)
        return dict(zip(names, each(lambda name: self.of([*fewer, name], start), names, self.jobs), strict=True))


def _left(found: Fit) -> float:
    return float(found.energy.sum())
