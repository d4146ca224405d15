"""Read only: a `Cause.make` for causes that are read off the recording and have no parameters."""

from __future__ import annotations

from collections.abc import Callable

from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.kinds import Values
from paxisim.diagnose.data.problem import Problem
from paxisim.errors import InvalidValueError


def not_made(name: str) -> Callable[[Values, Problem], Transform]:
    """Return a `Cause.make` that raises an `InvalidValueError`."""

    def make(values: Values, problem: Problem) -> Transform:
        raise InvalidValueError(f"{name} is read off the recording and cannot be made from parameters")

    return make
