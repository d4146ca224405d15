"""What is wrong with every sensor: noise, its clock, its range, and tolerances."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from hidden.exam.world import COUNT, RATE

RATES = (25.0, 40.0, 60.0, 90.0)
RANGE = (-12.8, 25.5)


@dataclass
class Nuisance:
    """One sensor's imperfections.

    Attributes:
        rate: frames a second. step: N, what readings are rounded to. average: s over which a frame is averaged.
        sigma: (pads, 3, taxels) N, of the noise. coloured: share of its energy that is correlated; rho: how much.
        gain: (pads, 3, taxels) about 1. shift: (2,) m, of the simulated contact.
    """

    rate: float
    step: float
    average: float
    sigma: np.ndarray
    coloured: float
    rho: float
    gain: np.ndarray
    shift: np.ndarray


def draw(rng, channels, *, coarse, rho, strong_noise):
    """A sensor's imperfections at random."""
    rate = float(rng.choice(RATES))
    step = 0.1 if rng.random() < 0.5 else 0.01
    average = rng.uniform(0.001, 0.005) if rng.random() < 0.4 else 0.0
    level = COUNT * np.exp(rng.uniform(np.log(0.05), np.log(0.5)))
    sigma = level * np.exp(rng.normal(0, 0.2, channels)) * (5 if strong_noise else 1)
    drawn, coloured = rng.uniform(0, 0.95), rng.uniform(0.2, 1)
    gain = 1 + rng.uniform(0.003, 0.01) * rng.normal(size=channels)
    return Nuisance(rate, 0.1 if coarse else step, average, sigma, coloured if rho is None else max(coloured, 0.7),
                    drawn if rho is None else rho, gain, rng.uniform(-1e-4, 1e-4, 2))  # fmt: skip


@dataclass
class Frames:
    """When frames are taken.

    Attributes:
        episode: (frames,). stamp: (frames,) s since the episode began, as written down. taken: s, as it was.
    """

    episode: np.ndarray
    stamp: np.ndarray
    taken: np.ndarray

    def of(self, force, average=0.0, exact=False):
        """Frames of `force` (episodes, steps, ...), straight between the steps."""
        if average:
            moments = [self.taken - part * average for part in (1 / 6, 1 / 2, 5 / 6)]
            return sum(self._at(force, moment) for moment in moments) / 3
        return self._at(force, self.stamp if exact else self.taken)

    def _at(self, force, moment):
        place = np.clip(moment * RATE, 0, force.shape[1] - 1.001)
        before = place.astype(int)
        part = (place - before).reshape(-1, *[1] * (force.ndim - 2))
        low = force[self.episode, before]
        return low + part * (force[self.episode, before + 1] - low)


def frames(rng, nuisance, lengths):
    """Frames of episodes that last `lengths` s: each is taken up to 2 ms beside its stamp."""
    stamps = [rng.uniform(0, 1 / nuisance.rate) + np.arange(int((s - 0.05) * nuisance.rate)) / nuisance.rate
              for s in lengths]  # fmt: skip
    episode = np.repeat(np.arange(len(stamps)), [len(s) for s in stamps])
    stamp = np.concatenate(stamps)
    return Frames(episode, stamp, np.maximum(stamp + rng.uniform(-0.002, 0.002, len(stamp)), 0))


def noise(rng, nuisance, episode):
    """(frames, pads, 3, taxels) N: white, and from frame to frame correlated; each episode begins anew."""
    shape = (len(episode), *nuisance.sigma.shape)
    slow = rng.normal(size=shape)
    rho = nuisance.rho
    for number in np.unique(episode):
        drive = slow[episode == number]
        drive[1:] *= np.sqrt(1 - rho**2)
        slow[episode == number] = lfilter([1], [1, -rho], drive, axis=0)
    both = np.sqrt(nuisance.coloured) * slow + np.sqrt(1 - nuisance.coloured) * rng.normal(size=shape)
    return nuisance.sigma * both


def in_range(reading):
    """What the sensor can say: normal forces are never negative."""
    out = np.clip(reading, *RANGE)
    np.maximum(out[..., 2, :], 0, out=out[..., 2, :])
    return out
