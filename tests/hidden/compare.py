"""Comparison of diagnosed effects with hidden ones, although the two have different parameters.

The same experiment runs on the hidden effect, at 500 Hz, and on the fitted one, and the readings are compared: see
`experiments`.

The error is relative to the distance of the hidden effect from no effect, which is stricter than an error relative to a
value such as a gain. Intervals belong to parameters, so they are checked only for parameters that the hidden effect has
too: see `figures`.
"""

from dataclasses import dataclass

import numpy as np

from hidden.experiments import EXPERIMENTS, Bench
from hidden.figures import TRUE_PARAMETERS

LITTLE = 0.02  # smallest headroom, relative to the floor, for which a share is computed


@dataclass
class Compared:
    """Agreement of a diagnosis with a hidden effect.

    Attributes:
        error: error of the experiment's reading, relative to the distance of the true reading from neutral.
        inside: number of intervals that contain the truth.
        intervals: number of intervals.
    """

    error: float
    inside: int = 0
    intervals: int = 0


def compare(name, case, run, parameters):
    """Compare a diagnosis with the effect `name` of a case.

    Args:
        name: name of the effect, which must be in the case and in the diagnosis.
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
    """Return the share of the headroom that a model removes: the error energy above the floor of the true effects.

    Args:
        case: the recording, made with ``ideal=True``.
        before, after: root mean square errors of simulation and model, relative to that of the measured force.

    Returns:
        1 for a model as good as the true effects applied to the same simulation; None if there is hardly any headroom.
    """
    if case.ideal is None:
        return None
    measured = case.measured.astype(float)
    floor = np.sum((measured - case.ideal) ** 2) / np.sum(measured**2)
    room = before**2 - floor
    return float((before**2 - after**2) / room) if room > LITTLE * floor else None
