"""What remembers how hard a taxel was pressed: creep and hysteresis."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.cause import TAXEL_GAIN, Cause, Free, one_away, register_cause

register_cause(
    Cause(
        "creep",
        20,
        lambda p: (
            Free("amplitude_1", "1", 0.0, -0.5, 1.0, 0.05, 0.012),
            Free("tau_1", "s", 0.6, 0.15, 20.0, 0.4),
            Free("amplitude_2", "1", 0.0, -0.5, 1.0, 0.05, 0.012),
            Free("tau_2", "s", 5.0, 0.15, 200.0, 3.0),
        ),
        lambda v, p: augment.Creep((v[0], v[2]), (v[1], v[3])),
        lambda p: [(0.1, tau, 0.0, 1.0) for tau in (0.3, 1.0, 3.0, 10.0)],
        form={
            **dict.fromkeys(("stiffening", "saturation"), 0.004),
            "interference": 0.008,
            TAXEL_GAIN: 0.03,
            **dict.fromkeys(("axis_coupling", "rotation", "dead_band"), 0.003),
            "poisson": 0.002,
        },
    )
)

_RADII = (0.02, 0.06, 0.15, 0.4)  # of the peak

register_cause(
    Cause(
        "hysteresis",
        30,
        lambda p: tuple(Free(f"weight_{r:g}_peak", "1", 0.0, 0.0, 0.24, 0.05, 0.012) for r in _RADII),
        lambda v, p: augment.Hysteresis(tuple(v), tuple(r * p.peak for r in _RADII)),
        lambda p: [one_away(4, i, 0.0, 0.1) for i in range(4)],
        simpler=("axis_gain",),  # the static part of a loop is a gain
        form={
            **dict.fromkeys(("creep", "stiffening", TAXEL_GAIN), 0.1),
            **dict.fromkeys(("crosstalk", "axis_gain"), 0.08),
            "interference": 0.015,
            "saturation": 0.005,
            "poisson": 0.003,
            "axis_coupling": 0.002,
        },
        absorbs={TAXEL_GAIN: 0.02, "crosstalk": 0.005},
        absorbers=("stiffening", "axis_gain"),
    )
)
