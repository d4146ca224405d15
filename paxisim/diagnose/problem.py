"""Problem: a recording made ready for fitting: both streams, their noise, and how a model is judged against them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr
from scipy.stats import norm

from paxisim.augment.transform import Transform
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """Measured and simulated tensors with all that a cause may need to know of them.

    Attributes:
        measured: ``(T, pads, 3, rows, cols)`` newtons.
        simulated: The same, what a model is applied to.
        time: ``(T,)`` seconds.
        covariates: ``(T,)`` each, by name.
        episodes: The samples of each episode.
        sigma: ``(T, pads, 3, rows, cols)`` what is not to be explained (N): noise, rounding and tolerances.
        peak: The force that the most loaded taxel reaches (N), 99.5 % quantile over time.
        alive: ``(pads, 3, rows, cols)`` channels that take part; dead ones do not.
        step: Newtons a count of the sensor, 0 if it does not count.
        dither: Noise before rounding (N).
        clips: Whether a normal reading never goes below 0.
        zero: ``(T, pads, 3, rows, cols)`` or 0: what is read without any force (N), known so far.
        least: The least force (N) that is simulated, at most 0.
    """

    measured: FloatArray
    simulated: FloatArray
    time: FloatArray
    covariates: Mapping[str, FloatArray]
    episodes: tuple[slice, ...]
    sigma: FloatArray
    peak: float
    alive: NDArray[np.bool_]
    step: float
    dither: float
    clips: bool = False
    zero: FloatArray | float = 0.0
    least: float = 0.0

    @cached_property
    def weight(self) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` what a residual is multiplied by: 1 / sigma, 0 for a dead channel."""
        return np.where(self.alive, 1 / self.sigma, 0.0)

    @cached_property
    def _share(self) -> FloatArray:
        """Each sample's share in its channel's mean."""
        square = self.weight**2
        return square / np.maximum(square.sum(axis=0), 1e-12)

    @property
    def samples(self) -> int:
        """Number of numbers that are compared."""
        return int(len(self.time) * self.alive.sum())

    @cached_property
    def one_load(self) -> bool:
        """Whether the simulation says one and the same for all channels, as a load cell's force does."""
        loads = self.simulated[:, self.alive]
        return loads.shape[1] > 1 and bool(np.all(loads == loads[:, :1]))

    def run(self, transform: Transform, x: FloatArray) -> FloatArray:
        """`transform` on the sequence `x`, begun anew for each episode."""
        if not transform.has_memory:
            return transform.run(x, self.time, self.covariates)
        parts = [
            transform.run(x[span], self.time[span], {name: c[span] for name, c in self.covariates.items()})
            for span in self.episodes
        ]
        return np.concatenate(parts)

    def read(self, force: FloatArray) -> FloatArray:
        """What a sensor that counts in steps, and not below 0, reads of `force` on average, given its noise.

        The mean of a rounded value is a staircase that noise makes smooth; its first two harmonics are taken.
        """
        read = self._rounded(force)
        if self.clips and self.dither:
            read = np.concatenate([read[:, :, :2], read[:, :, 2:] + self._cut(force[:, :, 2:])], axis=2)
            np.maximum(read[:, :, 2], 0, out=read[:, :, 2])
        return read

    def _cut(self, force: FloatArray) -> FloatArray:
        """What the readings below 0 that are read as 0 add to the mean."""
        below = -force / self.dither
        if self.dither < 0.5 * self.step:  # counts are told apart; what is far below is cut by the caller
            step = self.step / self.dither
            return self.step * np.sum([ndtr(below - (k + 0.5) * step) for k in range(3)], axis=0)
        bell = np.exp(-0.5 * np.minimum(below**2, 1e3)) / np.sqrt(2 * np.pi)
        return self.dither * (bell + below * ndtr(below))

    def _rounded(self, force: FloatArray) -> FloatArray:
        if not self.step:
            return force
        angle = 2 * np.pi * force / self.step
        spread = (np.pi * self.dither / self.step) ** 2
        ripple = np.exp(-2 * spread) * np.sin(angle) - np.exp(-8 * spread) * np.sin(2 * angle) / 2
        return force - self.step / np.pi * ripple

    def select(self, episodes: Sequence[int]) -> Problem:
        """The problem of these episodes alone, in the order given."""
        spans = [self.episodes[number] for number in episodes]
        frames = np.concatenate([np.arange(len(self.time))[span] for span in spans])
        ends = np.cumsum([span.stop - span.start for span in spans])
        zero = self.zero if isinstance(self.zero, (int, float)) else self.zero[frames]
        return replace(
            self,
            measured=self.measured[frames],
            simulated=self.simulated[frames],
            time=self.time[frames],
            covariates={name: values[frames] for name, values in self.covariates.items()},
            episodes=tuple(
                slice(int(end) - (span.stop - span.start), int(end)) for span, end in zip(spans, ends, strict=True)
            ),
            sigma=self.sigma[frames],
            zero=zero,
        )

    @property
    def runs_through(self) -> bool:
        """Whether time goes on from one episode to the next, as slow changes need it."""
        starts = [self.time[span.start] for span in self.episodes]
        ends = [self.time[span.stop - 1] for span in self.episodes]
        return all(after >= before for before, after in zip(ends, starts[1:], strict=False))

    @cached_property
    def at_rest(self) -> NDArray[np.bool_]:
        """``(T,)`` where no taxel is pressed."""
        return np.abs(self.simulated).max(axis=(1, 2, 3, 4)) < 0.01 * max(self.peak, 1e-9)

    def residual(self, prediction: FloatArray) -> FloatArray:
        """What is left of the measurement, in units of the noise, if a sensor is given `prediction` to read."""
        return self.weigh(self.measured - self.read(prediction))

    def weigh(self, difference: FloatArray) -> FloatArray:
        """A difference of tensors in units of the noise, freed of each channel's mean."""
        return (difference - np.sum(self._share * difference, axis=0)) * self.weight


