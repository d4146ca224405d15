"""Memoryless curves from force to reading: stiffening, dead band, saturation, rounding."""

import numpy as np
from scipy.optimize import brentq

from hidden.exam.world import COUNT, Effect, size


def ogden(stretch, power):
    """Return the nominal stress of one Ogden term in simple tension."""
    return stretch ** (power - 1) - stretch ** (-power / 2 - 1)


def bent(form, bend, power):
    """Return a curve through (0, 0) and (1, 1) whose value in the middle is (1 + bend) / 2."""
    if form == "rational":
        q = (1 + bend) / (1 - bend)
        return lambda u: q * u / (1 + (q - 1) * u)
    if form == "exponential":
        b = -2 * np.log((1 + bend) / (1 - bend))  # the value in the middle is the logistic function of -b / 2
        return lambda u: np.expm1(b * u) / np.expm1(b)
    if bend < 0:  # compression

        def curve(u, strain):
            return ogden(1 - strain * u, power) / ogden(1 - strain, power)

        high = 0.75
    else:  # tension

        def curve(u, strain):
            return ogden(1 + strain * u, 1.0) / ogden(1 + strain, 1.0)

        high = 4.0
    strain = brentq(lambda e: curve(0.5, e) - (1 + bend) / 2, 1e-4, high)
    return lambda u: curve(u, strain)


def stiffening(rng, world, strength):
    """A nonlinear response that differs at half of the peak by 3 to 28 % from a straight line to the peak."""
    bend = size(strength, 0.03, 0.28) * rng.choice([-1, 1])
    form = str(rng.choice(["exponential", "ogden", "rational"]))
    curve = bent(form, bend, rng.uniform(2, 5))
    right, by_vector = rng.uniform(0, 1), rng.random() < 0.6
    reference = curve(np.maximum(right, 1e-3)) / np.maximum(right, 1e-3)

    def gain(u):
        u = np.clip(u, 1e-3, 1.25)
        return curve(u) / u / reference

    def apply(force):
        if by_vector:
            return force * gain(np.sqrt(np.sum(force**2, axis=3, keepdims=True)) / world.peak[2])
        return force * gain(np.abs(force) / world.peak[:, None])

    truth = {"bend": bend, "form": form, "right_at": right, "of": "vector" if by_vector else "channel"}
    return Effect(truth, apply)


def dead_band(rng, world, strength):
    """A dead band of 0.5 to 3 counts for small forces."""
    counts = size(strength, 0.5, 3)
    width = counts * COUNT
    form = str(rng.choice(["shrink", "gate", "smooth"]))
    right = str(rng.choice(["small", "peak"])) if form != "gate" else "above"

    def curve(x):
        if form == "gate":
            return np.where(x >= width, x, 0)
        if form == "shrink":
            return np.maximum(x - width, 0)
        return x + width * np.expm1(-x / width)

    gain = np.minimum(world.peak / np.maximum(curve(world.peak), 1e-6), 1.5) if right == "peak" else np.ones(3)
    truth = {"counts": counts, "form": form, "right_at": right}
    return Effect(truth, lambda force: np.sign(force) * curve(np.abs(force)) * gain[:, None])


def saturation(rng, world, strength):
    """A limit of the readings at 95 down to 40 % of the peak."""
    share = size(strength, 0.95, 0.4)
    form = str(rng.choice(["clip", "langevin", "rational"]))
    power, right = rng.uniform(2.5, 5), str(rng.choice(["small", "peak"]))
    level = share * (world.peak if rng.random() < 0.6 else world.peak[2] * np.ones(3))

    def curve(x, end):
        if form == "clip":
            return np.minimum(x, end)
        u = x / end
        if form == "rational":
            return x / (1 + u**power) ** (1 / power)
        v = np.maximum(3 * u, 1e-2)
        return np.where(u < 1e-2 / 3, x, end * (1 / np.tanh(v) - 1 / v))

    gain = world.peak / curve(world.peak, level) if right == "peak" else np.ones(3)
    truth = {"share": share, "form": form, "right_at": right}
    return Effect(truth, lambda force: np.sign(force) * curve(np.abs(force), level[:, None]) * gain[:, None])


def quantisation(rng, world, strength):
    """Rounding to steps of 0.15 to 0.6 N, after the noise."""
    step = size(strength, 0.15, 0.6)
    form = str(rng.choice(["round", "mid_rise", "field"]))
    scale = rng.uniform(0.85, 1.15, 3)[:, None] * np.ones(world.channels)

    def apply(reading):
        if form == "mid_rise":  # never zero, but half a step above or below
            return (np.floor(reading / step) + 0.5) * step
        unit = step * scale if form == "field" else step
        return np.round(reading / unit) * unit

    return Effect({"step": step, "form": form}, apply, on_frames=True)
