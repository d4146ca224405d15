"""Low-pass: the sensor smooths fast changes of force."""

from __future__ import annotations

from paxisim import augment
from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import Free, Values
from paxisim.diagnose.data.problem import Problem


def _make(values: Values, problem: Problem) -> Transform:
    first, second, delay = values
    filters: list[Transform] = [augment.LowPass(first), augment.LowPass(second)]
    late = delay * (first + second)
    if late > 0:
        filters.append(augment.Latency(late, capacity=capacity(problem, late)))
    return augment.Chain(filters)


def capacity(problem: Problem, delay: float) -> int:
    """Number of frames that a latency must buffer to cover a delay of `delay` seconds."""
    return int(max(16, 4 * abs(delay) / problem.interval + 4))


LOW_PASS = FittedCause(
    name="low_pass",
    order=70,
    make=_make,
    excites="taps",
    free=lambda p: (
        Free("tau_1", "s", 0.0, 0.0, 2.0, 0.02, 0.003),
        Free("tau_2", "s", 0.0, 0.0, 2.0, 0.02, 0.003),
        # the gauge: filters with many poles or with linear phase delay more than two poles do
        Free(
            "delay", "1", 0.0, 0.0, 1.0, 0.3, spread=1.0, words="delay beyond the filter, as a share of tau_1 + tau_2"
        ),
    ),
    starts=lambda p: [(0.01, 0.005, 0.0), (0.03, 0.02, 0.0), (0.1, 0.05, 0.0), (0.03, 0.03, 0.8)],
    misfit=0.003,
    words="The sensor smooths fast changes of force.",
    picture="edges",
)
