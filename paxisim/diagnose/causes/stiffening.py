"""What bends the curve of each reading over the force: stiffening, dead band and saturation."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.cause import STATIC, TAXEL_GAIN, Cause, Free, register_cause
from paxisim.diagnose.channels import bent_apart
from paxisim.diagnose.problem import Problem

register_cause(
    Cause(
        "stiffening",
        10,
        lambda p: (
            Free("exponent", "1", 1.0, 0.4, 2.0, 0.1, 0.008),
            # the power of another scale is that of this one, times a gain
            Free("scale", "N", 0.6 * p.peak, 0.02 * p.peak, 20 * p.peak, 0.3 * p.peak, held_beside=("axis_gain",)),
        ),
        lambda v, p: augment.Stiffening(v[0], v[1]),
        lambda p: [(0.9, 0.6 * p.peak), (0.9, 0.1 * p.peak)],
        simpler=("axis_gain",),
        ahead=0.03,
        form={"axis_gain": 0.03, "saturation": 0.03, TAXEL_GAIN: 0.03},
        beyond=lambda v, p: abs(v[0] - 1) / 0.008,
        barred=bent_apart,
    )
)


def _least_band(problem: Problem) -> float:
    """Half-width (N) of a dead band that matters: half a count reads as 0 anyway, but for noise that reaches beyond."""
    told = problem.dither > 0.2 * problem.step
    return max(0.02, (0.45 if told else 0.55) * problem.step)


register_cause(
    Cause(
        "dead_band",
        80,
        lambda p: (
            Free("width", "N", 0.0, 0.0, 1.0, 0.05, _least_band(p)),
            Free("shrink", "1", 0.0, 0.0, 1.0, 0.3),
            Free("edge", "1", 0.2, 0.0, 1.0, 0.1, None, 0.1),
        ),
        lambda v, p: augment.DeadBand(v[0], v[1], v[2]),
        lambda p: [(width, 0.0, 0.2) for width in (0.06, 0.12, 0.2, 0.3)],
        form={
            **dict.fromkeys((TAXEL_GAIN, "interference"), 0.08),
            **dict.fromkeys(("stiffening", "axis_gain", "creep"), 0.004),
            "crosstalk": 0.008,
        },
        barred=bent_apart,
    )
)

register_cause(
    Cause(
        "saturation",
        81,
        lambda p: (
            Free("limit", "N", 1.2 * p.peak, 0.15 * p.peak, 3 * p.peak, 0.1 * p.peak, 0.2 * p.peak),
            Free("softness", "1", 0.3, 0.0, 1.0, 0.2),
        ),
        lambda v, p: augment.Saturation(-v[0], v[0], v[1]),
        lambda p: [(0.5 * p.peak, 0.2), (0.7 * p.peak, 0.2), (0.9 * p.peak, 0.2)],
        form={
            **dict.fromkeys(STATIC, 0.003),
            TAXEL_GAIN: 0.03,
            "interference": 0.006,
            **dict.fromkeys(("axis_coupling", "rotation"), 0.002),
        },
        beyond=lambda v, p: 1.2 * p.peak / v[0],  # what nothing reaches only bends, as a stiffening does
        barred=bent_apart,
    )
)
