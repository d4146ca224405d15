"""Problem: a recording prepared for fitting: both streams on one clock, their noise, and the residual of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.transform import Transform
from paxisim.diagnose.data.baseline import Baseline, Curves
from paxisim.diagnose.data.deviations import Deviations
from paxisim.diagnose.data.directions import Directions, directions_of
from paxisim.diagnose.data.noise import Noise, Tolerance
from paxisim.diagnose.data.noise_floor import dither_of, noise_of, step_of, tolerated
from paxisim.diagnose.data.pieces import FINE_STEP, FloatArray, Pieces, in_blocks
from paxisim.diagnose.data.responses import Responses
from paxisim.diagnose.data.sampling import Sampling
from paxisim.diagnose.rules import NOISE
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.memory import at_rest, in_one_piece, peak_of
from paxisim.logs.recording_arrays import episode_spans
from paxisim.recording import Recording
from paxisim.scene.encoder import EncoderError

NOMINAL_PEAK = 1.0  # N, peak force assumed for a recording without contact
MIN_PEAK_SHARE = 0.05  # lower bound on the peak force of an axis, relative to the overall peak


@dataclass(frozen=True, eq=False)
class Problem:
    """Measured and simulated tensors with the properties of the recording that causes depend on.

    Attributes:
        measured: ``(T, pads, 3, rows, cols)`` newtons.
        simulated: ``(T, pads, 3, rows, cols)`` newtons, the input of a model.
        time: ``(T,)`` seconds.
        covariates: ``(T,)`` values of each covariate, by name.
        episodes: Samples of each episode.
        noise: Noise and rounding of the sensor.
        alive: ``(pads, 3, rows, cols)`` channels in use, without dead ones.
        peak: Peak force on the most loaded taxel (N), the 99.5 % quantile over time.
        peaks: ``(3,)`` peak force by axis, equal for x and y and at least a small share of `peak`.
        least: Lowest simulated force (N), at most 0.
        curves: Time curves that the zero offset of each channel follows; None for no offset. They are projected out of
            every residual, with amplitudes estimated by `baseline`.
        constant: ``(pads, 3, rows, cols)`` N or 0, a known constant offset that is not fitted.
        fitted: ``(T,)`` samples that take part in a fit; None for all.
        directions: Principal components of the covariates without contact.
        aligned: Whether differing clocks were aligned, which makes a constant delay unidentifiable.
        calibrated: Whether the channels were calibrated to a load by `paxisim.calibrate_readout`.
        scene: Effects of scene changes on the simulated stream; None if the scene is not known.
        pads: Names of the pads, if known.
        layout: Layout of the taxels.
    """

    measured: FloatArray
    simulated: FloatArray
    time: FloatArray
    covariates: Mapping[str, FloatArray]
    episodes: tuple[slice, ...]
    noise: Noise
    alive: NDArray[np.bool_]
    peak: float
    peaks: FloatArray = field(default_factory=lambda: np.full(3, NOMINAL_PEAK))
    least: float = 0.0
    curves: Curves | None = None
    constant: FloatArray | float = 0.0
    fitted: NDArray[np.bool_] | None = None
    directions: Directions | None = None
    aligned: bool = False
    calibrated: bool = False
    scene: Responses | None = None
    pads: tuple[str, ...] = ()
    layout: TaxelLayout | None = None

    @property
    def off_grid(self) -> TaxelLayout | None:
        """The layout of taxels that are not on a grid; None for a grid."""
        return None if self.layout is None or self.layout.is_grid else self.layout

    @property
    def samples(self) -> int:
        """Number of compared values: frames times channels in use."""
        return int(len(self.time) * self.alive.sum())

    @cached_property
    def weight(self) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` weight of a residual: 1 / sigma, 0 for a dead channel."""
        return np.where(self.alive, 1 / self.noise.sigma, 0.0)

    @cached_property
    def interval(self) -> float:
        """Median interval between frames of the first episode, in seconds."""
        return float(np.median(np.diff(self.time[self.episodes[0]])))

    @cached_property
    def runs_through(self) -> bool:
        """Whether time never goes backwards between episodes, which slow effects such as drift require."""
        starts = [self.time[span.start] for span in self.episodes]
        ends = [self.time[span.stop - 1] for span in self.episodes]
        return all(after >= before for before, after in zip(ends, starts[1:], strict=False))

    @cached_property
    def runs_on(self) -> bool:
        """Whether several episodes follow one another, so that a sensor remembers all earlier ones."""
        return len(self.episodes) > 1 == len(self._remembered)

    @cached_property
    def has_contact(self) -> bool:
        """Whether the simulation shows any force."""
        return bool(self.simulated.any())

    @cached_property
    def one_load(self) -> bool:
        """Whether the simulated force is the same for all channels, as with a load cell.

        It is also True if the channels were calibrated to loads, because their gains then include all mixing of axes.
        """
        if self.calibrated:
            return True
        loads = self.simulated[:, self.alive]
        return loads.shape[1] > 1 and self.has_contact and bool(np.all(loads == loads[:, :1]))

    @cached_property
    def at_rest(self) -> NDArray[np.bool_]:
        """``(T,)`` whether no taxel is pressed."""
        return at_rest(self.simulated, self.peak)

    @cached_property
    def untouched(self) -> NDArray[np.bool_]:
        """``(T,)`` whether no contact has occurred yet in the episode, so that no memory effect is present."""
        before = np.zeros(len(self.time), dtype=bool)
        for span in self.episodes:
            pressed = np.flatnonzero(~self.at_rest[span])
            before[span.start : span.start + pressed[0] if len(pressed) else span.stop] = True
        return before

    @cached_property
    def baseline(self) -> Baseline:
        """Estimates of the zero offset from the samples at rest, where other errors are small.

        If few samples are at rest, all samples are used. The same holds if the noise rarely reaches the next count, as
        a small offset then shows only under load.
        """
        rest = self.at_rest
        samples = rest if rest.mean() > NOISE.rest and not self.noise.is_steep else np.ones_like(rest)
        samples = samples if self.fitted is None else samples & self.fitted
        return Baseline(self.curves, self.weight, samples, self.episodes, self.interval)

    @cached_property
    def at_baseline(self) -> Problem:
        """The problem restricted to the samples of the baseline."""
        return self._at(self.baseline.by_episode)

    @cached_property
    def sampling(self) -> Sampling:
        """Frames that suffice for a fit, and to compare a prediction."""
        return Sampling(self.episodes, self.simulated, self.weight, self.interval, self.samples)

    @cached_property
    def bases(self) -> dict[tuple[str, int], NDArray[np.floating]]:
        """Bases of causes on the simulated force, by name and number of frames; `Model` fills it."""
        return {}

    @property
    def thinned(self) -> Problem:
        """The problem restricted to the frames that suffice for a fit."""
        return self if self.sampling.fitted == 1 else self._thinned

    @property
    def compared(self) -> Problem:
        """The problem restricted to the frames that suffice to compare a prediction."""
        return self if self.sampling.compared == 1 else self._compared

    # cached apart from `thinned` and `compared`: a cached reference to self would delay freeing until a collection
    @cached_property
    def _thinned(self) -> Problem:
        return self.every(self.sampling.fitted)

    @cached_property
    def _compared(self) -> Problem:
        return self.every(self.sampling.compared)

    def at_thinned(self, values: NDArray[Any]) -> NDArray[Any]:
        """Select from ``(T, ...)`` values those at the frames of `thinned`."""
        return self.sampling.at(self.sampling.fitted, values)

    def at_compared(self, values: NDArray[Any]) -> NDArray[Any]:
        """Select from ``(T, ...)`` values those at the frames of `compared`."""
        return self.sampling.at(self.sampling.compared, values)

    def every(self, stride: int) -> Problem:
        """The problem restricted to every `stride`-th frame of each episode."""
        return self if stride == 1 else self._at(self.sampling.frames(stride))

    def _at(self, frames: Sequence[NDArray[np.intp]]) -> Problem:
        """The problem restricted to the given frames of each episode."""
        frames = [own for own in frames if len(own)]
        which = np.concatenate(frames)
        ends = np.cumsum([len(own) for own in frames])
        return replace(
            self,
            measured=self.measured[which],
            simulated=self.simulated[which],
            time=self.time[which],
            covariates={name: values[which] for name, values in self.covariates.items()},
            episodes=tuple(slice(int(end) - len(own), int(end)) for end, own in zip(ends, frames, strict=True)),
            noise=self.noise.at(which),
            curves=None if self.curves is None else self.curves.at(which),
            fitted=None if self.fitted is None else self.fitted[which],
            scene=None if self.scene is None else self.scene.select(which),
        )

    @cached_property
    def _remembered(self) -> tuple[slice, ...]:
        """The episodes, merged where the sensor's memory persists from one to the next."""
        return in_one_piece(self.time, self.episodes, self.at_rest)

    @cached_property
    def _pieces(self) -> Pieces:
        """These spans, side by side."""
        return Pieces(self.time, self._remembered)

    @cached_property
    def _finer_pieces(self) -> Pieces:
        """The same, interpolated between the frames."""
        return Pieces(self.time, self._remembered, between=True)

    def run(self, transform: Transform, x: FloatArray) -> FloatArray:
        """Run `transform` on the sequence `x`, restarting it at each episode that does not continue the previous one.

        Transforms that act on the time scale of the frame interval run on interpolated frames.
        """
        for member in transform.flattened:
            x = self._run(member, x)
        return x

    def _run(self, transform: Transform, x: FloatArray) -> FloatArray:
        given = {name: c for name, c in self.covariates.items() if name in transform.covariate_names}
        if not transform.has_memory:
            return in_blocks(x, lambda part: transform(x[part], {name: c[part] for name, c in given.items()}))
        finer = transform.between_frames(FINE_STEP)
        if finer is not None:
            return self._finer_pieces.run(finer, x, given)
        return self._pieces.run(transform, x, given)

    def read(self, force: FloatArray) -> FloatArray:
        """Mean reading of the sensor for `force`, see `Noise`."""
        return self.noise.read(force)

    def residual(self, prediction: FloatArray) -> FloatArray:
        """Residual of the measurement in units of the noise, if the sensor reads the force `prediction`."""
        left = self.weigh(self.measured - self.read(prediction))
        return left if self._deviations is None else left + self._deviations.simulated

    def weigh(self, difference: FloatArray) -> FloatArray:
        """A difference of tensors in units of the noise, after projecting out a zero offset that follows `curves`.

        In a scene, pose deviations of single episodes are also projected out.
        """
        if self.curves is None:
            weighed = difference * self.weight
        else:
            zero = self.baseline.fit(difference).reshape(len(self.curves), -1)
            weighed = difference - (self.curves.values.T @ zero).reshape(difference.shape)
            weighed *= self.weight
        return weighed if self._deviations is None else self._deviations.removed(weighed)

    @cached_property
    def _deviations(self) -> Deviations | None:
        return None if self.scene is None else Deviations.of(self.scene, self.weight, self.episodes)


