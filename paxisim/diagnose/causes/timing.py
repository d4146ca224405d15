"""What comes late: low-pass and latency."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.cause import STATIC, TAXEL_GAIN, Cause, Free, Values, register_cause
from paxisim.diagnose.problem import Problem

register_cause(
    Cause(
        "low_pass",
        70,
        lambda p: (Free("tau_1", "s", 0.0, 0.0, 2.0, 0.02, 0.003), Free("tau_2", "s", 0.0, 0.0, 2.0, 0.02, 0.003)),
        lambda v, p: augment.Chain([augment.LowPass(v[0]), augment.LowPass(v[1])]),
        lambda p: [(0.01, 0.005), (0.03, 0.02), (0.1, 0.05)],
        form={
            **dict.fromkeys((*STATIC, "saturation", "dead_band", "creep", "hysteresis"), 0.0005),
            "latency": 0.003,
            TAXEL_GAIN: 0.006,
        },
    )
)


def _capacity(problem: Problem, delay: float) -> int:
    """Frames that a latency must keep, so that none between now and then is left out."""
    return int(max(16, 4 * delay / problem.interval + 4))


def _like_a_filter(values: Values, problem: Problem) -> float:
    """By what share of its gain a delay must be better than a low-pass.

    One that is shorter than most of the time between two frames differs from a filter by what lies between them, which
    is drawn, not known, and costs the filter more the longer it is.
    """
    delay, interval = abs(values[0]), problem.interval
    return _SHORT * delay if interval > _OFTEN and delay < _BETWEEN * interval else 0.0


_SHORT = 1.2  # of the gain, for each second of delay

_BETWEEN = 0.65  # of the time between two frames, that such a delay is shorter than

_OFTEN = 0.025  # s between frames, below which a curve through them is good enough

register_cause(
    Cause(
        "latency",
        71,
        lambda p: (Free("delay", "s", 0.0, -0.5, 0.5, 0.02, 0.003),),
        lambda v, p: augment.Latency(v[0], capacity=_capacity(p, v[0])),
        lambda p: [(-0.1,), (0.01,), (0.03,), (0.1,)],
        behind={"low_pass": _like_a_filter},
        form={
            "low_pass": 0.01,
            "interference": 0.004,
            **dict.fromkeys((*STATIC, "saturation", "dead_band", "creep", "hysteresis"), 0.0008),
        },
    )
)
