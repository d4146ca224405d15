"""Counting: a sensor that counts in steps, and not below 0, reads another force than acts on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from paxisim.diagnose.blocks import in_blocks
from paxisim.diagnose.noise import FloatArray

NO_RIPPLE = 1e-5  # of a step: what noise leaves of rounding is not computed below it
STEEP = 0.25  # of a step: with less noise two harmonics do not make the staircase
LEAST_NOISE = 0.02  # of a step
BEYOND = 5.0  # times the noise from an edge, where none of it leaves the step
UNSURE = 0.02  # of a force: by how much calibration and the contact's place leave it unknown, which smears its steps
REACH = 7.0  # times the noise: beyond it none of it changes the sign of a force


@dataclass(frozen=True, eq=False)
class Counting:
    """What a sensor reads of a force on average, given its noise.

    The mean of a rounded value is a staircase that noise makes smooth, as does what is not known of the force. Where it
    is smooth, its first two harmonics are taken.

    Attributes:
        step: Newtons a count, 0 if it does not count.
        dither: Noise before rounding (N).
        clips: Whether a normal reading never goes below 0.
    """

    step: float
    dither: float
    clips: bool

    @property
    def reads_all(self) -> bool:
        """Whether `read` returns what it is given."""
        return not self._ripples and not self._cuts

    @property
    def is_steep(self) -> bool:
        """Whether noise hardly reaches the next count."""
        return self.dither < STEEP * self.step

    def read(self, force: FloatArray) -> FloatArray:
        """What is read of `force` ``(T, pads, 3, rows, cols)`` on average; `force` itself where that is the same."""
        return force if self.reads_all else in_blocks(force, lambda part: self._read(force[part]))

    def unread(self, reading: FloatArray) -> FloatArray:
        """The constant force that reads, on average, as `reading` ``(pads, 3, rows, cols)``; below 0 as it is."""
        if self.reads_all:
            return reading
        size = float(np.abs(reading).max()) + 2 * self.step + 2 * self.dither
        force = np.linspace(-size, size, 4001)
        grid = np.broadcast_to(force[:, None, None, None, None], (len(force), 1, 3, 1, 1))
        read = np.maximum.accumulate(self.read(grid)[:, 0, :, 0, 0], axis=0)
        found = np.empty_like(reading)
        for axis in range(3):
            rising = np.flatnonzero(np.diff(read[:, axis], prepend=-np.inf) > 1e-9)
            found[:, axis] = np.interp(reading[:, axis], read[rising, axis], force[rising])
        return found

    @property
    def left(self) -> float:
        """The variance (N^2) of a reading about what `read` says of its force, the mean of forces within a step."""
        if self.step == 0:
            return self.dither**2
        order = np.arange(1, 13)
        harmonics = np.exp(-4 * (np.pi * order * self.dither / self.step) ** 2) / order**2
        return self.dither**2 + self.step**2 * (1 / 12 - float(harmonics.sum()) / (2 * np.pi**2))

    def slope(self, force: FloatArray) -> FloatArray:
        """By how much what is read of `force` changes with it; only where `reads_all` is False."""
        small = 1e-3 * (self.step or self.dither)
        return (self.read(force + small) - self.read(force - small)) / (2 * small)

    def _read(self, force: FloatArray) -> FloatArray:
        read = force - self._rounding(force) if self._ripples else force.copy()
        if self._cuts:
            normal = read[:, :, 2]
            normal += self._cut_off(force[:, :, 2])
            np.maximum(normal, 0, out=normal)
        return read

    @property
    def _cuts(self) -> bool:
        return self.clips and self.dither > 0

    @property
    def _ripples(self) -> bool:
        return self.step > 0 and np.exp(-2 * (np.pi * self.dither / self.step) ** 2) > NO_RIPPLE

    def _cut_off(self, force: FloatArray) -> FloatArray:
        """What the readings below 0 that are read as 0 add to the mean."""
        table, scale = self._cut_table
        place = np.clip((force + REACH * self.dither) * scale, 0.0, len(table) - 1.001)
        low = place.astype(np.intp)
        place -= low
        return table[low] * (1 - place) + table[low + 1] * place

    @cached_property
    def _cut_table(self) -> tuple[FloatArray, float]:
        """That addition between plus and minus `REACH` of the noise, and the places of the table in a newton."""
        force = np.linspace(-REACH, REACH, 4001) * self.dither
        below = -force / self.dither
        if self.dither < 0.5 * self.step:  # counts are told apart; what is far below is cut by the caller
            step = self.step / self.dither
            table = self.step * np.sum([ndtr(below - (k + 0.5) * step) for k in range(3)], axis=0)
        else:
            bell = np.exp(-0.5 * below**2) / np.sqrt(2 * np.pi)
            table = self.dither * (bell + below * ndtr(below))
        return table, 4000 / (2 * REACH * self.dither)

    def _rounding(self, force: FloatArray) -> NDArray[np.float32]:
        """What rounding takes from the mean; 7 digits of it are enough."""
        least = max(self.dither / self.step, LEAST_NOISE)
        turns = (force / self.step).astype(np.float32)
        variance = np.float32(least**2) + (np.float32(UNSURE) * turns) ** 2
        turns = turns - np.rint(turns)
        first = np.exp(np.float32(-2 * np.pi**2) * variance)  # what noise leaves of the first harmonic; of the second:
        second = first**2 * first**2
        angle = np.float32(2 * np.pi) * turns
        ripple = np.sin(angle) * (first - second * np.cos(angle)) / np.float32(np.pi)
        if least < STEEP:
            steep = variance < STEEP**2
            ripple[steep] = _staircase(turns[steep], np.sqrt(variance[steep]))
        return ripple * np.float32(self.step)


def _staircase(turns: NDArray[np.float32], width: NDArray[np.float32]) -> NDArray[np.float32]:
    """What rounding takes from turns of -0.5 to 0.5 whose noise is less than `STEEP`, in steps."""
    taken = turns.copy()
    at_edge = np.abs(turns) > 0.5 - BEYOND * width
    own, noise, half = turns[at_edge], width[at_edge], np.float32(0.5)
    taken[at_edge] += ndtr((-own - half) / noise) - ndtr((own - half) / noise)
    return taken
