"""Readings without a force: magnetic fields of the gripper, offsets and drift."""

import numpy as np

from hidden.exam.motions import TRAVEL
from hidden.exam.world import COUNT, Effect, size

GRID = np.linspace(0, TRAVEL, 161)


def dipole(moment, apart):
    """Return the field of a dipole at `apart` (..., 3), without the physical constant."""
    r = np.linalg.norm(apart, axis=-1, keepdims=True)
    along = np.sum(apart * moment, axis=-1, keepdims=True)
    return 3 * along * apart / r**5 - moment / r**3


def interference(rng, world, strength):
    """One or two magnets that pass by as the gripper opens, 0.2 to 5 counts over its travel."""
    count = int(rng.choice([1, 2]))
    taxels = np.concatenate([world.where, np.zeros((len(world.where), 1))], 1)
    field = np.zeros((len(GRID), world.pads, 3, len(world.where)))
    reach = np.hypot(*np.ptp(world.where, axis=0)) / 2
    for _ in range(count):
        moment = rng.normal(size=3)
        for pad in range(world.pads):
            aside = rng.normal(size=3)
            place = aside / np.linalg.norm(aside) * (reach + rng.uniform(0.015, 0.05))
            place[2] = abs(place[2]) + 0.008  # behind or beside the pad
            way = rng.normal(size=3) * [1, 1, 0.3]
            way /= np.linalg.norm(way)
            if way @ place < 0:  # it moves away as the gripper opens, so it never hits a taxel
                way = -way
            at = place + GRID[:, None] * way
            b = dipole(moment / np.linalg.norm(moment), taxels[None] - at[:, None])
            field[:, pad] += np.moveaxis(b, -1, 1) * np.linalg.norm(place) ** 3
    begins = rng.random() < 0.25
    zero = float(world.opening[0, 0]) if begins else float(rng.uniform(0, TRAVEL))
    counts = size(strength, 0.2, 5)
    field *= counts * COUNT / np.ptp(field, axis=0).max()
    field -= field[np.argmin(np.abs(GRID - zero))]

    def apply(force):
        place = world.opening / TRAVEL * (len(GRID) - 1)
        before = np.minimum(place.astype(int), len(GRID) - 2)
        part = (place - before)[..., None, None, None]
        out = np.empty_like(force)
        for i, opening in enumerate(world.opening):
            few = slice(0, 1) if np.ptp(opening) == 0 else slice(None)
            low, high = field[before[i, few]], field[before[i, few] + 1]
            out[i] = force[i] + low + part[i, few] * (high - low)
        return out

    return Effect({"counts": counts, "dipoles": count, "zero_opening": zero}, apply)


def offset(rng, world, strength):
    """A constant for each channel, 0.2 to 3 counts."""
    counts = size(strength, 0.2, 3)
    form = str(rng.choice(["each", "some", "smooth"]))
    unit = rng.uniform(0.5, 1.4, world.channels) * rng.choice([-1, 1], world.channels)
    if form == "some":
        keep = rng.random(world.channels) < 0.4
        unit = np.where(keep | ~keep.any(), unit, 0)
    if form == "smooth":  # as from a magnetised part nearby
        slope = rng.normal(size=(world.pads, 3, 2))
        plane = slope @ (world.where / np.abs(world.where).max()).T + rng.normal(size=(world.pads, 3, 1))
        unit = plane / np.sqrt(np.mean(plane**2))
    value = unit * counts * COUNT
    return Effect({"counts": counts, "form": form}, lambda force: force + value)


def drift(rng, world, strength):
    """A drifting zero, 0.5 to 10 % of the peak in 10 min."""
    share = size(strength, 0.005, 0.1)
    form = str(rng.choice(["logarithmic", "temperature", "two_exponentials"]))
    before = float(rng.choice([0.0, 1.0]) * rng.uniform(60, 300))
    scale, fast, slow, mix = rng.uniform(20, 200), rng.uniform(60, 200), rng.uniform(400, 1500), rng.uniform(0.3, 0.7)
    unit = rng.normal(size=world.channels)
    if rng.random() < 0.5:  # most channels drift in the same direction
        unit = 0.35 * unit + rng.choice([-1, 1], (1, 3, 1))
    unit /= np.sqrt(np.mean(unit**2))

    def curve(t):
        if form == "logarithmic":
            return np.log1p(t / scale) / np.log1p(600 / scale)
        two = mix * -np.expm1(-t / fast) + (1 - mix) * -np.expm1(-t / slow)
        return two / (mix * -np.expm1(-600 / fast) + (1 - mix) * -np.expm1(-600 / slow))

    if form == "temperature":
        t = world.temperature
        wander = (t - t[0, 0]) / np.abs(t - t[0, 0]).max() + 0.2 * before / 300
    else:
        wander = curve(world.clock + before) - curve(0.0)
    value = unit * share * world.peak[2]
    truth = {"share": share, "form": form, "zeroed_before": before}
    return Effect(truth, lambda force: force + wander[..., None, None, None] * value)
