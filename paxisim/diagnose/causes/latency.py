"""Latency: there is a constant delay between measurement and simulation."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.low_pass import capacity
from paxisim.diagnose.causes.parameters import Free
from paxisim.diagnose.data.problem import Problem


def _barred(problem: Problem) -> str:
    """Why a delay cannot be tested; empty if it can."""
    return "the clocks of the two streams were aligned, which removes any constant delay" if problem.aligned else ""


LATENCY = FittedCause(
    name="latency",
    order=71,
    make=lambda v, p: augment.Latency(v[0], capacity=capacity(p, v[0])),
    excites="taps",
    free=lambda p: (Free("delay", "s", 0.0, -0.5, 0.5, 0.02, 0.003),),
    starts=lambda p: [(-0.1,), (0.01,), (0.03,), (0.1,)],
    misfit=0.003,
    of_replay=(
        "an offset between the clocks of robot and sensor has the same effect, and this recording cannot tell the two "
        "apart"
    ),
    barred=_barred,
    words="There is a constant delay between measurement and simulation.",
    picture="shift",
)
