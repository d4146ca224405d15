"""What a diagnosis says of an effect, against what was hidden, although the two have other parameters.

The same experiment is done on the hidden effect, at 500 Hz, and on the fitted one, and what it reads is compared: see
`experiments`.

The error is relative to how far the hidden effect is from doing nothing, which is stricter than relative to a number
such as a gain. Intervals are those of parameters, so that they are checked only where a parameter is one figure of the
hidden effect: see `figures`.
"""

from dataclasses import dataclass

import numpy as np

from hidden.practice.experiments import EXPERIMENTS, Bench
from hidden.practice.figures import TRUE_PARAMETERS

LITTLE = 0.02  # of the floor: where there is less headroom no share of it is given


@dataclass
class Compared:
    """How near a diagnosis came to an effect.

    Attributes:
        error: of what the experiment reads, over its distance from neutral.
        inside: how many of the intervals hold the truth. intervals: how many there are.
    """

    error: float
    inside: int = 0
    intervals: int = 0


def compare(name, case, run, parameters):
    """How near a diagnosis came to the effect `name` of a case.

    Args:
        name: of the effect; it must be in the case and in the diagnosis.
        case: the recording.
        run: the fitted transform, ``run(x, time, covariates)`` on (T, pads, 3, rows, cols).
        parameters: (value, low, high) by name; low and high may be None.
    """
    bench = Bench(case, name, run)
    true, fitted, neutral = (np.asarray(v, dtype=float) for v in EXPERIMENTS[name](bench))
    error = float(np.linalg.norm(fitted - true) / max(np.linalg.norm(true - neutral), 1e-9))
    known = TRUE_PARAMETERS[name](case, parameters) if name in TRUE_PARAMETERS else {}
    asked = [(known[n], low, high) for n, (_, low, high) in parameters.items() if n in known and low is not None]
    return Compared(error, sum(low <= value <= high for value, low, high in asked), len(asked))


def headroom_share(case, before, after):
    """How much of the headroom above what the hidden effects themselves leave a model takes away, in energy.

    Args:
        case: made with ``ideal=True``.
        before, after: root mean square error of simulation and model over that of the measured force.

    Returns:
        1 for a model as good as the hidden effects put on the same simulation; None where there is next to no headroom.
    """
    if case.ideal is None:
        return None
    measured = case.measured.astype(float)
    floor = np.sum((measured - case.ideal) ** 2) / np.sum(measured**2)
    room = before**2 - floor
    return float((before**2 - after**2) / room) if room > LITTLE * floor else None
