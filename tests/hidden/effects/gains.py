"""Gains, offsets, quantisation and dead taxels."""

import numpy as np

from hidden.effects.common import COUNT, between, forms, sign, smooth


@forms("independent", "one_axis", "common")
def axis_gain(rng, pad, strength, form):
    size = between(0.03, 0.30, strength)
    if form == "independent":
        gain = 1 + size * sign(rng, 3) * rng.uniform(0.7, 1.0, 3)
    elif form == "one_axis":
        gain = 1 + size * sign(rng) * np.eye(3)[rng.integers(3)]
    else:  # an amplifier before all three
        gain = 1 + size * sign(rng) * (1 + 0.1 * rng.standard_normal(3))
    return lambda f, e: f * gain[:, None], {"gain": gain}


@forms("lognormal", "smooth", "not_mean_one", further=("one_sided", "by_channel"))
def taxel_gain(rng, pad, strength, form):
    sigma = between(0.03, 0.20, strength)
    shape = (pad.pads, 3 if form == "by_channel" else 1, len(pad.where))
    own = smooth(rng, pad, pad.pads, 1) if form == "smooth" else rng.standard_normal(shape)
    mean = sigma * sign(rng) * rng.uniform(0.5, 1.5) if form == "not_mean_one" else 0.0
    gain = np.exp(sigma * own + mean)
    if form == "one_sided":  # magnets that have lost strength
        gain = np.maximum(1 - 1.66 * sigma * np.abs(own), 0.1)
    return lambda f, e: f * gain, {"sigma": sigma, "gain": gain}


@forms("uniform", "sparse", "smooth")
def offset(rng, pad, strength, form):
    size = between(0.2, 3.0, strength) * COUNT
    shape = (pad.pads, 3, len(pad.where))
    if form == "smooth":
        value = size * (0.7 * sign(rng, pad.pads, 3, 1) + 0.3 * smooth(rng, pad, pad.pads, 3))
    else:
        value = size * sign(rng, *shape) * rng.uniform(0.5, 1.0, shape)
    if form == "sparse":  # fewer, but larger
        some = rng.permutation(value.size).reshape(shape) < max(3, round(0.2 * value.size))
        value = np.where(some, 1.5 * value, 0.0)
    value[:, 2] = np.abs(value[:, 2])  # a normal reading cannot be negative
    return lambda f, e: f + value, {"offset": value}


@forms("round", "floor", further=("by_axis",))
def quantisation(rng, pad, strength, form):
    """Rounding; `floor` reads the middle of the step that contains the force, half a step off the grid of `round`.

    `by_axis`: the field is rounded, so that the steps of x and y are finer and coarser than that of z.
    """
    step = between(0.15, 0.6, strength)
    return lambda f, e: f, {"step": step}  # applied by the electronics, after the noise


@forms("zero", "stuck", "faint")
def dead_taxels(rng, pad, strength, form):
    count = 1 + round(3 * strength)
    loaded = np.argsort(np.linalg.norm(pad.where, axis=1))[: max(count, len(pad.where) // 2)]
    which = [(int(rng.integers(pad.pads)), int(i)) for i in rng.choice(loaded, count, replace=False)]
    level = rng.uniform(2, 8, count) * COUNT if form == "stuck" else np.zeros(count)
    left = 0.03 if form == "faint" else 0.0

    def apply(f, e):
        out = f.copy()
        for (p, i), value in zip(which, level, strict=True):
            out[:, p, :, i] = value + left * f[:, p, :, i]
        return out

    return apply, {"taxels": which}
