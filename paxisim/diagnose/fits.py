"""Fits: what has been fitted so far, by the set of causes."""

from __future__ import annotations

from collections.abc import Sequence

from paxisim.diagnose.cause import Cause
from paxisim.diagnose.fitting import Fit, fit
from paxisim.diagnose.problem import Problem


class Fits:
    """The fits of sets of causes to a recording, each made once.

    Attributes:
        problem: The recording.
        by_name: The causes to choose from.
    """

    def __init__(self, problem: Problem, causes: Sequence[Cause]) -> None:
        """Nothing is fitted yet."""
        self.problem = problem
        self.by_name = {item.name: item for item in causes}
        self._made: dict[frozenset[str], Fit] = {}

    def of(self, names: Sequence[str], start: Fit | None = None) -> Fit:
        """The fit of a set of causes, begun with the values of another where it has them."""
        key = frozenset(names)
        if key not in self._made:
            known = {} if start is None else {n: v for n, v in start.values.items() if n in key}
            self._made[key] = fit(self.problem, [self.by_name[n] for n in names], known)
        return self._made[key]
