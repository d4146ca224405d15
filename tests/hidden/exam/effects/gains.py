"""Gains by axis and by taxel, and dead taxels."""

import numpy as np
from scipy.ndimage import gaussian_filter

from hidden.exam.world import Effect, size


def axis_gain(rng, world, strength):
    """A gain per axis, sometimes the same for all axes, 3 to 30 %."""
    share = size(strength, 0.03, 0.3)
    common = rng.random() < 0.25
    unit = rng.uniform(0.3, 1, 3) * rng.choice([-1, 1], 3)
    unit /= np.abs(unit).max()
    if common:
        unit[:] = rng.choice([-1, 1])
    gain = 1 + share * unit
    return Effect({"gain": gain.tolist(), "common": common}, lambda force: force * gain[:, None])


def taxel_gain(rng, world, strength):
    """Gains that vary between taxels, with a sigma of 3 to 20 %."""
    sigma = size(strength, 0.03, 0.2)
    form = str(rng.choice(["lognormal", "one_sided", "smooth"]))
    channels = world.channels if rng.random() < 0.5 else (world.pads, 1, len(world.where))
    unit, level = rng.normal(size=channels), rng.uniform(-1, 1)
    if form == "smooth":
        grid = unit.reshape(*channels[:2], world.rows, world.cols)
        unit = gaussian_filter(grid, (0, 0, 1.2, 1.2), mode="nearest").reshape(channels)
        unit = (unit - unit.mean(axis=2, keepdims=True)) / np.std(unit, axis=2, keepdims=True)
    gain = np.exp(sigma * unit) if form == "lognormal" else np.maximum(1 + sigma * unit, 0.1)
    if form == "one_sided":  # some magnets have lost strength
        gain = np.maximum(1 - 1.66 * sigma * np.abs(unit), 0.1)
    mean_one = rng.random() < 0.5
    gain = gain / gain.mean() if mean_one else gain * (1 + 0.5 * sigma * level)
    each = "channel" if channels[1] == 3 else "taxel"
    return Effect({"sigma": sigma, "form": form, "of": each, "mean_one": mean_one}, lambda force: force * gain)


def dead_taxels(rng, world, strength):
    """One to four pressed taxels that read nothing, a constant, or 3 % of the force."""
    count = 1 + round(3 * strength)
    form = str(rng.choice(["dead", "stuck", "weak"]))
    pressed = np.argwhere(world.load > 0.1 * world.load.max())
    chosen = rng.permutation(pressed)[:count]
    level = np.round(rng.uniform(0.2, 2, (4, 3)) * [0.3, 0.3, 1], 1)[: len(chosen)]

    def apply(values):
        out = values.copy()
        for (pad, taxel), constant in zip(chosen, level, strict=True):
            if form == "weak":
                out[..., pad, :, taxel] *= 0.03
            else:
                out[..., pad, :, taxel] = constant if form == "stuck" else 0.0
        return out

    places = [(int(pad), int(taxel) // world.cols, int(taxel) % world.cols) for pad, taxel in chosen]
    return Effect({"taxels": places, "form": form}, apply, on_frames=form != "weak")