def noise_of(measured: FloatArray, simulated: FloatArray, episodes: tuple[slice, ...], step: float) -> FloatArray:
    """The noise of each channel (N), from how the residual changes from sample to sample.

    Changes are small against the noise for whatever is slow, an effect included; half of them by size is taken, so
    that fast moments do not count. A channel that is quieter than half of its axis is given that axis' median.
    """
    residual = measured - simulated
    steps = np.concatenate([np.diff(residual[span], axis=0) for span in episodes])
    sigma = np.sqrt(np.median(steps**2, axis=0) / 0.455 / 2)
    typical = np.median(sigma, axis=(0, 2, 3), keepdims=True)
    if measured[:, :, 2].min() >= 0:  # what is cut off below 0 hides the noise of a normal force at rest
        typical[:, 2] = max(typical[0, 2, 0, 0], float(np.mean(typical[:, :2])))
    return np.maximum(np.maximum(sigma, typical), max(step / np.sqrt(12), 1e-3))


def step_of(measured: FloatArray) -> float:
    """The step (N) in which a sensor counts; 0 where no step is to be seen."""
    values = np.unique(np.round(measured[:: max(1, len(measured) // 400)].ravel(), 5))
    gaps = np.diff(values)
    gaps = gaps[gaps > 2e-4]
    if not len(gaps):
        return 0.0
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    for _ in range(3):  # large readings tell the step more exactly than neighbours do, once their number is known
        counts = np.round(values / step)
        near = np.abs(counts) <= 0.1 / 1e-5 * step
        step = float(np.sum(values[near] * counts[near]) / max(np.sum(counts[near] ** 2), 1.0)) or step
    off = np.abs(values / step - np.round(values / step))
    return step if np.quantile(off, 0.99) < 0.02 else 0.0


@dataclass(frozen=True)
class Tolerance:
    """What every calibrated sensor and every replayed motion is off by, and what nobody needs explained.

    Attributes:
        gain: Share of the force.
        time: Seconds between a sample and its time stamp.
        place: Pitches by which the simulated contact may be off.
    """

    gain: float = 0.01
    time: float = 0.0015
    place: float = 0.02


def tolerated(x: FloatArray, time: FloatArray, episodes: tuple[slice, ...], tolerance: Tolerance) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` variance (N^2) that `tolerance` allows about the simulation `x`."""
    speed = np.concatenate([np.gradient(x[span], time[span], axis=0) for span in episodes])
    padded = np.pad(x, ((0, 0), (0, 0), (0, 0), (1, 1), (1, 1)))
    across = (padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]) ** 2
    along = (padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1]) ** 2
    return (tolerance.gain * x) ** 2 + (tolerance.time * speed) ** 2 + tolerance.place**2 * (across + along)


def dither_of(measured: FloatArray, quiet: NDArray[np.bool_], episodes: tuple[slice, ...], step: float) -> float:
    """The noise before rounding (N), from the shear that is read where nothing is pressed.

    Where it is small against a step it is told from how often a channel leaves its commonest count.
    """
    if not quiet.any():
        return 0.0
    shear = measured[quiet][:, :, :2]
    each = [measured[span][quiet[span]][:, :, :2].std(axis=0) for span in episodes if quiet[span].sum() >= 5]
    spread = float(np.median(each)) if each else 0.0
    if spread > 0.6 * step:
        return float(np.sqrt(spread**2 - step**2 / 12))
    counts = np.round(shear / step)
    away = np.mean(counts != np.median(counts, axis=0), axis=0)
    return float(0.5 * step / norm.isf(np.clip(np.median(away), 1e-3, 0.8) / 2))


def problem_of(recording: Recording, tolerance: Tolerance) -> Problem:
    """A recording made ready.

    Raises:
        InvalidValueError: A stream is missing, or holds NaN, or nothing was pressed in the simulation.
    """
    if recording.measured is None or recording.simulated is None:
        missing = "measured" if recording.measured is None else "simulated"
        raise InvalidValueError(f"a diagnosis compares two streams, but the recording has no {missing} tensor")
    measured, simulated = recording.measured.astype(np.float64), recording.simulated.astype(np.float64)
    for name, values in (("measured", measured), ("simulated", simulated)):
        if not np.isfinite(values).all():
            raise InvalidValueError(f"{name} must be finite; load the recording with missing='drop'")
    starts = [*np.flatnonzero(np.diff(recording.episode, prepend=recording.episode[0] - 1)), len(recording)]
    episodes = tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(starts))
    if min(span.stop - span.start for span in episodes) < 2:
        raise InvalidValueError("each episode needs two samples at least")
    peak = float(np.quantile(np.abs(simulated).max(axis=(1, 2, 3, 4)), 0.995))
    if not peak > 0:
        raise InvalidValueError("the simulated tensor is 0 throughout: there is nothing to compare")
    step = step_of(measured)
    covariates = {n: c for n, c in recording.covariates.items() if c.ndim == 1 and np.isfinite(c).all()}
    problem = Problem(
        measured, simulated, recording.time, covariates, episodes, np.ones(1), peak,
        np.ones(measured.shape[1:], dtype=bool), step, 0.0, clips=bool(measured[:, :, 2].min() >= 0),
        least=min(float(simulated.min()), 0.0),
    )  # fmt: skip
    return with_noise(problem, tolerance)


def with_noise(problem: Problem, tolerance: Tolerance) -> Problem:
    """The problem with its noise read from its own streams."""
    noise = noise_of(problem.measured, problem.simulated, problem.episodes, problem.step)
    allowed = tolerated(problem.simulated, problem.time, problem.episodes, tolerance)
    dither = dither_of(problem.measured, problem.at_rest, problem.episodes, problem.step)
    return replace(problem, sigma=np.sqrt(noise**2 + allowed), dither=dither)
