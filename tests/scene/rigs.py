"""Motions of the ready-made scenes, and recordings of them."""

import numpy as np

from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

LAYOUT = TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
ENCODER = 5e-5  # m


def path(time, knots, values):
    """Minimum-jerk moves from value to value, at rest at each knot."""
    knots, values = np.asarray(knots, float), np.asarray(values, float)
    i = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
    u = np.clip((time - knots[i]) / (knots[i + 1] - knots[i]), 0, 1)
    return values[i] + u**3 * (10 - 15 * u + 6 * u**2) * (values[i + 1] - values[i])


def steps_of(values, step=ENCODER):
    """As an encoder of that resolution reads them."""
    return np.round(values / step) * step


def recording(time, covariates, pads=1, measured=None, **more):
    """A recording of those streams; forces of zero where none are given."""
    if measured is None:
        measured = np.zeros((len(time), pads, *LAYOUT.shape), np.float32)
    return Recording(time, measured, covariates=covariates, layout=LAYOUT, **more)


def press(rate=100.0, seconds=8.0, depth=1.7e-3):
    """Streams of the indenter: a press that is held, a tap, a staircase, at two places; lengths in m."""
    time = np.arange(round(seconds * rate)) / rate
    knots = np.array([0, 0.3, 1, 2, 2.6, 3.2, 3.4, 3.6, 4.4, 5, 5.6, 6.2, 6.8, 7.4, 8])
    shares = np.array([0, 0, 1, 1, 0, 0, 0.5, 0, 0, 0.4, 0.4, 0.8, 0.8, 0, 0])
    place = path(time, [0, 3.7, 4.3, 8], [0, 0, 1, 1])
    return time, {
        "x": 3e-3 * place,
        "y": -4e-3 * place,
        "depth": -0.5e-3 + (depth + 0.5e-3) * path(time, knots, shares),
    }


def total(tensor):
    """``(T,)`` the sum of all normal forces."""
    return tensor[:, :, 2].astype(float).sum(axis=(1, 2, 3))
