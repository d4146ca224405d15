"""What every hidden effect is made of: a form, drawn for one bench, gives a function of the forces in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from .motion import Plan
from .presses import FINE, Array

Run = Callable[[Array], Array]
"""Function of ``(T, pads, 3, rows, cols)`` readings (N); at `FINE`, or at the frames if the form is digital."""

ORDER = (
    "stiffening",
    "creep",
    "hysteresis",
    "gel_operator",
    "axis_coupling",
    "rotation",
    "layout",
    "swapped_taxels",
    "interference",
    "axis_gain",
    "taxel_gain",
    "offset",
    "drift",
    "low_pass",
    "latency",
    "dead_band",
    "saturation",
    "quantisation",
    "dead_taxels",
    "foreign",
)
"""Usual order of the effects in a sensor, from the contact to the number."""


@dataclass(frozen=True, eq=False)
class Bench:
    """What a form may know when it is drawn.

    Attributes:
        plan: The motion.
        count: What one count of this sensor is worth (N), whether or not it rounds.
        reach: ``(3,)`` largest absolute force of each axis in the simulation (N).
        force: ``(T, pads, 3, rows, cols)`` simulated forces at `FINE` (N).
    """

    plan: Plan
    count: float
    reach: Array
    force: Array

    @property
    def shape(self) -> tuple[int, int, int]:
        """Pads, rows and columns."""
        return self.plan.pads, self.plan.rows, self.plan.cols

    @property
    def reaches(self) -> Array:
        """``(3, 1, 1)`` largest force of each axis, for arithmetic with a reading."""
        return self.reach[:, None, None]

    @property
    def places(self) -> Array:
        """``(taxels, 2)`` places of the taxels along x and y (pitches from the middle)."""
        _, rows, cols = self.shape
        y, x = np.meshgrid(np.arange(rows) - (rows - 1) / 2, np.arange(cols) - (cols - 1) / 2, indexing="ij")
        return np.column_stack([x.ravel(), y.ravel()])

    @property
    def moving(self) -> np.ndarray:
        """``(T,)`` mask of the times within an episode; the pads rest at all others."""
        mask = np.zeros(len(self.plan.time), bool)
        for e in self.plan.episodes:
            first = round(e.start * FINE)
            mask[first : first + len(e.force)] = True
        return mask

    def loaded(self, share: float = 0.3) -> Array:
        """Return ``(n, 3)`` pad, row and column of the taxels whose load exceeds a share of the largest (RMS)."""
        load = np.sqrt(np.mean(self.force[::10, :, 2] ** 2, axis=0))
        return np.argwhere(load >= share * load.max())


@dataclass(frozen=True)
class Form:
    """One way in which a cause shows.

    Attributes:
        cause: Name of the cause in `paxisim.diagnose`, or ``foreign``.
        name: Name of the form.
        make: Function of (rng, bench, size) that draws the effect; size 0 is the smallest magnitude, 1 the largest.
            With an equal generator, only the magnitude depends on size.
        digital: Whether it acts on the numbers, after the noise.
        sized: Whether the magnitude depends on size at all.
    """

    cause: str
    name: str
    make: Callable[[Generator, Bench, float], Run]
    digital: bool = False
    sized: bool = True


def between(low: float, high: float, size: float) -> float:
    """Return the number a share `size` of the way from low to high, on a logarithmic scale."""
    return float(low * (high / low) ** size)


def either(rng: Generator) -> float:
    """Return 1 or -1."""
    return float(rng.choice([-1.0, 1.0]))


def mixed(x: Array, matrix: Array) -> Array:
    """Return the readings after a matrix ``(3 taxels, 3 taxels)`` from all forces of a pad to all its channels."""
    flat = x.reshape(*x.shape[:2], -1)
    return (flat @ matrix.T).reshape(x.shape)


def only_there(run: Run, mask: np.ndarray) -> Run:
    """Return an effect that acts only on the channels of a mask ``(pads, 1, rows, cols)``."""
    return lambda x: np.where(mask, run(x), x)


def from_then(run: Run, share: float) -> Run:
    """Return an effect that sets in suddenly, after a share of the recording."""

    def late(x: Array) -> Array:
        y = x.copy()
        first = round(share * len(x))
        y[first:] = run(x)[first:]
        return y

    return late
