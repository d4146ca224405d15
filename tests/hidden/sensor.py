"""Imperfections of every real recording: noise, rounding, clock jitter and small errors."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from hidden.effects import COUNT


@dataclass
class Nuisance:
    """Imperfections that are drawn once per recording.

    Attributes:
        rate: sampling rate, Hz.
        noise: (pads, 3, N) standard deviation, N.
        rho: correlation of the noise from one 20 Hz sample to the next.
        scatter: (pads, 3, N) gains close to 1 that calibration has not removed.
        pose_error: (2,) offset of the simulated contact, m.
        jitter: largest deviation of a sample's true time from its timestamp, s.
        step: newtons per count.
        rounding: a form of `effects.quantisation`.
        white, coloured: share of the noise that is white, and that is correlated.
        begins: time of the first sample, s.
        averaged: time over which a sample averages, s.
    """

    rate: float
    noise: np.ndarray
    rho: float
    scatter: np.ndarray
    pose_error: np.ndarray
    jitter: float
    step: float
    rounding: str = "round"
    white: float = 0.7
    coloured: float = 0.7
    begins: float = 0.0
    averaged: float = 0.0


def draw(rng, pads, taxels, step=COUNT, rho=None, strong=False):
    """Draw the imperfections of a sensor; `strong` noise is five times the usual."""
    noise = np.exp(rng.uniform(np.log(0.05), np.log(0.5))) * COUNT * rng.uniform(0.7, 1.4, (pads, 3, taxels))
    return Nuisance(
        rate=float(rng.choice([20.0, 30.0, 50.0, 100.0], p=[0.4, 0.3, 0.2, 0.1])),
        noise=noise * (5 if strong else 1),
        rho=float(rng.choice([0.0, 0.5, 0.8, 0.95])) if rho is None else rho,
        scatter=1 + rng.uniform(0.003, 0.01) * rng.standard_normal((pads, 3, taxels)),
        pose_error=rng.uniform(-0.5, 0.5, 2) * 0.2e-3,
        jitter=2e-3,
        step=step,
    )


def broad(rng, nuisance, rho=None):
    """Draw what differs in the family "broad": rates and noise, and samples that average and begin at any time."""
    rate = float(rng.choice([25.0, 40.0, 60.0, 90.0]))
    share = rng.uniform(0.2, 1.0)
    return replace(
        nuisance,
        rate=rate,
        rho=rng.uniform(0.0, 0.95) if rho is None else rho,
        white=float(np.sqrt(1 - share)),
        coloured=float(np.sqrt(share)),
        begins=rng.uniform(0.0, 1 / rate),
        averaged=rng.choice([0.0, 1.0], p=[0.6, 0.4]) * rng.uniform(0.001, 0.005),
    )


def sample(force, nuisance, rng, fine_rate):
    """Return (time, readings) of (T, pads, 3, N) forces at `fine_rate`: sampled, noisy, rounded, in range."""
    count = int(len(force) / fine_rate * nuisance.rate)
    time = nuisance.begins + np.arange(count) / nuisance.rate
    taken = time + rng.uniform(-1, 1, count) * nuisance.jitter

    def at(time):
        moment = np.clip(time * fine_rate, 0, len(force) - 1)
        low = np.floor(moment).astype(int)
        high = np.minimum(low + 1, len(force) - 1)
        way = (moment - low)[:, None, None, None]
        return force[low] * (1 - way) + force[high] * way

    if nuisance.averaged:
        clean = np.mean([at(taken - part * nuisance.averaged) for part in (1 / 6, 1 / 2, 5 / 6)], axis=0)
    else:
        clean = at(taken)
    clean = clean * nuisance.scatter
    white = rng.standard_normal(clean.shape)
    rho = nuisance.rho ** (20 / nuisance.rate) if nuisance.rho else 0.0
    coloured = lfilter([np.sqrt(1 - rho**2)], [1, -rho], white, axis=0)
    read = clean + nuisance.noise * (nuisance.white * white + nuisance.coloured * coloured)
    if nuisance.step:
        read = rounded(read, nuisance.step, nuisance.rounding)
    return time, in_range(read)


def rounded(read, step, rounding="round"):
    """Round readings to counts of `step`; see `effects.quantisation`."""
    if rounding == "by_axis":
        step = step * np.array([[0.87], [1.13], [1.0]])
    counts = np.floor(read / step) + 0.5 if rounding == "floor" else np.round(read / step)
    return counts * step


def in_range(read):
    """Clip readings (T, pads, 3, N) to the device's range; normal forces are never negative."""
    read = read.copy()
    read[:, :, 2] = np.maximum(read[:, :, 2], 0)
    return np.clip(read, -12.8, 25.5)