def _peaks_of(simulated: NDArray[np.floating], peak: float) -> FloatArray:
    """``(3,)`` N, peak force by axis, equal for both shear axes and at least `MIN_PEAK_SHARE` times `peak`."""
    by_axis = np.quantile(np.abs(simulated).max(axis=(1, 3, 4)), 0.995, axis=0)
    by_axis[:2] = by_axis[:2].max()
    return np.maximum(by_axis, MIN_PEAK_SHARE * peak)


def showing(gain: FloatArray) -> NDArray[np.bool_]:
    """``(episodes,)`` whether an episode is affected by a cause, judged by the cause's gain or loss in it."""
    return np.abs(gain) > 1e-2 * np.abs(gain).max()


def problem_of(recording: Recording, scene: Responses | None = None, tolerance: Tolerance | None = None) -> Problem:
    """Prepare a recording for fitting.

    Args:
        recording: Recording with both streams, without NaN, from `prepare`.
        scene: Effects of scene changes on the simulated stream; None if the scene is not known.
        tolerance: Errors that need no explanation.

    Raises:
        InvalidValueError: The noise is not finite.
    """
    assert recording.measured is not None
    assert recording.simulated is not None
    measured, simulated = recording.measured.astype(np.float64), recording.simulated.astype(np.float64)
    peak = peak_of(simulated) or NOMINAL_PEAK
    step, phase = step_of(measured)
    covariates = {n: c for n, c in recording.covariates.items() if c.ndim == 1 and np.isfinite(c).all()}
    rest = at_rest(simulated, peak)
    calibrated = "readout" in recording.metadata  # channels that do not respond to the load are 0 in both streams
    tolerance = replace(tolerance or Tolerance(), encoder=EncoderError.from_recording(recording))
    problem = Problem(
        measured, simulated, recording.time, covariates, episode_spans(recording.episode),
        noise=Noise(np.ones(1), step, 0.0, bool(measured[:, :, 2].min() >= 0), phase, tolerance),
        alive=simulated.any(axis=0) if calibrated else np.ones(measured.shape[1:], dtype=bool),
        peak=peak, peaks=_peaks_of(simulated, peak), least=min(float(simulated.min()), 0.0),
        directions=directions_of(covariates, rest if rest.mean() > NOISE.rest else np.ones_like(rest)),
        aligned="clocks_aligned_by" in recording.metadata, calibrated=calibrated,
        scene=scene, pads=recording.pads, layout=recording.layout,
    )  # fmt: skip
    return with_noise(problem)


