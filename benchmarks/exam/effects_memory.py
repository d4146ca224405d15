"""Effects with a memory of the load: creep and hysteresis.

Each is drawn with a convention of calibration: a sensor reads right at once or after a hold (creep), for small forces,
half of the range or its end (hysteresis).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from scipy.signal import fftconvolve

from .bench import Bench, Form, Run, between
from .presses import FINE, Array

# ---- creep


def _crept(x: Array, kernel: Array, amount: float) -> Array:
    """Return x plus `amount` times its history: the superposition of what each change of load causes (Boltzmann).

    Args:
        x: Forces at `FINE`.
        kernel: ``(T,)`` creep function, 0 at time 0.
        amount: Creep where the kernel is 1.
    """
    middle = (x + np.concatenate([np.zeros_like(x[:1]), x[:-1]])) / 2  # the load is linear between samples
    rate = np.diff(kernel, prepend=0.0)
    rate[:-1], rate[-1] = rate[1:], 0.0
    return x + amount * fftconvolve(middle, rate[:, None, None, None, None], axes=0)[: len(x)]


def _convolved(rng: Generator, bench: Bench, size: float, kernel: Callable[[Array], Array]) -> Run:
    """Return creep by a creep function of time (s), which is 0 at 0 and near 1 after 10 s or at the end."""
    amount, hold = between(0.02, 0.25, size), float(rng.choice([0.0, 1.0, 10.0]))
    values = kernel(bench.plan.time)
    gain = 1 / (1 + amount * float(np.interp(hold, bench.plan.time, values)))  # right after a hold of so many seconds
    return lambda x: gain * _crept(x, values, amount)


def power(rng: Generator, bench: Bench, size: float) -> Run:
    """Creep by a power of time, as of a fractional element (Nutting, Scott Blair)."""
    exponent, start = rng.uniform(0.1, 0.45), between(0.02, 0.5, rng.uniform())
    scale = (1 + 10 / start) ** exponent - 1
    return _convolved(rng, bench, size, lambda t: ((1 + t / start) ** exponent - 1) / scale)


def logarithm(rng: Generator, bench: Bench, size: float) -> Run:
    """Creep by the logarithm of time, as of Andrade's successors for filled rubber."""
    start = between(0.05, 2.0, rng.uniform())
    return _convolved(rng, bench, size, lambda t: np.log1p(t / start) / np.log1p(10 / start))


def stretched(rng: Generator, bench: Bench, size: float) -> Run:
    """Creep by a stretched exponential (Kohlrausch)."""
    exponent, tau = rng.uniform(0.4, 0.8), between(0.2, 30, rng.uniform())
    return _convolved(rng, bench, size, lambda t: 1 - np.exp(-((t / tau) ** exponent)))


def eyring(rng: Generator, bench: Bench, size: float) -> Run:
    """Creep through a barrier (Eyring): the rate is a hyperbolic sine of what is still to come, so large loads run."""
    amount, tau, held = between(0.03, 0.25, size), between(0.3, 10, rng.uniform()), rng.uniform() < 0.5
    stress = 0.25 * amount * bench.reaches

    def run(x: Array) -> Array:
        y, state = x.copy(), np.zeros_like(x[0])
        for i in range(len(x)):
            drive = np.clip((amount * x[i] - state) / stress, -5, 5)
            state += stress * np.sinh(drive) / (tau * FINE)
            y[i] += state
        return y / (1 + amount) if held else y

    return run


# ---- hysteresis


def _loop(raw: Run, bench: Bench, rng: Generator, width: float) -> Run:
    """Return (a x + b raw(x)): a loop of the given width that reads right where the sensor was calibrated.

    A test cycle of each axis from 0 to its reach and back, twice, gives the width of the raw loop relative to its
    reading at the reach, and the gains. ``b`` gives the wanted width; ``a`` makes the slope at zero, the mean branch
    at half, or the end right.
    """
    kind = int(rng.integers(3))
    way = np.linspace(0, 1, 401)
    cycle = np.r_[way, way[-2::-1], way[1:], way[-2::-1]][:, None, None, None, None] * bench.reaches
    y = raw(np.broadcast_to(cycle, (len(cycle), 1, 3, 1, 1)).copy())[:, 0, :, 0, 0] / bench.reach
    up, down = y[800:1201], y[1600:1199:-1]
    widest = float(np.abs(down - up)[:, 2].max())
    b = width / max(widest, 1e-9)
    reads = [y[20] / way[20], (up[200] + down[200]) / (2 * way[200]), y[400]][kind]  # first rise; by axis
    a = 1 - b * reads[:, None, None]
    return lambda x: a * x + b * raw(x)


