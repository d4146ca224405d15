"""What a real sensor does to forces, in continuous time (500 Hz), each effect by its own physics.

Nothing here is shared with what is fitted: hysteresis is Bouc-Wen's, creep two standard linear solids, saturation a
tanh, crosstalk falls off exponentially, interference is the field of a dipole that moves with the gripper, drift is a
random walk on a curve, stiffening a cubic, the low-pass has two poles.

An effect is a function ``(rng, pad, strength) -> (apply, truth)``: `apply(force, episode)` turns (T, pads, 3, N)
newtons into what is read, and `truth` holds the figures a diagnosis should come back with. `strength` in [0, 1] goes
from barely there to strong, log-uniformly over the published or plausible magnitudes.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

DT = 1 / 500
COUNT = 0.1


@dataclass
class Pad:
    """The sensor: (N, 2) taxel centres (m), rows, cols, number of pads, and the largest force of a taxel (N)."""

    where: np.ndarray
    rows: int
    cols: int
    pads: int
    peak: float


@dataclass
class Episode:
    """What an effect may know of an episode: seconds since the recording began, (T,) opening (m), (T,) degC."""

    start: float
    opening: np.ndarray
    temperature: np.ndarray


def between(low, high, strength):
    """Log-linearly from `low` to `high`."""
    return float(low * (high / low) ** strength)


def sign(rng, *shape):
    """-1 or 1."""
    return rng.choice([-1.0, 1.0], shape) if shape else float(rng.choice([-1.0, 1.0]))


def axis_gain(rng, pad, strength):
    gain = 1 + sign(rng, 3) * between(0.03, 0.30, strength) * rng.uniform(0.7, 1.0, 3)
    return lambda f, e: f * gain[:, None], {"gain": gain}


def taxel_gain(rng, pad, strength):
    sigma = between(0.03, 0.20, strength)
    gain = np.exp(sigma * rng.standard_normal((pad.pads, 1, len(pad.where))))
    return lambda f, e: f * gain, {"sigma": sigma, "gain": gain}


def offset(rng, pad, strength):
    size = between(0.2, 3.0, strength) * COUNT
    value = size * sign(rng, pad.pads, 3, len(pad.where)) * rng.uniform(0.5, 1.0, (pad.pads, 3, len(pad.where)))
    value[:, 2] = np.abs(value[:, 2])  # a normal reading cannot go below zero
    return lambda f, e: f + value, {"offset": value}


def drift(rng, pad, strength):
    size = between(0.005, 0.10, strength) * pad.peak
    amount = size * sign(rng, pad.pads, 3, 1) * rng.uniform(0.5, 1.0, (pad.pads, 3, len(pad.where)))
    amount[:, 2] = np.abs(amount[:, 2])
    tau = rng.uniform(150.0, 500.0)
    seed = int(rng.integers(2**31))

    def apply(f, e):
        t = e.start + DT * np.arange(len(f))
        curve = (1 - np.exp(-t / tau)) / (1 - np.exp(-600 / tau))
        walk = np.random.default_rng([seed, round(e.start)]).standard_normal(len(f)).cumsum() * 0.02 * (DT / 9) ** 0.5
        return f + (curve + walk)[:, None, None, None] * amount

    return apply, {"in_600_s": amount, "tau": tau}


def stiffening(rng, pad, strength):
    bend = between(0.04, 0.35, strength) * sign(rng)

    def apply(f, e):
        size = np.linalg.norm(f, axis=2, keepdims=True) / pad.peak
        return f * (1 + bend * (0.7 - 1.6 * size + 0.8 * size**2))

    return apply, {"bend": bend}


def poisson(rng, pad, strength):
    amount = between(0.02, 0.15, strength) * rng.uniform(0.8, 1.2, 2)
    d = pad.where[:, None] - pad.where[None]
    r = np.linalg.norm(d, axis=-1) + 1e-12
    weight = np.where(r > 1e-6, np.exp(-((r / np.median(np.sort(r, axis=1)[:, 1])) ** 1.5) / 1.2), 0)
    push = d / r[..., None] * weight[..., None]  # (to, from, xy): away from the load
    push /= np.abs(push).sum(axis=(1, 2)).max() / 2

    def apply(f, e):
        shear = np.einsum("tpj,ijk->tpki", f[:, :, 2], push) * amount[:, None]
        return np.concatenate([f[:, :, :2] + shear, f[:, :, 2:]], axis=2)

    return apply, {"amount": amount}


def crosstalk(rng, pad, strength):
    amount = between(0.01, 0.12, strength)
    r = np.linalg.norm(pad.where[:, None] - pad.where[None], axis=-1)
    pitch = np.median(np.sort(r, axis=1)[:, 1])
    kernel = np.where(r > 1e-6, np.exp(-r / pitch), 0.0)
    kernel *= amount / kernel.sum(axis=1).max() * 2
    return lambda f, e: f + f @ kernel.T, {"amount": amount, "kernel": kernel}


def axis_coupling(rng, pad, strength):
    size = between(0.02, 0.20, strength)
    matrix = np.eye(3)
    matrix[:2, 2] = size * sign(rng, 2) * rng.uniform(0.5, 1.0, 2)
    matrix[2, :2] = 0.5 * size * sign(rng, 2) * rng.uniform(0.3, 1.0, 2)
    return lambda f, e: np.einsum("kl,tpln->tpkn", matrix, f), {"matrix": matrix}


def rotation(rng, pad, strength):
    about_z = np.deg2rad(between(2.0, 20.0, strength)) * sign(rng)
    tilt = np.deg2rad(between(0.5, 3.0, strength) * sign(rng, 2) * 0.5)
    vector = np.array([*tilt, about_z])
    angle = np.linalg.norm(vector)
    a, b, c = vector / angle
    k = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
    matrix = np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
    return lambda f, e: np.einsum("kl,tpln->tpkn", matrix, f), {"vector": vector}


def layout(rng, pad, strength):
    kind = rng.choice(["flip_rows", "flip_cols", "swap_pads", "axis_sign_x", "axis_sign_y"])

    def apply(f, e):
        grid = f.reshape(*f.shape[:3], pad.rows, pad.cols)
        if kind == "flip_rows":
            return grid[..., ::-1, :].reshape(f.shape)
        if kind == "flip_cols":
            return grid[..., ::-1].reshape(f.shape)
        if kind == "swap_pads":
            return f[:, ::-1]
        axes = np.array([-1.0, 1.0, 1.0] if kind == "axis_sign_x" else [1.0, -1.0, 1.0])
        return f * axes[:, None]

    return apply, {"kind": str(kind)}


def creep(rng, pad, strength):
    total = between(0.02, 0.25, strength)
    tau = float(np.exp(rng.uniform(np.log(0.25), np.log(8.0))))
    taus, shares = np.array([tau / 1.8, tau * 1.8]), np.array([0.5, 0.5])

    def apply(f, e):
        out = f.copy()
        for t, share in zip(taus, shares, strict=True):
            a = np.exp(-DT / t)
            out += total * share * lfilter([1 - a], [1, -a], f, axis=0)
        return out

    return apply, {"amount": total, "tau": tau}


def hysteresis(rng, pad, strength):
    width = between(0.02, 0.15, strength)
    scale = rng.uniform(0.15, 0.35) * pad.peak
    beta, n = rng.uniform(0.4, 0.6), rng.uniform(1.0, 1.6)

    def apply(f, e):
        z = np.zeros(f.shape[1:])
        path = np.empty_like(f)
        step = np.diff(f, axis=0, prepend=f[:1]) / scale
        for i in range(len(f)):  # the state bends towards the direction of motion and saturates near 1
            z = z + step[i] - np.abs(z) ** n * (beta * np.abs(step[i]) * np.sign(z) + (1 - beta) * step[i])
            path[i] = z
        return f - 0.5 * width * pad.peak * path

    return apply, {"width": width}


def low_pass(rng, pad, strength):
    cutoff = between(15.0, 1.0, strength)
    a = np.exp(-2 * np.pi * cutoff * 1.55 * DT)  # two equal poles; together 3 dB down at the cut-off

    def apply(f, e):
        once = lfilter([1 - a], [1, -a], f - f[:1], axis=0)
        return f[:1] + lfilter([1 - a], [1, -a], once, axis=0)

    return apply, {"cutoff": cutoff, "lag": 2 / (2 * np.pi * cutoff * 1.55)}


def latency(rng, pad, strength):
    delay = between(0.005, 0.120, strength)

    def apply(f, e):
        late = np.arange(len(f)) - delay / DT
        low = np.clip(np.floor(late).astype(int), 0, len(f) - 1)
        high = np.clip(low + 1, 0, len(f) - 1)
        way = np.clip(late - low, 0, 1)[:, None, None, None]
        return f[low] * (1 - way) + f[high] * way

    return apply, {"delay": delay}


def saturation(rng, pad, strength):
    limit = (0.95 - 0.55 * strength) * pad.peak
    knee = rng.uniform(0.1, 0.3)

    def apply(f, e):
        size = np.abs(f)
        start = (1 - knee) * limit
        return np.sign(f) * np.where(
            size > start, start + knee * limit * np.tanh((size - start) / (knee * limit)), size
        )

    return apply, {"limit": limit}


def dead_band(rng, pad, strength):
    width = between(0.5, 3.0, strength) * COUNT
    soft = 0.12 * width

    def apply(f, e):
        size = np.abs(f)
        return f / (1 + np.exp(-np.clip((size - width) / soft, -50, 50)))

    return apply, {"width": width}


def quantisation(rng, pad, strength):
    step = between(0.15, 0.6, strength)
    return lambda f, e: f, {"step": step}  # taken up by the electronics, after the noise


def dead_taxels(rng, pad, strength):
    count = 1 + round(3 * strength)
    loaded = np.argsort(np.linalg.norm(pad.where, axis=1))[: max(count, len(pad.where) // 2)]
    which = [(int(rng.integers(pad.pads)), int(i)) for i in rng.choice(loaded, count, replace=False)]
    level = np.where(rng.random(count) < 0.7, 0.0, rng.uniform(2, 8, count) * COUNT)

    def apply(f, e):
        out = f.copy()
        for (p, i), value in zip(which, level, strict=True):
            out[:, p, :, i] = value
        return out

    return apply, {"taxels": which}


def interference(rng, pad, strength):
    size = between(0.2, 5.0, strength) * COUNT
    moment = rng.standard_normal(3)
    moment /= np.linalg.norm(moment)
    height = rng.uniform(0.02, 0.04)

    def raw(opening):
        here = np.concatenate([pad.where, np.zeros((len(pad.where), 1))], axis=1)
        out = np.empty((len(opening), pad.pads, 3, len(here)))
        for p in range(pad.pads):
            away = np.stack([0.004 * sign_of(p) + 0 * opening, 0.003 + 0 * opening, -(height + opening)], axis=-1)
            r = here[None] - away[:, None]
            d = np.linalg.norm(r, axis=-1, keepdims=True)
            b = 3 * r * (r @ moment)[..., None] / d**5 - moment / d**3
            out[:, p] = np.moveaxis(b, -1, 1)
        return out

    span = raw(np.linspace(0.0, 0.04, 9))
    home = raw(np.array([0.02]))
    scale = size / np.abs(span - home).mean(axis=(1, 3)).max()
    return lambda f, e: f + scale * (raw(e.opening) - home), {"size": size}


def sign_of(p):
    """1 for even pads, -1 for odd ones, which face the other way."""
    return 1.0 if p % 2 == 0 else -1.0


EFFECTS = {
    f.__name__: f
    for f in (
        layout, stiffening, creep, hysteresis, poisson, crosstalk, axis_coupling, rotation, interference, axis_gain,
        taxel_gain, offset, drift, low_pass, latency, dead_band, saturation, quantisation, dead_taxels,
    )
}  # fmt: skip
"""By the name a diagnosis should give, in the order in which a sensor applies them (`layout`: to what comes in)."""
