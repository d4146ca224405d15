"""Effects in time and of the surroundings: filters, delays, offsets, drifts and fields of the gripper."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from scipy.ndimage import uniform_filter1d
from scipy.signal import bessel, lfilter, sosfilt

from .bench import Bench, Form, Run, between, either
from .presses import FINE, Array

# ---- filters, 15 to 1 Hz (-3 dB), causal


def _averaged(x: Array, seconds: float) -> Array:
    """Return the mean over the last `seconds`, by a finite impulse response; at rest before the start."""
    width = max(2, round(seconds * FINE))
    total = np.cumsum(np.concatenate([np.repeat(x[:1], width, axis=0), x]), axis=0)
    return (total[width:] - total[:-width]) / width


def moving_average(rng: Generator, bench: Bench, size: float) -> Run:
    """Mean over a window (FIR), as of a firmware that averages its last readings."""
    window = 0.443 / between(15, 1, size)
    return lambda x: _averaged(x, window)


def bessel_filter(rng: Generator, bench: Bench, size: float) -> Run:
    """Bessel filter of order 2 to 4."""
    sos = np.asarray(bessel(int(rng.integers(2, 5)), between(15, 1, size), "low", output="sos", norm="mag", fs=FINE))
    return lambda x: np.asarray(sosfilt(sos, x, axis=0))


def resonant(rng: Generator, bench: Bench, size: float) -> Run:
    """Second order with damping 0.5 to 0.9, discretised by its exact impulse response: a mass on a soft mount."""
    damping, w = rng.uniform(0.5, 0.9), 2 * np.pi * between(15, 1, size) / FINE
    decay, turn = np.exp(-damping * w), w * np.sqrt(1 - damping**2)
    a = [1.0, -2 * decay * np.cos(turn), decay**2]
    return lambda x: np.asarray(lfilter([0.0, sum(a)], a, x, axis=0))


# ---- delays, 5 to 120 ms


def _delayed(x: Array, delay: Array) -> Array:
    """Return the reading `delay` ``(T,)`` seconds earlier, interpolated linearly."""
    at = np.clip(np.arange(len(x)) - delay * FINE, 0, len(x) - 1)
    low = np.minimum(at.astype(int), len(x) - 2)
    share = (at - low)[:, None, None, None, None]
    return (1 - share) * x[low] + share * x[low + 1]


def jittered(rng: Generator, bench: Bench, size: float) -> Run:
    """A delay with jitter of +-2 ms."""
    delay = between(0.005, 0.12, size) + rng.uniform(-0.002, 0.002, len(bench.plan.time))
    return lambda x: _delayed(x, delay)


def wandering(rng: Generator, bench: Bench, size: float) -> Run:
    """A delay that wanders by a tenth of itself within a minute, as of a queue that fills and empties."""
    t = bench.plan.time
    wave = np.sin(2 * np.pi * t / rng.uniform(20, 60) + rng.uniform(0, 6))
    delay = between(0.005, 0.12, size) * (1 + 0.1 * wave)
    return lambda x: _delayed(x, delay)


# ---- offsets, 0.2 to 3 counts


def zeroed_badly(rng: Generator, bench: Bench, size: float) -> Run:
    """Every channel was zeroed on its own, and off by a number of its own."""
    off = bench.count * between(0.2, 3, size) * rng.normal(size=(bench.shape[0], 3, *bench.shape[1:]))
    return lambda x: x + off


def magnetised(rng: Generator, bench: Bench, size: float) -> Run:
    """A constant field with a gradient over the pad: all taxels read a part of the same vector."""
    vector = rng.normal(size=(bench.shape[0], 3))
    vector[:, 2] = np.abs(vector[:, 2])
    slope = bench.places @ rng.normal(0, 0.15, 2)
    off = vector[:, :, None] * (1 + slope) * bench.count * between(0.2, 3, size)
    off = off.reshape(bench.shape[0], 3, *bench.shape[1:])
    return lambda x: x + off


# ---- drifts, 0.5 to 10 % of the full scale in ten minutes


def _spread(rng: Generator, bench: Bench) -> Array:
    """Return ``(pads, 3, rows, cols)`` sensitivities of mean square 1: common to an axis, with scatter."""
    common = rng.normal(size=(bench.shape[0], 3, 1, 1))
    common[:, 2] = np.abs(common[:, 2])
    s = common + 0.4 * rng.normal(size=(bench.shape[0], 3, *bench.shape[1:]))
    return s / np.sqrt(np.mean(s**2))


def _drifted(rng: Generator, bench: Bench, size: float, curve: Array) -> Run:
    """Return a drift along a curve ``(T,)``, whose range is what the rate gives over the recording's length."""
    full = between(0.005, 0.1, size) * bench.plan.peak * bench.plan.time[-1] / 600
    shape = full * (curve - curve[0]) / np.ptp(curve)
    spread = _spread(rng, bench)
    return lambda x: x + shape[:, None, None, None, None] * spread


