"""Fits: what has been fitted so far, by the set of causes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from paxisim.diagnose.cause import Cause
from paxisim.diagnose.each import each
from paxisim.diagnose.fitting import Fit, fit
from paxisim.diagnose.problem import Problem


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

    def of(self, names: Sequence[str], start: Fit | None = None) -> Fit:
        """The fit of a set of causes, begun with the values of another where it has them."""
        key = frozenset(names)
        if key not in self._made:
            known = {} if start is None else {n: v for n, v in start.values.items() if n in key}
            self._made[key] = fit(self.problem, [self.by_name[n] for n in names], known)
        return self._made[key]

    def with_each(self, fewer: Sequence[str], names: Iterable[str], start: Fit | None = None) -> dict[str, Fit]:
        """By name, the fit of `fewer` and that one."""
        names = list(names)
        return dict(zip(names, each(lambda name: self.of([*fewer, name], start), names, self.jobs), strict=True))
