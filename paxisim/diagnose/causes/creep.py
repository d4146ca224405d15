"""Creep: under a constant load the reading keeps changing, and it recovers slowly after release."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.cause import Cause, Free, Gauge

HELD = "0 if the sensor reads right at once, 1 if it reads right after creep has ended"

CREEP = Cause(
    "creep",
    20,
    lambda v, p: augment.Creep((v[0], v[2]), (v[1], v[3])),
    "holds",
    lambda p: (
        Free("amplitude_1", "1", 0.0, -0.5, 1.5, 0.05, 0.012),
        Free("tau_1", "s", 0.6, 0.15, 20.0, 0.4),
        Free("amplitude_2", "1", 0.0, -0.5, 1.5, 0.05, 0.012),
        Free("tau_2", "s", 5.0, 0.15, 200.0, 3.0),
    ),
    lambda p: [(0.1, tau, 0.0, 5.0 if tau < 3 else 0.5) for tau in (0.3, 1.0, 3.0, 10.0)],
    gauge=Gauge("calibrated_held", lambda v, p: 1 / max(1 + v[0] + v[2], 0.2), HELD),
    remembers=True,
    misfit=0.01,
    words="Under a constant load the reading keeps changing, and it recovers slowly after release.",
    picture="holds",
)