def with_noise(problem: Problem) -> Problem:
    """The problem with its noise estimated from its own streams."""
    alive, step = problem.alive, problem.noise.step
    noise = noise_of(problem.measured, problem.simulated, problem.episodes, step, alive)
    allowed = tolerated(problem.simulated, problem.time, problem.episodes, problem.noise.tolerance)
    if alive[:, :2].any():
        dither = dither_of(
            problem.measured - problem.noise.phase, problem.simulated, problem.at_rest, problem.untouched,
            problem.episodes, problem.interval, step, alive,
        )  # fmt: skip
    else:  # no shear is measured
        dither = float(np.sqrt(max(np.median(noise[alive]) ** 2 - step**2 / 12, 0.0))) if alive.any() else 0.0
    noise = np.where(noise < NOISE.coarse * step, np.sqrt(step**2 / 12 + dither**2), noise)
    sigma = np.sqrt(noise**2 + allowed)
    if not np.isfinite(sigma).all():  # infinite noise would hide every discrepancy
        raise InvalidValueError(
            "the noise of the recording is not finite: is a time, a force or a tolerance too large?"
        )
    excused = 0.0 if problem.scene is None else float(np.mean((allowed / sigma**2)[:, alive]))
    return replace(problem, noise=replace(problem.noise, sigma=sigma, dither=dither, excused=excused))
