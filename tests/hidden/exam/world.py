"""What the effects know of a recording, and what an effect is."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

RATE = 500.0
"""Steps a second of the clock on which the sensor's physics runs."""

COUNT = 0.1
"""N a count."""


@dataclass
class World:
    """A recording on the fine clock. Episodes lie side by side, each filled up with free time to one length.

    Forces have the shape (episodes, steps, pads, 3, taxels).

    Attributes:
        rows, cols, pads: the sensor. pitch: (row, column) m. where: (taxels, 2) m, x and y about the middle.
        start: (episodes,) s. opening: (episodes, steps) m. temperature: (episodes, steps) degC.
        peak: (3,) N, the largest force of a taxel by axis, outliers apart.
        load: (pads, taxels) N, the largest force that each taxel sees.
        own_step: N, what the sensor rounds to.
        frames: episode of each recorded frame.
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
        """(episodes, steps) s since the recording began."""
        return self.start[:, None] + np.arange(self.opening.shape[1]) / RATE

    @property
    def channels(self):
        """Shape of one frame."""
        return (self.pads, 3, len(self.where))

    @property
    def distance(self):
        """(taxels, taxels, 2), from the second to the first, in mean pitches."""
        return (self.where[:, None] - self.where[None]) / np.mean(self.pitch)


@dataclass
class Effect:
    """What one effect does.

    Attributes:
        truth: its figures.
        apply: forces on the fine clock to forces.
        on_frames: whether `apply` takes recorded frames (frames, pads, 3, taxels) instead, noise included.
    """

    truth: dict
    apply: Callable
    on_frames: bool = field(default=False)


def size(strength, low, high):
    """Log-uniform between `low` at strength 0 and `high` at 1."""
    return float(low * (high / low) ** strength)


def at_times(force, times):
    """`force` at `times` (s since the episode began, one for each step), straight between steps, held at the ends."""
    last = force.shape[1] - 1
    place = np.clip(np.asarray(times) * RATE, 0, last)
    before = np.minimum(place.astype(int), max(last - 1, 0))
    part = (place - before)[:, None, None, None]
    low = force[:, before]
    return low + part * (force[:, np.minimum(before + 1, last)] - low)
