"""Read only: causes that a check reads off the recording are not made from numbers."""

from __future__ import annotations

from collections.abc import Callable

from paxisim.augment.transform import Transform
from paxisim.diagnose.cause import Values
from paxisim.diagnose.problem import Problem
from paxisim.errors import InvalidValueError


def not_made(name: str) -> Callable[[Values, Problem], Transform]:
    """What takes the place of `Cause.make`."""

    def make(values: Values, problem: Problem) -> Transform:
        raise InvalidValueError(f"{name} is read off the recording, it is not made from numbers")

    return make
