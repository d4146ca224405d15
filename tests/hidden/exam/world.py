"""The data that effects get about a recording, and the definition of an effect."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

RATE = 500.0
"""Rate (Hz) of the fine clock, on which the sensor's physics runs."""

COUNT = 0.1
"""Newtons per count."""


@dataclass
class World:
    """A recording on the fine clock, with all episodes padded to the same length without contact.

    Forces have the shape (episodes, steps, pads, 3, taxels).

    Attributes:
        rows, cols, pads: numbers of rows, columns and pads.
        pitch: (row, column) pitch, m.
        where: (taxels, 2) x and y of the taxels relative to the middle, m.
        start: (episodes,) start times, s.
        opening: (episodes, steps) gripper opening, m.
        temperature: (episodes, steps) temperature, degC.
        peak: (3,) largest force of a taxel by axis, without outliers, N.
        load: (pads, taxels) largest normal force on each taxel, N.
        own_step: rounding step of the sensor, N.
        frames: (frames,) episode of each recorded frame.
    """

    rows: int
    cols: int
    pads: int
    pitch: tuple
    where: np.ndarray
    start: np.ndarray
    opening: np.ndarray
    temperature: np.ndarray
    peak: np.ndarray
    load: np.ndarray
    own_step: float
    frames: np.ndarray

    @property
    def clock(self):
        """(episodes, steps) time since the start of the recording, s."""
        return self.start[:, None] + np.arange(self.opening.shape[1]) / RATE

    @property
    def channels(self):
        """Shape of one frame."""
        return (self.pads, 3, len(self.where))

    @property
    def distance(self):
        """(taxels, taxels, 2) offsets from the second taxel to the first, in mean pitches."""
        return (self.where[:, None] - self.where[None]) / np.mean(self.pitch)


@dataclass
class Effect:
    """One effect.

    Attributes:
        truth: true parameters of the effect.
        apply: function from forces on the fine clock to forces.
        on_frames: whether `apply` instead takes recorded frames (frames, pads, 3, taxels), including noise.
    """

    truth: dict
    apply: Callable
    on_frames: bool = field(default=False)


def size(strength, low, high):
    """Interpolate logarithmically from `low` at strength 0 to `high` at strength 1."""
    return float(low * (high / low) ** strength)


def at_times(force, times):
    """Interpolate `force` linearly at `times` (s since the episode began, one per step), constant beyond the ends."""
    last = force.shape[1] - 1
    place = np.clip(np.asarray(times) * RATE, 0, last)
    before = np.minimum(place.astype(int), max(last - 1, 0))
    part = (place - before)[:, None, None, None]
    low = force[:, before]
    return low + part * (force[:, np.minimum(before + 1, last)] - low)
