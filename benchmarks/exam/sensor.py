"""The sensor around the effects: tolerated nuisance, noise, clipping and counts.

Way of a reading: true forces (the object 0.1 mm aside) -> analogue effects -> gain scatter -> frames (+-2 ms) -> noise
-> digital effects -> clip at 0 -> counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from .bench import ORDER, Bench, Form, Run, between
from .contact import press
from .motion import Plan
from .presses import FINE, Array


@dataclass(frozen=True)
class Effect:
    """A drawn form.

    Attributes:
        form: The form.
        size: Its magnitude, 0 to 1.
        run: The function of the readings.
        place: Rank in the chain; by default that of its cause in `ORDER`.
    """

    form: Form
    size: float
    run: Run
    place: float

    @classmethod
    def of(cls, form: Form, size: float, run: Run, place: float | None = None) -> Effect:
        """Return an effect at the usual place of its cause, or at another."""
        return cls(form, size, run, ORDER.index(form.cause) if place is None else place)


@dataclass(frozen=True, eq=False)
class Sensor:
    """A bench with a sensor on it; two readings of it differ only by the effects.

    Attributes:
        bench: What forms are drawn for.
        force: ``(T, pads, 3, rows, cols)`` true forces at `FINE` (N), with the error of pose.
        gain: ``(pads, 3, rows, cols)`` gains about 1: tolerated scatter.
        jitter: ``(N,)`` deviation of each frame's moment from its stamp (s).
        noise: ``(N, pads, 3, rows, cols)`` (N).
        clips: Whether normal forces below 0 read 0.
        rounds: Whether the readings are whole counts.
    """

    bench: Bench
    force: Array
    gain: Array
    jitter: Array
    noise: Array
    clips: bool
    rounds: bool

    def at_frames(self, fine: Array) -> Array:
        """Return ``(N, ...)`` values at the moments of the frames, from ``(T, ...)`` at `FINE`."""
        at = np.clip((self.bench.plan.frames + self.jitter) * FINE, 0, len(fine) - 1.001)
        low = at.astype(int)
        share = (at - low).reshape(-1, *[1] * (fine.ndim - 1))
        return (1 - share) * fine[low] + share * fine[low + 1]

    def read(self, effects: Sequence[Effect] = (), noise: bool = True, counts: bool = True) -> Array:
        """Return the readings ``(N, pads, 3, rows, cols)`` in N."""
        x, ordered = self.force, sorted(effects, key=lambda e: e.place)
        for effect in ordered:
            if not effect.form.digital:
                x = effect.run(x)
        y = self.gain * self.at_frames(x) + (self.noise if noise else 0)
        for effect in ordered:
            if effect.form.digital:
                y = effect.run(y)
        if self.clips:
            y[:, :, 2] = np.maximum(y[:, :, 2], 0)
        return self.bench.count * np.round(y / self.bench.count) if counts and self.rounds else y

    def loudness(self) -> float:
        """Return the RMS of the noise as it is read, clipping and rounding included (N)."""
        return _rms(self.read() - self.read(noise=False, counts=False))

    def nuisance(self) -> float:
        """Return the RMS of what pose, scatter and jitter change (N)."""
        plain = self.bench.force[np.round(self.bench.plan.frames * FINE).astype(int)]
        return _rms(self.read(noise=False, counts=False) - plain)

    def signal(self, effects: Sequence[Effect], without: Sequence[Effect] = ()) -> float:
        """Return the RMS of what the effects beyond `without` change, divided by the noise."""
        return _rms(self.read(effects, counts=False) - self.read(without, counts=False)) / self.loudness()


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def draw_sensor(rng: Generator, plan: Plan, rounds: bool | None = None, loud: bool = False) -> Sensor:
    """Draw a sensor for a motion.

    Args:
        rng: Source of all draws.
        plan: The motion.
        rounds: Whether it reads whole counts of 0.02 to 0.1 N; by default at random.
        loud: Whether its noise is strong and slow: AR(1) of a count with a correlation of 0.95 from frame to frame.
    """
    count = between(0.02, 0.1, rng.uniform())
    pose = rng.uniform(-1, 1, (len(plan.episodes), 2))
    pose *= 0.1 / np.maximum(1, np.linalg.norm(pose, axis=1, keepdims=True))  # within 0.1 mm
    force = press(plan, np.stack([np.zeros_like(pose), pose]))
    shape = force.shape[2:]
    frames = len(plan.frames)
    white = count * between(0.1, 0.5, rng.uniform()) * rng.normal(size=(frames, *shape))
    rho = 0.95 if loud else rng.uniform(0.3, 0.95)
    slow = count * (1.0 if loud else between(0.05, 0.4, rng.uniform()))
    start = rng.normal(size=(200, *shape))
    coloured = np.asarray(
        lfilter([np.sqrt(1 - rho**2)], [1, -rho], np.r_[start, rng.normal(size=(frames, *shape))], axis=0)
    )
    bench = Bench(plan, count, np.abs(force[0]).max(axis=(0, 1, 3, 4)), force[0])
    return Sensor(
        bench=bench,
        force=force[1],
        gain=1 + rng.uniform(0.003, 0.01) * rng.normal(size=shape),
        jitter=rng.uniform(-0.002, 0.002, frames),
        noise=white + slow * coloured[200:],
        clips=bool(rng.uniform() < 0.6),
        rounds=bool(rng.uniform() < 0.5) if rounds is None else rounds,
    )
