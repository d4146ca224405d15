"""Hysteresis: loading and unloading curves differ, at any speed."""

import numpy as np

from hidden.exam.world import Effect, size


def dahl(u, width, power):
    """Return Dahl's friction, -1 to 1, of `u` (steps, channels); it reverses over about `width`."""
    out = np.zeros_like(u)
    state = np.zeros(u.shape[1], u.dtype)
    for i, step in enumerate(np.diff(u, axis=0), start=1):
        way = np.sign(step)
        left, far = 1 - state * way, np.abs(step) / width
        left = left * np.exp(-far) if power == 1 else left / (1 + left * far)
        state = np.where(way == 0, state, way * (1 - left))
        out[i] = state
    return out


def slips(u, limits, weights):
    """Return the sum, -1 to 1, of springs that slip at their limits."""
    out = np.zeros_like(u)
    limits = limits[:, None].astype(u.dtype)
    gain = (weights / limits[:, 0]).astype(u.dtype)
    state = np.zeros((len(limits), u.shape[1]), u.dtype)
    for i, step in enumerate(np.diff(u, axis=0), start=1):
        state += step
        np.minimum(state, limits, out=state)
        np.maximum(state, -limits, out=state)
        out[i] = gain @ state
    return out


def relays(u, up, down, weights, ramp):
    """Return Preisach's relays with ramps: on when |u| rises past `up`, off when it falls below `down` or is zero."""
    x = np.abs(u)
    out = np.zeros_like(u)
    state = np.zeros((len(up), u.shape[1]), u.dtype)
    up, down = (np.asarray(v, u.dtype)[:, None] for v in (up, down))
    weights = weights.astype(u.dtype)
    low, high = np.empty_like(state), np.empty_like(state)
    for i, now in enumerate(x / u.dtype.type(ramp)):
        np.subtract(now, up / ramp, out=low)
        np.subtract(now, down / ramp, out=high)
        np.maximum(low, 0, out=low)
        np.minimum(low, 1, out=low)
        np.maximum(high, 0, out=high)
        np.maximum(state, low, out=state)
        np.minimum(state, high, out=state)
        out[i] = weights @ state
    return out * np.sign(u)


def drawn(rng):
    """Draw a form and its operator on forces in units of the peak; its range is 1 at the loaded peak, or -1 to 1."""
    form = str(rng.choice(["preisach", "dahl", "maxwell_slip"]))
    width, power = rng.uniform(0.25, 0.6), int(rng.integers(1, 3))
    spread, middle = rng.uniform(0.3, 0.8), rng.uniform(0.25, 0.5)
    levels = np.arange(6) / 6
    up, down = (grid[np.tril_indices(6)] for grid in np.meshgrid(levels, levels, indexing="ij"))
    density = np.exp(-(((up - down) / rng.uniform(0.3, 0.7)) ** 2)) * rng.uniform(0.5, 1.5, len(up))
    if form == "preisach":
        density /= density.sum()
        return form, lambda u: relays(u, up, down, density, 1 / 6)
    if form == "dahl":
        return form, lambda u: -dahl(u, width, power)
    limits = np.exp(np.log(middle) + spread * np.linspace(-2, 2, 9))
    weights = np.exp(-(np.linspace(-2, 2, 9) ** 2) / 2)
    return form, lambda u: -slips(u, np.minimum(limits, 1), weights / weights.sum())


def hysteresis(rng, world, strength):
    """A loop whose loading and unloading curves differ by at most 2 to 15 % of the peak.

    The sensor is calibrated for small forces, at the peak, or in the middle of the loop.
    """
    loop = size(strength, 0.02, 0.15)
    form, operator = drawn(rng)
    right = str(rng.choice(["small", "peak", "middle"]))
    u = np.concatenate([np.linspace(0, 1, 201), np.linspace(1, 0, 201)])[:, None]
    trial = operator(u)[:, 0]
    wide = np.max(trial[201:][::-1] - trial[:201])

    def gained(part):
        both = (1 - part * (form == "preisach")) * u[:, 0] + part * trial
        there, back = both[:201], both[201:][::-1]
        return {"small": 0.05 / there[10], "peak": 1 / there[-1], "middle": 1 / (there[100] + back[100])}[right]

    parts = np.linspace(0, 0.6, 601)
    loops = [gained(p) * p * wide if gained(p) > 0 else np.inf for p in parts]
    part = float(np.interp(loop, np.maximum.accumulate(loops), parts))
    gain, keep = gained(part), 1 - part * (form == "preisach")
    peak = world.peak[:, None]

    def apply(force):
        flat = np.moveaxis(force / peak, 1, 0)
        flat = flat.reshape(len(flat), -1).astype(np.float32)
        out = np.zeros_like(flat)
        used = np.abs(flat).max(axis=0) > 1e-3
        out[:, used] = operator(flat[:, used])
        shape = np.moveaxis(force, 1, 0).shape
        return gain * (keep * force + part * peak * np.moveaxis(out.reshape(shape), 0, 1))

    return Effect({"loop": gain * part * float(wide), "form": form, "right_at": right, "gain": float(gain)}, apply)
