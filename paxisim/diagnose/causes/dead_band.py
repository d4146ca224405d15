"""Dead band: small forces are not read."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import bent_apart
from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import Free, Gauge, Values
from paxisim.diagnose.data.problem import FloatArray, Problem


def _least(problem: Problem) -> float:
    """Materiality of the half width (N): rounding alone suppresses half a count."""
    dithers = problem.noise.dither > 0.2 * problem.noise.step
    return max(0.02, (0.45 if dithers else 0.55) * problem.noise.step)


def _gain(values: Values, problem: Problem) -> FloatArray:
    return 1 / np.maximum(1 - values[0] * values[1] / problem.peaks, 0.2)


AT_PEAK_MEANING = "0 if the sensor reads changes of force correctly, 1 if it reads the peak force correctly"

DEAD_BAND = FittedCause(
    name="dead_band",
    order=80,
    make=lambda v, p: augment.DeadBand(v[0], v[1], v[2]),
    excites="light",
    free=lambda p: (
        Free("width", "N", 0.0, 0.0, 1.0, 0.05, _least(p)),
        Free("shrink", "1", 0.0, 0.0, 1.0, 0.3, words="share of the width that larger forces lose"),
        Free("edge", "1", 0.2, 0.0, 1.0, 0.1, spread=0.1, words="share of the width over which the reading sets in"),
    ),
    starts=lambda p: [(width, shrink, 0.2) for width in (0.06, 0.12, 0.2, 0.3) for shrink in (0.0, 1.0)],
    gauge=Gauge("calibrated_at_peak", _gain, AT_PEAK_MEANING, by_axis=True),
    misfit=0.01,
    barred=bent_apart,
    words="Small forces are not read.",
    picture="small_forces",
)
