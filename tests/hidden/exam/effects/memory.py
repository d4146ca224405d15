"""Creep: readings that keep changing under a constant load."""

import numpy as np
from scipy.optimize import nnls
from scipy.signal import lfilter

from hidden.exam.world import RATE, Effect, size


def fractional(tau, order):
    """Return relaxation times and weights of 1 - E(-(t / tau)^order), with the spectrum of the Mittag-Leffler E."""
    times = tau * np.logspace(-2, 2, 11)
    s = (tau / times) ** order
    weights = s * np.sin(order * np.pi) / (s**2 + 2 * s * np.cos(order * np.pi) + 1)
    return times, weights / weights.sum()


def logarithmic(tau, decades):
    """Return relaxation times and weights of log(1 + t), with equal weights over `decades`."""
    times = tau * np.logspace(-decades / 2, decades / 2, 9)
    return times, np.full(9, 1 / 9)


def stretched(tau, order):
    """Return relaxation times and weights of 1 - exp(-(t / tau)^order), by least squares."""
    times, t = tau * np.logspace(-2, 1.5, 10), tau * np.logspace(-3, 2, 120)
    weights, _ = nnls(np.exp(-t[:, None] / times), np.exp(-((t / tau) ** order)))
    keep = weights > 1e-3
    return times[keep], weights[keep] / weights[keep].sum()


STRIDE = 5
SLOW = 0.25
"""Relaxation times from this (s) on are computed on every fifth step only."""


def followed(rows, start, place, times, weights, rate):
    """Return the weighted sum of lagged `rows`, including what remains from earlier episodes.

    Args:
        rows: (rows, steps) forces, linear between steps.
        start: (episodes,) start times, s.
        place: (episodes, channels) whether a channel has a row in an episode.
        times, weights: relaxation times (s) and their weights.
        rate: steps per second.

    Returns:
        The lagged forces (episodes, channels, steps).
    """
    steps = rows.shape[1]
    length = (steps - 1) / rate
    out = np.zeros((*place.shape, steps))
    total = np.zeros_like(rows)
    for tau, weight in zip(times, weights, strict=True):
        keep = np.exp(-1 / rate / tau)
        mean = (1 - keep) * tau * rate
        state = lfilter([weight * (1 - mean), weight * (mean - keep)], [1, -keep], rows, axis=1)
        total += state
        ends = np.zeros(place.shape)
        ends[place] = state[:, -1]
        fade = np.exp(-np.arange(steps) / rate / tau)
        left = np.zeros(place.shape[1])
        for i in range(len(start)):
            if i:
                left = left * np.exp(-(start[i] - start[i - 1] - length) / tau)
                if np.abs(left).max(initial=0) > 1e-5:
                    out[i] += left[:, None] * fade
            left = left * np.exp(-length / tau) + ends[i]
    out[place] += total
    return out


def relaxed(force, world, times, weights):
    """Return the force lagged with these relaxation times, with memory of earlier episodes across the pauses."""
    episodes, steps = force.shape[:2]
    flat = np.moveaxis(force.reshape(episodes, steps, -1), 1, 2)
    place = np.any(flat != 0, axis=2)
    rows = np.ascontiguousarray(flat[place])
    slow = times >= SLOW
    out = np.zeros((*place.shape, steps))
    if slow.any():
        coarse = followed(rows[:, ::STRIDE], world.start, place, times[slow], weights[slow], RATE / STRIDE)
        coarse = np.concatenate([coarse, coarse[..., -1:]], axis=2)
        for k in range(STRIDE):
            part = out[..., k::STRIDE]
            low, high = coarse[..., : part.shape[2]], coarse[..., 1 : part.shape[2] + 1]
            part[:] = low + k / STRIDE * (high - low)
    if not slow.all():
        out += followed(rows, world.start, place, times[~slow], weights[~slow], RATE)
    return np.moveaxis(out, 2, 1).reshape(force.shape)


def creep(rng, world, strength):
    """A delayed response of 2 to 25 %, with a time constant of 0.2 to 60 s.

    A sensor calibrated with quick loads is right at once and ends too high; one calibrated with held loads starts too
    low and ends right.
    """
    share = size(strength, 0.02, 0.25)
    form = str(rng.choice(["fractional", "logarithmic", "stretched"]))
    tau = float(np.exp(rng.uniform(np.log(0.2), np.log(60))))
    order, decades = rng.uniform(0.4, 0.85), rng.uniform(1.5, 3)
    if form == "logarithmic":
        times, weights = logarithmic(tau, decades)
    else:
        times, weights = (fractional if form == "fractional" else stretched)(tau, order)
    held = float(rng.choice([0.0, 1.0, rng.random()]))

    def apply(force):
        return (1 - held * share) * force + share * relaxed(force, world, times, weights)

    truth = {"share": share, "tau": tau, "form": form, "right_when_held": held}
    return Effect(truth, apply)
