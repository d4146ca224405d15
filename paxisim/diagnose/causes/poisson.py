"""Poisson: the pressed gel bulges sideways and shears the neighbouring taxels outwards."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.cause import Cause, Free
from paxisim.diagnose.causes.channel_curve import no_neighbours

POISSON = Cause(
    "poisson",
    40,
    # rounded to 0.01, because each falloff needs its own kernel
    lambda v, p: augment.Poisson(v[0], v[1], reach=2.9, falloff=round(v[2], 2)),
    "probe",
    lambda p: (
        Free("cx", "1", 0.0, 0.0, 1.0, 0.05, 0.008),
        Free("cy", "1", 0.0, 0.0, 1.0, 0.05, 0.008),
        # two forms: nearly the gradient of the load (short falloff), or a long-range push (long falloff)
        Free("falloff", "pitch", 1.0, 0.2, 4.0, 0.6, spread=2.0, words="decay length of the push on the neighbours"),
    ),
    lambda p: [(0.1, 0.0, 1.0), (0.0, 0.1, 1.0), (0.1, 0.1, 0.4)],
    misfit=0.03,
    barred=no_neighbours,
    words="The pressed gel bulges sideways and shears the neighbouring taxels outwards.",
    picture="outward_shear",
)
