"""Memoryless curves from force to reading: stiffening, saturation and dead band."""

import numpy as np

from hidden.practice.effects.common import COUNT, between, forms, sign


@forms("cubic", "power", "hardening")
def stiffening(rng, pad, strength, form):
    """Stiffening with a calibration force drawn up to the peak."""
    side, right_at = sign(rng), rng.uniform(0.05, 1.0)
    if form == "power":
        bend = between(0.03, 0.5 if side > 0 else 0.3, strength) * side
    else:
        bend = between(0.04, 0.35, strength) * side

    def gain(size):
        if form == "cubic":
            return 1 + bend * (-1.6 * size + 0.8 * size**2 + 1.6 * right_at - 0.8 * right_at**2)
        if form == "power":
            return ((size + 0.01) / (right_at + 0.01)) ** bend
        return 1 + bend * (size - right_at)

    def apply(f, e):
        # the first two depend on the norm of a taxel's force, the third on each axis separately
        size = np.abs(f) if form == "hardening" else np.linalg.norm(f, axis=2, keepdims=True)
        return f * gain(size / pad.peak)

    return apply, {"bend": bend, "right_at": right_at}


@forms("knee", "clip", "slow")
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
        start = (1 - knee) * limit
        return np.where(size > start, start + knee * limit * np.tanh((size - start) / (knee * limit)), size)

    gain = pad.peak / float(curve(np.array(pad.peak))) if right_at == "peak" else 1.0
    return lambda f, e: gain * np.sign(f) * curve(np.abs(f)), {"limit": limit, "right_at": right_at}


@forms("logistic", "gate", "shrink")
def dead_band(rng, pad, strength, form):
    """Dead band; `shrink` also subtracts the width from larger forces, with or without a gain that fits the peak."""
    width = between(0.5, 3.0, strength) * COUNT
    soft = 0.12 * width
    right_at = ("edge", "peak")[rng.integers(2)] if form == "shrink" else "above"
    gain = pad.peak / (pad.peak - width) if right_at == "peak" else 1.0

    def apply(f, e):
        size = np.abs(f)
        if form == "logistic":
            return f / (1 + np.exp(-np.clip((size - width) / soft, -50, 50)))
        if form == "gate":
            return np.where(size > width, f, 0.0)
        return gain * np.sign(f) * np.maximum(size - width, 0)

    return apply, {"width": width, "right_at": right_at}
