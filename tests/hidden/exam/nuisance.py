"""Imperfections of every sensor: noise, clock, range and tolerances."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from hidden.exam.world import COUNT, RATE

RATES = (25.0, 40.0, 60.0, 90.0)
RANGE = (-12.8, 25.5)


@dataclass
class Nuisance:
    """Imperfections of one sensor.

    Attributes:
        rate: frames per second.
        step: rounding step of the readings, N.
        average: averaging time of a frame, s.
        sigma: (pads, 3, taxels) standard deviation of the noise, N.
        coloured: share of the noise energy that is correlated.
        rho: correlation of that noise from frame to frame.
        gain: (pads, 3, taxels) gains close to 1.
        shift: (2,) offset of the simulated contact, m.
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
    """Draw the imperfections of a sensor."""
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
    """Times of the frames.

    Attributes:
        episode: (frames,) episode numbers.
        stamp: (frames,) recorded times since the start of the episode, s.
        taken: (frames,) true times since the start of the episode, s.
    """

    episode: np.ndarray
    stamp: np.ndarray
    taken: np.ndarray

    def of(self, force, average=0.0, exact=False):
        """Return the frames of `force` (episodes, steps, ...), interpolated linearly between steps."""
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
    """Draw the frames of episodes of `lengths` s, each taken up to 2 ms before or after its stamp."""
    stamps = [rng.uniform(0, 1 / nuisance.rate) + np.arange(int((s - 0.05) * nuisance.rate)) / nuisance.rate
              for s in lengths]  # fmt: skip
    episode = np.repeat(np.arange(len(stamps)), [len(s) for s in stamps])
    stamp = np.concatenate(stamps)
    return Frames(episode, stamp, np.maximum(stamp + rng.uniform(-0.002, 0.002, len(stamp)), 0))


def noise(rng, nuisance, episode):
    """Draw noise (frames, pads, 3, taxels), N: a white part and a correlated part that restarts with each episode."""
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
    """Clip readings to the sensor's range; normal forces are never negative."""
    out = np.clip(reading, *RANGE)
    np.maximum(out[..., 2, :], 0, out=out[..., 2, :])
    return out
