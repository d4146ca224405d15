"""Effects on a channel's value at one moment: curves, gains, dead bands, rails, counts and dead taxels."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from .bench import Bench, Form, Run, between, either
from .presses import Array

# ---- stiffening: the gain of a loaded taxel depends on its load


def _right_somewhere(rng: Generator, curve: Run) -> float:
    """Return the gain that makes a curve of 0 to 1 right for small forces, at half, or at the end of the range."""
    at = float(rng.choice([1e-3, 0.5, 1.0]))
    return at / float(curve(np.array([at]))[0])


def exponential(rng: Generator, bench: Bench, size: float) -> Run:
    """Gain that grows or falls exponentially with the load on the taxel (magnitude), by up to 8 to 60 %."""
    bend = between(0.08, 0.6, size) * either(rng)
    gain = _right_somewhere(rng, lambda u: u * np.exp(bend * u))

    def run(x: Array) -> Array:
        load = np.linalg.norm(x, axis=2, keepdims=True) / bench.reach[2]
        return gain * x * np.exp(bend * np.clip(load, 0, 1.5))

    return run


def ogden(rng: Generator, bench: Bench, size: float) -> Run:
    """Each channel follows the compression of a rubber block (Ogden): force over (1 - u)^-a - (1 - u)^(a/2)."""
    depth, power = between(0.04, 0.2, size), rng.uniform(1.5, 4.0)

    def curve(u: Array) -> Array:
        inside = 1 - depth * np.clip(np.abs(u), 0, 1.5)
        return np.sign(u) * (inside**-power - inside ** (power / 2)) / (1.5 * power * depth)

    gain = _right_somewhere(rng, curve)
    return lambda x: gain * bench.reaches * curve(x / bench.reaches)


def cubic(rng: Generator, bench: Bench, size: float) -> Run:
    """Gain that changes with the square of the normal force: y = x (1 + b (z / reach)^2), for all axes."""
    bend = between(0.06, 0.5, size) * (1.0 if rng.uniform() < 0.6 else -0.6)
    gain = _right_somewhere(rng, lambda u: u * (1 + bend * u**2))
    return lambda x: gain * x * (1 + bend * np.clip(np.abs(x[:, :, 2:]) / bench.reach[2], 0, 1.2) ** 2)


# ---- gains


def uneven(rng: Generator, bench: Bench, size: float) -> Run:
    """Three axes with three gains, off by 3 to 30 %, at random up or down."""
    off = between(0.03, 0.3, size) * rng.uniform(0.4, 1.0, 3) * rng.choice([-1, 1], 3)
    off[rng.integers(3)] *= 0.1
    return lambda x: x * (1 + off)[:, None, None]


def normal_only(rng: Generator, bench: Bench, size: float) -> Run:
    """Only the normal axis is off; its deviation scatters by a tenth of itself between the pads."""
    off = between(0.03, 0.3, size) * either(rng) * (1 + 0.1 * rng.normal(size=bench.shape[0]))
    gain = np.ones((bench.shape[0], 3, 1, 1))
    gain[:, 2, 0, 0] += off
    return lambda x: x * gain


def scatter(rng: Generator, bench: Bench, size: float) -> Run:
    """Every taxel has a lognormal gain, common to its axes."""
    gain = np.exp(between(0.03, 0.2, size) * rng.normal(size=bench.shape))[:, None]
    return lambda x: x * gain


def uneven_gel(rng: Generator, bench: Bench, size: float) -> Run:
    """Gains that follow a plane and a bowl over the pad, as of a gel of uneven thickness, with a little scatter."""
    u, v = (bench.places / np.maximum(np.abs(bench.places).max(axis=0), 0.5)).T
    shapes = np.stack([u, v, u * v, u**2 - np.mean(u**2), v**2 - np.mean(v**2)])
    field = rng.normal(size=(bench.shape[0], 5)) @ shapes
    field = field / field.std(axis=1, keepdims=True) + 0.2 * rng.normal(size=field.shape)
    gain = np.exp(between(0.03, 0.2, size) * field).reshape(bench.shape)[:, None]
    return lambda x: x * gain


def a_few(rng: Generator, bench: Bench, size: float) -> Run:
    """Two to four loaded taxels have lost 10 to 50 % of their gain; all others are right."""
    where = rng.permutation(bench.loaded(0.25))[: int(rng.integers(2, 5))]
    gain = np.ones((bench.shape[0], 1, *bench.shape[1:]))
    gain[where[:, 0], 0, where[:, 1], where[:, 2]] -= between(0.1, 0.5, size) * rng.uniform(0.7, 1, len(where))
    return lambda x: x * gain


# ---- dead bands, 0.5 to 3 counts, of another width on each axis


def _widths(rng: Generator, bench: Bench, size: float) -> Array:
    """Return ``(3, 1, 1)`` half widths (N)."""
    return bench.count * between(0.5, 3.0, size) * rng.uniform(0.7, 1.3, (3, 1, 1))


def hard_band(rng: Generator, bench: Bench, size: float) -> Run:
    """Firmware that shows small numbers as 0."""
    width = _widths(rng, bench, size)
    return lambda x: np.where(np.abs(x) < width, 0.0, x)


def soft_band(rng: Generator, bench: Bench, size: float) -> Run:
    """A gap that a force must close first: all larger forces read less by the gap."""
    width = _widths(rng, bench, size)
    return lambda x: np.sign(x) * np.maximum(np.abs(x) - width, 0)


def smooth_band(rng: Generator, bench: Bench, size: float) -> Run:
    """Small forces fade away smoothly: x^3 / (x^2 + w^2)."""
    width = _widths(rng, bench, size)
    return lambda x: x**3 / (x**2 + width**2)


# ---- rails at 95 to 40 % of each axis's largest force


def _rails(rng: Generator, bench: Bench, size: float) -> Array:
    return bench.reaches * between(0.95, 0.4, size) * rng.uniform(0.9, 1.1, (3, 1, 1))


def smooth_rail(rng: Generator, bench: Bench, size: float) -> Run:
    """Hyperbolic tangent: no reading beyond the rail."""
    rail = _rails(rng, bench, size)
    return lambda x: rail * np.tanh(x / rail)


def hard_rail(rng: Generator, bench: Bench, size: float) -> Run:
    """An amplifier at its rail: the value stops, noise included."""
    rail = _rails(rng, bench, size)
    return lambda x: np.clip(x, -rail, rail)


def lopsided(rng: Generator, bench: Bench, size: float) -> Run:
    """Rails that differ up and down, as with an offset of the amplifier's working point; with a knee."""
    up = _rails(rng, bench, size)
    down, sharp = up * rng.uniform(1.3, 3.0, (3, 1, 1)), rng.uniform(5, 10)

    def run(x: Array) -> Array:
        ratio = np.abs(x) / np.where(x > 0, up, down)
        return x / (1 + ratio**sharp) ** (1 / sharp)

    return run


