"""Poisson: a pressed gel bulges sideways, and drags its neighbours outwards."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.cause import Cause, Free
from paxisim.diagnose.causes.channel_curve import no_neighbours

POISSON = Cause(
    "poisson",
    40,
    lambda v, p: augment.Poisson(v[0], v[1], reach=2.9),
    "probe",
    lambda p: (Free("cx", "1", 0.0, 0.0, 1.0, 0.05, 0.008), Free("cy", "1", 0.0, 0.0, 1.0, 0.05, 0.008)),
    lambda p: [(0.1, 0.0), (0.0, 0.1)],
    misfit=0.01,
    barred=no_neighbours,
)
