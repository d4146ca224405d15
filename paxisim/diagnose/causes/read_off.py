"""What `checks` and `zero` read off the data, and nothing is fitted for: layout, zero, counts and dead taxels."""

from __future__ import annotations

from paxisim.augment.transform import Transform
from paxisim.diagnose.cause import Cause, Values, register_cause
from paxisim.diagnose.channels import mixes_alike, zero_is_fitted
from paxisim.diagnose.problem import Problem
from paxisim.errors import InvalidValueError


def _read(name: str, order: float) -> Cause:
    """One that `checks` or `zero` reads off the data."""
    barred = {"layout": mixes_alike, "offset": zero_is_fitted}.get(name, lambda problem: "")

    def make(values: Values, problem: Problem) -> Transform:
        raise InvalidValueError(f"{name} is read off the data, it is not made from numbers")

    return Cause(name, order, lambda p: (), make, None, barred=barred)


for _name, _order in (("layout", 0), ("offset", 76), ("drift", 77), ("quantisation", 90), ("dead_taxels", 95)):
    register_cause(_read(_name, _order))