# ---- counts


def coarse(rng: Generator, bench: Bench, size: float) -> Run:
    """Rounding to steps that differ between normal and shear."""
    step = bench.count * between(0.5, 3.0, size) * np.array([0.6, 0.6, 1.0])[:, None, None]
    return lambda x: step * np.round(x / step)


def reluctant(rng: Generator, bench: Bench, size: float) -> Run:
    """Rounding by a comparator with hysteresis: a count changes only once it is wrong by more than 0.6 to 0.8."""
    step, stay = bench.count * between(0.5, 3.0, size), rng.uniform(0.6, 0.8)

    def run(x: Array) -> Array:
        y, now = np.empty_like(x), np.round(x[0] / step)
        for i in range(len(x)):
            now = np.where(np.abs(x[i] / step - now) > stay, np.round(x[i] / step), now)
            y[i] = step * now
        return y

    return run


# ---- dead taxels: 1 to 4 taxels, all axes, without noise


def _dead(rng: Generator, bench: Bench, size: float) -> np.ndarray:
    """Return a mask ``(pads, 1, rows, cols)`` of loaded taxels."""
    where = rng.permutation(bench.loaded(0.2))[: 1 + round(3 * size)]
    mask = np.zeros((bench.shape[0], 1, *bench.shape[1:]), bool)
    mask[where[:, 0], 0, where[:, 1], where[:, 2]] = True
    return mask


def silent(rng: Generator, bench: Bench, size: float) -> Run:
    """Taxels read 0 from the start."""
    mask = _dead(rng, bench, size)
    return lambda x: np.where(mask, 0.0, x)


def stuck(rng: Generator, bench: Bench, size: float) -> Run:
    """Taxels are stuck at any number from the start."""
    values = rng.uniform(0.05, 0.6, (bench.shape[0], 3, *bench.shape[1:])) * bench.reaches
    mask = _dead(rng, bench, size)
    return lambda x: np.where(mask, values, x)


def chip(rng: Generator, bench: Bench, size: float) -> Run:
    """A chip of 1x2 or 2x2 taxels fails in the middle, and reads what it read last, or its constant, ever after."""
    pads, rows, cols = bench.shape
    high, share = int(rng.integers(1, 3)), rng.uniform(0.35, 0.6)
    pad, row, col = bench.loaded(0.4)[rng.integers(len(bench.loaded(0.4)))]
    row, col = min(row, rows - high), min(col, cols - 2)
    mask = np.zeros((pads, 1, rows, cols), bool)
    mask[pad, 0, row : row + high, col : col + 2] = True
    keeps, constant = rng.uniform() < 0.5, rng.uniform(0, 0.5) * bench.reaches

    def run(x: Array) -> Array:
        first, y = round(share * len(x)), x.copy()
        y[first:] = np.where(mask, x[first] if keeps else constant, x[first:])
        return y

    return run


FORMS = (
    Form("stiffening", "exponential", exponential),
    Form("stiffening", "ogden", ogden),
    Form("stiffening", "cubic", cubic),
    Form("axis_gain", "uneven", uneven),
    Form("axis_gain", "normal_only", normal_only),
    Form("taxel_gain", "scatter", scatter),
    Form("taxel_gain", "uneven_gel", uneven_gel),
    Form("taxel_gain", "a_few", a_few),
    Form("dead_band", "hard_band", hard_band, digital=True),
    Form("dead_band", "soft_band", soft_band),
    Form("dead_band", "smooth_band", smooth_band),
    Form("saturation", "smooth_rail", smooth_rail),
    Form("saturation", "hard_rail", hard_rail, digital=True),
    Form("saturation", "lopsided", lopsided),
    Form("quantisation", "coarse", coarse, digital=True),
    Form("quantisation", "reluctant", reluctant, digital=True),
    Form("dead_taxels", "silent", silent, digital=True, sized=False),
    Form("dead_taxels", "stuck", stuck, digital=True, sized=False),
    Form("dead_taxels", "chip", chip, digital=True, sized=False),
)