def _recorded(raw: Run, bench: Bench) -> Run:
    """Return a loop that is integrated within the episodes only, and holds its last value in the breaks."""
    moving = bench.moving
    last = np.maximum(np.cumsum(moving) - 1, 0)
    return lambda x: raw(x[moving])[last] if len(x) == len(moving) else raw(x)


def preisach(rng: Generator, bench: Bench, size: float) -> Run:
    """Loop of 64 relays with random thresholds and a random density (Preisach), odd in the force.

    A relay switches on where the force exceeds its upper threshold, and off below its lower one. All lower thresholds
    are above 0: at rest all are off, and nothing remains. The reversible part is such that the mean of the two
    branches of the largest loop is straight.
    """
    upper = np.sort(rng.uniform(0.03, 1.0, 64))
    lower = upper * rng.uniform(0.1, 0.8, 64)
    density = rng.gamma(2.0, 1.0, 64)
    density /= density.sum()
    spread = rng.uniform(0.9, 1.1, (bench.shape[0] * 3 * bench.shape[1] * bench.shape[2], 1))  # by channel
    moving = bench.moving
    way = np.linspace(0, 1.1, 441)
    mean = ((way[:, None] >= upper) @ density + (way[:, None] > lower) @ density) / 2

    def deviation(u: Array) -> Array:
        """Return the relays' sum beyond its mean for ``(channels, T)`` forces from 0 to about 1."""
        size_u, sign = np.abs(u).astype(np.float32), np.sign(u).astype(np.float32)
        most, index, y = size_u.max(axis=1), np.arange(u.shape[1], dtype=np.int32), np.zeros_like(u)
        for on, off, weight in zip(upper, lower, density, strict=True):
            some = np.flatnonzero(most >= on)
            force = size_u[some]
            high = force >= on
            last = np.maximum.accumulate(np.where(high | (force <= off), index, 0), axis=1)
            y[some] += weight * np.take_along_axis(sign[some] * high, last, axis=1)
        return y - np.sign(u) * np.interp(np.abs(u), way, mean)

    def raw(x: Array) -> Array:
        whole = len(x) == len(moving)
        some, scale = (moving, spread) if whole else (slice(None), 1.0)  # a test cycle: all channels alike
        part = x[some] / bench.reaches
        u = part.reshape(len(part), -1).T / scale
        out = np.zeros_like(x)
        out[some] = (deviation(u) * scale).T.reshape(-1, *x.shape[1:]) * bench.reaches
        return out

    return _loop(raw, bench, rng, between(0.02, 0.15, size))


def duhem(rng: Generator, bench: Bench, size: float) -> Run:
    """Loop of Duhem's equation, dH = a |dx| (x - H) + c dx (Coleman and Hodgdon): some force remains at rest."""
    a, c = rng.uniform(2.0, 8.0), rng.uniform(0.0, 0.5)

    def raw(x: Array) -> Array:
        h, out, before = np.zeros_like(x[0]), np.zeros_like(x), np.zeros_like(x[0])
        for i in range(len(x)):
            step = x[i] - before
            share = 1 - np.exp(-a * np.abs(step) / bench.reaches)
            middle = (x[i] + before) / 2
            h = h + share * (middle - h) + c * step
            out[i], before = h, x[i]
        return out

    return _loop(_recorded(raw, bench), bench, rng, between(0.02, 0.15, size))


def bouc_wen(rng: Generator, bench: Bench, size: float) -> Run:
    """Loop of Bouc and Wen, dz = dx - (b sign(dx z) + g) |z|^n dx, at 1 kHz; pinched: nothing remains without load."""
    n, most = rng.uniform(1.0, 2.0), rng.uniform(0.08, 0.35)
    ratio, pinch = rng.uniform(0.5, 0.8), rng.uniform(0.03, 0.1)
    both = most**-n

    def raw(x: Array) -> Array:
        z, out, before = np.zeros_like(x[0]), np.zeros_like(x), np.zeros_like(x[0])
        for i in range(len(x)):
            half = (x[i] - before) / (2 * bench.reaches)
            for _ in range(2):
                size_z = np.abs(z) ** n
                z = z + half * (1 - both * size_z * (ratio * np.sign(half * z) + 1 - ratio))
            out[i], before = z, x[i]
        load = np.abs(x) / bench.reaches
        return bench.reaches * out * load / (load + pinch)

    return _loop(_recorded(raw, bench), bench, rng, between(0.02, 0.15, size))


FORMS = (
    Form("creep", "power", power),
    Form("creep", "logarithm", logarithm),
    Form("creep", "stretched", stretched),
    Form("creep", "eyring", eyring),
    Form("hysteresis", "preisach", preisach),
    Form("hysteresis", "duhem", duhem),
    Form("hysteresis", "bouc_wen", bouc_wen),
)
