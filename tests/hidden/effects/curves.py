"""Memoryless curves from force to reading: stiffening, saturation and dead band."""

import numpy as np

from hidden.effects.common import COUNT, between, forms, sign


def bent(form, bend):
    """Return a curve through (0, 0) and (1, 1) whose value in the middle is (1 + bend) / 2."""
    if form == "rational":
        q = (1 + bend) / (1 - bend)
        return lambda u: q * u / (1 + (q - 1) * u)
    b = -2 * np.log((1 + bend) / (1 - bend))  # the value in the middle is the logistic function of -b / 2
    return lambda u: np.expm1(b * u) / np.expm1(b)


@forms("cubic", "power", "hardening", further=("exponential", "rational"))
def stiffening(rng, pad, strength, form):
    """Stiffening with a calibration force drawn up to the peak."""
    side, right_at = sign(rng), rng.uniform(0.05, 1.0)
    if form == "power":
        bend = between(0.03, 0.5 if side > 0 else 0.3, strength) * side
    elif form in ("exponential", "rational"):
        bend = between(0.03, 0.28, strength) * side
        curve = bent(form, bend)
    else:
        bend = between(0.04, 0.35, strength) * side

    def gain(size):
        if form == "cubic":
            return 1 + bend * (-1.6 * size + 0.8 * size**2 + 1.6 * right_at - 0.8 * right_at**2)
        if form == "power":
            return ((size + 0.01) / (right_at + 0.01)) ** bend
        if form == "hardening":
            return 1 + bend * (size - right_at)
        size = np.clip(size, 1e-3, 1.25)
        return curve(size) / size * right_at / curve(right_at)

    def apply(f, e):
        # these two depend on each axis separately, the others on the norm of a taxel's force
        size = np.abs(f) if form in ("hardening", "rational") else np.linalg.norm(f, axis=2, keepdims=True)
        return f * gain(size / pad.peak)

    return apply, {"bend": bend, "right_at": right_at}


@forms("knee", "clip", "slow", further=("langevin",))
def saturation(rng, pad, strength, form):
    """Saturation calibrated at small forces, or at the peak with a gain."""
    limit = (0.95 - 0.55 * strength) * pad.peak
    knee, power = rng.uniform(0.1, 0.3), rng.uniform(3.0, 8.0)
    right_at = ("small", "peak")[rng.integers(2)]

    def curve(size):
        if form == "clip":
            return np.minimum(size, limit)
        if form == "slow":
            return size / (1 + (size / limit) ** power) ** (1 / power)
        if form == "langevin":  # alignment of magnetic moments
            u = np.maximum(3 * size / limit, 1e-2)
            return np.where(u > 1e-2, limit * (1 / np.tanh(u) - 1 / u), size)
        start = (1 - knee) * limit
        return np.where(size > start, start + knee * limit * np.tanh((size - start) / (knee * limit)), size)

    gain = pad.peak / float(curve(np.array(pad.peak))) if right_at == "peak" else 1.0
    return lambda f, e: gain * np.sign(f) * curve(np.abs(f)), {"limit": limit, "right_at": right_at}


@forms("logistic", "gate", "shrink", further=("gradual",))
def dead_band(rng, pad, strength, form):
    """Dead band; `shrink` and `gradual` take the width off all forces, with or without a gain that fits the peak."""
    width = between(0.5, 3.0, strength) * COUNT
    soft = 0.12 * width
    right_at = ("edge", "peak")[rng.integers(2)] if form in ("shrink", "gradual") else "above"
    gain = pad.peak / (pad.peak - width) if right_at == "peak" else 1.0

    def apply(f, e):
        size = np.abs(f)
        if form == "logistic":
            return f / (1 + np.exp(-np.clip((size - width) / soft, -50, 50)))
        if form == "gate":
            return np.where(size > width, f, 0.0)
        if form == "gradual":
            return gain * np.sign(f) * (size + width * np.expm1(-size / width))
        return gain * np.sign(f) * np.maximum(size - width, 0)

    return apply, {"width": width, "right_at": right_at}
