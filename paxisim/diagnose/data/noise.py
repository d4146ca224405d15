"""Noise: the noise of a recording, tolerated errors, and the mean reading of a sensor that rounds and clips."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from paxisim.diagnose.data.pieces import FloatArray, in_blocks
from paxisim.diagnose.rules import NOISE
from paxisim.scene.encoder import EncoderError

NO_RIPPLE = 1e-5  # steps; smaller rounding errors are neglected
MIN_NOISE = 0.02  # steps
BEYOND = 5.0  # distance from a rounding edge, in units of the noise, at which the edge has no effect
TABLE_POINTS = 400  # points of the table below per standard deviation of the noise
BEYOND_EDGE = np.append(ndtr(-(np.arange(int(TABLE_POINTS * BEYOND)) + 0.5) / TABLE_POINTS), 0.0).astype(np.float32)
"""Share of the noise beyond a rounding edge, by the distance to the edge; 0 from `BEYOND` on."""
CLIPPING_REACH = 7.0  # force, in units of the noise, above which clipping at 0 has no effect


@dataclass(frozen=True)
class Tolerance:
    """Errors of calibration and replay that are tolerated and need no explanation.

    Attributes:
        gain: Relative error of the force.
        time: Error of a time stamp, seconds.
        place: Position error of the simulated contact, in pitches.
        encoder: Error of the replayed force due to encoder steps; None if it is not known.
    """

    gain: float = 0.01
    time: float = 0.0015
    place: float = 0.02
    encoder: EncoderError | None = None


@dataclass(frozen=True, eq=False)
class Noise:
    """The noise of a recording and the rounding of its sensor, which together give the mean reading of a force.

    The mean of a rounded value is a staircase, smoothed by noise and the uncertainty of the force. A smooth staircase
    is represented by its first two harmonics.

    Attributes:
        sigma: ``(T, pads, 3, rows, cols)`` N, standard deviation of noise, rounding and tolerated errors.
        step: Newtons per count, 0 if the sensor does not quantise.
        dither: Standard deviation of the noise before rounding (N).
        clips: Whether normal readings are clipped at 0.
        phase: The reading nearest to 0 (N); 0 where readings are whole steps.
        tolerance: Errors that need no explanation.
        excused: Energy of tolerated replay errors, per compared value, in units of the noise.
    """

    sigma: FloatArray
    step: float
    dither: float
    clips: bool = False
    phase: float = 0.0
    tolerance: Tolerance = Tolerance()
    excused: float = 0.0

    def at(self, frames: NDArray[np.intp]) -> Noise:
        """The noise in some frames."""
        return replace(self, sigma=self.sigma[frames])

    @property
    def reads_all(self) -> bool:
        """Whether `read` returns its input unchanged, because rounding and clipping have no effect."""
        return not self._ripples and not self._cuts

    @property
    def is_steep(self) -> bool:
        """Whether the noise rarely reaches the next count."""
        return self.dither < NOISE.steep * self.step

    def read(self, force: FloatArray) -> FloatArray:
        """Mean reading of `force` ``(T, pads, 3, rows, cols)``; `force` itself if there is no difference."""
        return force if self.reads_all else in_blocks(force, lambda part: self._read(force[part]))

    def unread(self, reading: FloatArray) -> FloatArray:
        """The constant force whose mean reading is `reading` ``(..., pads, 3, rows, cols)``."""
        if self.reads_all:
            return reading
        size = float(np.abs(reading).max()) + 2 * self.step + 2 * self.dither
        force = np.linspace(-size, size, 4001)
        grid = np.broadcast_to(force[:, None, None, None, None], (len(force), 1, 3, 1, 1))
        read = np.maximum.accumulate(self.read(grid)[:, 0, :, 0, 0], axis=0)
        found = np.empty_like(reading)
        for axis in range(3):
            rising = np.flatnonzero(np.diff(read[:, axis], prepend=-np.inf) > 1e-9)
            found[..., axis, :, :] = np.interp(reading[..., axis, :, :], read[rising, axis], force[rising])
        return found

    @property
    def left(self) -> float:
        """Variance (N^2) of a reading around its mean, averaged over forces within a step."""
        if self.step == 0:
            return self.dither**2
        order = np.arange(1, 13)
        harmonics = np.exp(-4 * (np.pi * order * self.dither / self.step) ** 2) / order**2
        return self.dither**2 + self.step**2 * (1 / 12 - float(harmonics.sum()) / (2 * np.pi**2))

    def slope(self, force: FloatArray, whole_step: bool = False) -> FloatArray:
        """Derivative of the mean reading with respect to `force`; only if `reads_all` is False.

        Args:
            force: ``(T, pads, 3, rows, cols)`` N.
            whole_step: Whether to take it over a whole step: a steep staircase is flat almost everywhere.
        """
        small = self.step / 2 if whole_step else 1e-3 * (self.step or self.dither)
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
        """How much clipping at 0 adds to the mean reading."""
        table, scale = self._cut_table
        place = np.clip((force + CLIPPING_REACH * self.dither) * scale, 0.0, len(table) - 1.001)
        low = place.astype(np.intp)
        place -= low
        return table[low] * (1 - place) + table[low + 1] * place

    @cached_property
    def _cut_table(self) -> tuple[FloatArray, float]:
        """`_cut_off` tabulated within `CLIPPING_REACH` times the noise, and the number of table entries per newton."""
        force = np.linspace(-CLIPPING_REACH, CLIPPING_REACH, 4001) * self.dither
        below = -force / self.dither
        if self.dither < 0.5 * self.step:  # counts are distinct; the caller clips what is far below 0
            step, top = self.step / self.dither, self.phase / self.dither
            top = top if top < 0 else top - step  # the highest reading below 0
            edges = top + step / 2 - step * np.arange(3)
            sizes = np.array([-top, step, step]) * self.dither
            table = np.sum([size * ndtr(below + edge) for size, edge in zip(sizes, edges, strict=True)], axis=0)
        else:
            bell = np.exp(-0.5 * below**2) / np.sqrt(2 * np.pi)
            table = self.dither * (bell + below * ndtr(below))
        return table, 4000 / (2 * CLIPPING_REACH * self.dither)

    def _rounding(self, force: FloatArray) -> NDArray[np.float32]:
        """How much rounding subtracts from the mean reading, in single precision."""
        least = max(self.dither / self.step, MIN_NOISE)
        turns = ((force - self.phase) / self.step).astype(np.float32).ravel()
        variance = np.float32(least**2) + (np.float32(NOISE.unsure) * turns) ** 2
        turns = turns - np.rint(turns)
        if least >= NOISE.steep:
            ripple = _smooth(turns, variance)
        else:
            steep, ripple = variance < NOISE.steep**2, np.empty_like(turns)
            for where, form in ((steep, _staircase), (~steep, _smooth)):
                part = np.flatnonzero(where)  # twice as fast as the mask
                ripple[part] = form(turns[part], variance[part])
        return (ripple * np.float32(self.step)).reshape(force.shape)


def _smooth(turns: NDArray[np.float32], variance: NDArray[np.float32]) -> NDArray[np.float32]:
    """How much rounding subtracts from `turns` (-0.5 to 0.5) where the staircase is smooth, in steps: two harmonics."""
    first = np.exp(np.float32(-2 * np.pi**2) * variance)  # attenuation of each harmonic by the noise
    second = first**2 * first**2
    angle = np.float32(2 * np.pi) * turns
    return np.sin(angle) * (first - second * np.cos(angle)) / np.float32(np.pi)


def _staircase(turns: NDArray[np.float32], variance: NDArray[np.float32]) -> NDArray[np.float32]:
    """How much rounding subtracts from `turns` (-0.5 to 0.5) where the staircase is steep, in steps."""
    below = (0.5 - np.abs(turns)) / np.sqrt(variance)  # distance to the edge, in units of the noise
    place = np.minimum(below * np.float32(TABLE_POINTS), np.float32(TABLE_POINTS * BEYOND)).astype(np.intp)
    return turns - np.copysign(BEYOND_EDGE[place], turns)


def rate(values: FloatArray, time: FloatArray) -> FloatArray:
    """``(T, ...)`` time derivative of `values` (1/s); samples that share a time stamp get that of the first."""
    fresh = np.diff(time, prepend=-np.inf) > 0
    if fresh.sum() < 2:
        return np.zeros_like(values)
    if fresh.all():
        return np.gradient(values, time, axis=0)
    return np.gradient(values[fresh], time[fresh], axis=0)[np.cumsum(fresh) - 1]


def differences(x: FloatArray, beyond: Literal["constant", "edge"] = "constant") -> tuple[FloatArray, FloatArray]:
    """Central differences along columns and along rows; values beyond the pad are 0 or those of its edge."""
    padded = np.pad(x, ((0, 0), (0, 0), (0, 0), (1, 1), (1, 1)), mode=beyond)
    return padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1], padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]