def warming(rng: Generator, bench: Bench, size: float) -> Run:
    """Exponential approach, as of electronics that warm up; 1 - exp(-t / tau)."""
    return _drifted(rng, bench, size, 1 - np.exp(-bench.plan.time / rng.uniform(20, 200)))


def walk(rng: Generator, bench: Bench, size: float) -> Run:
    """Random walk with a trend."""
    t = bench.plan.time
    path = np.cumsum(rng.normal(size=len(t)))
    path = uniform_filter1d(path, 2 * FINE, mode="nearest")
    return _drifted(rng, bench, size, 0.7 * either(rng) * path / np.ptp(path) + t / t[-1])


def thermal(rng: Generator, bench: Bench, size: float) -> Run:
    """Zero that follows the temperature, with the lag of the pad's mass."""
    pole = np.exp(-1 / (FINE * rng.uniform(2, 15)))
    change = bench.plan.temperature - bench.plan.temperature[0]
    return _drifted(rng, bench, size, np.asarray(lfilter([1 - pole], [1, -pole], change)))


# ---- fields of the gripper, 0.2 to 5 counts over its travel


def _field(rng: Generator, bench: Bench, size: float, field: Array) -> Run:
    """Return the force that a field ``(T, pads, 3, taxels)`` pretends, zeroed at the start, closed, or never."""
    kind, opening = int(rng.integers(3)), bench.plan.opening
    field = field * bench.count * between(0.2, 5, size) / np.ptp(field, axis=0).max()
    zero = (field[0], field[np.argmin(opening)], np.zeros_like(field[0]))[kind]
    shown = (field - zero).reshape(len(field), bench.shape[0], 3, *bench.shape[1:])
    return lambda x: x + shown


def dipole(rng: Generator, bench: Bench, size: float) -> Run:
    """A magnet in the opposite finger: a dipole of random direction that moves with the opening along the normal."""
    away = 1e3 * bench.plan.opening + rng.uniform(8, 20)  # mm
    beside, moment = rng.uniform(-8, 8, 2), rng.normal(size=3)
    moment /= np.linalg.norm(moment)
    places = bench.plan.pitch * bench.places - beside
    fields = []
    for mirror in (1.0, -1.0)[: bench.shape[0]]:
        flat = np.broadcast_to(places * (mirror, 1), (len(away), *places.shape))
        r = np.concatenate([flat, np.broadcast_to(away[:, None, None], (*flat.shape[:2], 1))], axis=-1)
        length = np.linalg.norm(r, axis=-1, keepdims=True)
        fields.append((3 * r * (r @ moment)[..., None] / length**2 - moment) / length**3)
    return _field(rng, bench, size, np.swapaxes(np.stack(fields, axis=1), 2, 3))


def polynomial(rng: Generator, bench: Bench, size: float) -> Run:
    """A cubic polynomial of the opening for each pad and axis, with a gradient over the taxels."""
    u = bench.plan.opening
    u = (u - u.min()) / np.ptp(u)
    weights = rng.normal(size=(bench.shape[0], 3, 3)) * (1.0, 0.7, 0.4)
    slope = 1 + bench.places @ rng.normal(0, 0.1, 2)
    powers = np.stack([u, u**2, u**3], axis=-1)
    return _field(rng, bench, size, np.einsum("tk,pak,n->tpan", powers, weights, slope))


def iron(rng: Generator, bench: Bench, size: float) -> Run:
    """Iron in the other finger draws the field to it: exponential in the opening, strongest near one corner."""
    reach = rng.uniform(0.008, 0.03)  # m
    near = np.exp(-((bench.places - rng.uniform(-1.5, 1.5, 2)) ** 2).sum(axis=1) / 8)
    fall = np.exp(-(bench.plan.opening - bench.plan.opening.min()) / reach)
    return _field(rng, bench, size, np.einsum("t,pa,n->tpan", fall, rng.normal(size=(bench.shape[0], 3)), near))


FORMS = (
    Form("low_pass", "moving_average", moving_average),
    Form("low_pass", "bessel_filter", bessel_filter),
    Form("low_pass", "resonant", resonant),
    Form("latency", "jittered", jittered),
    Form("latency", "wandering", wandering),
    Form("offset", "zeroed_badly", zeroed_badly),
    Form("offset", "magnetised", magnetised),
    Form("drift", "warming", warming),
    Form("drift", "walk", walk),
    Form("drift", "thermal", thermal),
    Form("interference", "dipole", dipole),
    Form("interference", "polynomial", polynomial),
    Form("interference", "iron", iron),
)
