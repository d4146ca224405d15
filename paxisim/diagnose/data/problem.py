"""Problem: a recording prepared for fitting, with both streams, their noise and the residual of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.chain import Chain
from paxisim.augment.latency import Latency
from paxisim.augment.low_pass import LowPass
from paxisim.augment.transform import Transform
from paxisim.diagnose.data.between import FINE_STEP
from paxisim.diagnose.data.blocks import in_blocks
from paxisim.diagnose.data.counting import Counting
from paxisim.diagnose.data.deviations import Deviations
from paxisim.diagnose.data.directions import Directions, directions_of
from paxisim.diagnose.data.dither import dither_of
from paxisim.diagnose.data.noise import FloatArray, Tolerance, noise_of, step_of, tolerated
from paxisim.diagnose.data.pieces import Pieces, in_one_piece
from paxisim.diagnose.data.responses import Responses
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.recording_arrays import episode_spans
from paxisim.recording import Recording
from paxisim.scene.encoder import EncoderError

NOMINAL_PEAK = 1.0  # N, peak force assumed for a recording without contact
MIN_PEAK_SHARE = 0.05  # lower bound on the peak force of an axis, relative to the overall peak
PRESSED_SHARE = 0.01  # force above which a taxel is pressed, relative to the peak force
MAX_FITTED_VALUES = 100_000  # number of values sufficient for a fit
MAX_FRAME_INTERVAL = 0.05  # s, longest interval between fitted frames
MIN_REST_SHARE = 0.05  # least share of samples at rest for estimating the zero offset from them alone
MIN_ZERO_SAMPLES = 4  # fewest samples for estimating the zero offset of an episode
PIECE_SECONDS = 1.0  # s, length of the pieces whose scatter gives the uncertainty of the zero offset
COARSE_NOISE = 1.2  # quantisation steps; below it, differences between readings are a poor estimate of the noise
MAX_INTERPOLATION_ERROR = 0.01  # largest interpolation error between fitted frames, relative to the energy of the noise


@dataclass(frozen=True, eq=False)
class Problem:
    """Measured and simulated tensors with the properties of the recording that causes depend on.

    Attributes:
        measured: ``(T, pads, 3, rows, cols)`` newtons.
        simulated: ``(T, pads, 3, rows, cols)`` newtons, the input of a model.
        time: ``(T,)`` seconds.
        covariates: ``(T,)`` values of each covariate, by name.
        episodes: Samples of each episode.
        sigma: ``(T, pads, 3, rows, cols)`` standard deviation (N) of noise, rounding and tolerated errors.
        peak: Peak force on the most loaded taxel (N), the 99.5 % quantile over time.
        alive: ``(pads, 3, rows, cols)`` channels in use, without dead ones.
        step: Newtons per count; 0 if the sensor does not quantise.
        dither: Noise before rounding (N).
        clips: Whether normal readings never go below 0.
        least: Lowest simulated force (N), at most 0.
        curves: ``(curves, T)`` time curves that the zero offset of each channel may follow. They are projected out of
            every residual, with amplitudes estimated from the samples `told`.
        fitted: ``(T,)`` samples that take part in a fit; None for all.
        constant: ``(pads, 3, rows, cols)`` N or 0, a known constant offset that is not fitted.
        owners: Name of the cause that each curve belongs to.
        shrink: ``(curves, pads, 3, 1, 1)`` factor on the deviation of a curve's amplitudes from a plane over the pad's
            axis; None for no shrinkage.
        phase: The reading nearest to 0 (N); 0 where readings are whole steps.
        directions: Principal components of the covariates without contact.
        peaks: ``(3,)`` peak force by axis, equal for x and y and at least a small share of `peak`.
        aligned: Whether differing clocks were aligned, which makes a constant delay unidentifiable.
        calibrated: Whether the channels were calibrated to a load by `paxisim.calibrate_readout`.
        tolerance: Errors that need no explanation.
        scene: Effects of scene changes on the simulated stream; None if the scene is not known.
        excused: Energy of tolerated replay errors in that scene, per compared value, in units of the noise.
        pads: Names of the pads, if known.
        layout: Layout of the taxels.
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
    least: float = 0.0
    curves: FloatArray | None = None
    fitted: NDArray[np.bool_] | None = None
    constant: FloatArray | float = 0.0
    shrink: FloatArray | None = None
    phase: float = 0.0
    owners: tuple[str, ...] = ()
    directions: Directions | None = None
    peaks: FloatArray = field(default_factory=lambda: np.full(3, NOMINAL_PEAK))
    calibrated: bool = False
    aligned: bool = False
    tolerance: Tolerance = field(default_factory=Tolerance)
    scene: Responses | None = None
    excused: float = 0.0
    pads: tuple[str, ...] = ()
    layout: TaxelLayout | None = None

    @property
    def off_grid(self) -> TaxelLayout | None:
        """The layout of taxels that are not on a grid; None for a grid."""
        return None if self.layout is None or self.layout.is_grid else self.layout

    @cached_property
    def weight(self) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` weight of a residual: 1 / sigma, 0 for a dead channel."""
        return np.where(self.alive, 1 / self.sigma, 0.0)

    @cached_property
    def interval(self) -> float:
        """Median interval between frames of the first episode, in seconds."""
        return float(np.median(np.diff(self.time[self.episodes[0]])))

    @cached_property
    def told(self) -> NDArray[np.bool_]:
        """``(T,)`` samples for estimating the zero offset: those at rest, where other errors are small.

        If few samples are at rest, all samples are used. The same holds if the noise rarely reaches the next count, as
        a small offset then shows only under load.
        """
        rest = self.at_rest
        told = rest if rest.mean() > MIN_REST_SHARE and not self.counting.is_steep else np.ones_like(rest)
        return told if self.fitted is None else told & self.fitted

    @cached_property
    def at_told(self) -> Problem:
        """The problem restricted to the samples `told`."""
        return self._at(self.told_by_episode)

    @cached_property
    def told_by_episode(self) -> list[NDArray[np.intp]]:
        """Indices of the samples `told`, by episode."""
        return [span.start + np.flatnonzero(self.told[span]) for span in self.episodes]

    @cached_property
    def _square(self) -> FloatArray:
        """``(T, channels)`` least-squares weights for the zero offset."""
        return (self.weight**2).reshape(len(self.time), -1) * self.told[:, None]

    @cached_property
    def _inverse(self) -> FloatArray:
        """``(channels, curves, curves)`` inverse normal matrix of the zero offset."""
        assert self.curves is not None
        normal = np.einsum("it,jt,tc->cij", self.curves, self.curves, self._square, optimize=True)
        ridge = 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-12
        return np.linalg.inv(normal + ridge * np.eye(len(self.curves)))

    def zero_of(self, difference: FloatArray) -> FloatArray:
        """``(curves, pads, 3, rows, cols)`` least-squares amplitudes of `curves` for a difference (N)."""
        assert self.curves is not None
        flat = difference.reshape(len(self.time), -1)
        right = self.curves @ (self._square * flat)
        zero = np.einsum("cij,jc->ic", self._inverse, right).reshape(len(self.curves), *self.alive.shape)
        if self.shrink is not None:
            zero = self.drawn(zero)
            for steady in np.flatnonzero(np.ptp(self.curves, axis=1) == 0):  # the constant, given the others
                normal = np.einsum("it,tc->ic", self.curves[steady] * self.curves, self._square)
                others = np.sum(normal * zero.reshape(len(zero), -1), axis=0) - normal[steady] * zero[steady].ravel()
                told = (right[steady] - others) / np.maximum(normal[steady], 1e-12)
                zero[steady] = told.reshape(zero[steady].shape)
        return zero

    @cached_property
    def _onto_planes(self) -> FloatArray:
        """``(pads, 3, taxels, taxels)`` projection of a pad axis's values onto the plane fitted to channels in use."""
        pads, axes, rows, cols = self.alive.shape
        row, col = np.meshgrid(np.arange(rows) - (rows - 1) / 2, np.arange(cols) - (cols - 1) / 2, indexing="ij")
        plane = np.stack([np.ones(rows * cols), row.ravel(), col.ravel()], axis=1)
        alive = self.alive.reshape(pads, axes, -1)
        return plane @ np.linalg.pinv(plane * alive[..., None]) * alive[..., None, :]

    def planes(self, values: FloatArray) -> FloatArray:
        """``(..., pads, 3, rows, cols)`` planes fitted to the values of each pad's axis."""
        flat = values.reshape(*values.shape[:-2], -1)
        return np.einsum("pkij,...pkj->...pki", self._onto_planes, flat, optimize=True).reshape(values.shape)

    def drawn(self, amounts: FloatArray) -> FloatArray:
        """Amplitudes of the curves, shrunk toward planes by `shrink`."""
        if self.shrink is None:
            return amounts
        plane = self.planes(amounts)
        return plane + self.shrink * (amounts - plane)

    def curves_owned_by(self, name: str) -> list[int]:
        """Indices of the curves that belong to a cause."""
        return [number for number, owner in enumerate(self.owners) if owner == name]

    def means_where_told(self, values: FloatArray, piece: float = np.inf) -> FloatArray:
        """Means of ``(T, ...)`` values over the samples `told`, by episode or by pieces of `piece` seconds."""
        most = max(MIN_ZERO_SAMPLES, int(min(piece / self.interval, len(self.time))))
        pieces = [
            part
            for frames in self.told_by_episode
            for part in np.array_split(frames, max(1, len(frames) // most))
            if len(part) >= MIN_ZERO_SAMPLES
        ]
        return np.reshape([values[part].mean(axis=0) for part in pieces], (len(pieces), *values.shape[1:]))

    def shrunk(self, difference: FloatArray) -> Problem:
        """The problem with the amplitudes of each curve, except constants, shrunk toward a plane over each pad's axis.

        This is a James-Stein estimator: the shrinkage increases as the spread of the amplitudes approaches their
        sampling error, estimated from the scatter between pieces at rest.

        Args:
            difference: ``(T, pads, 3, rows, cols)`` N, to be explained by the zero offset.
        """
        assert self.curves is not None
        steady = np.ptp(self.curves, axis=1) == 0
        basis = self.means_where_told(self.curves.T, PIECE_SECONDS)
        means = self.means_where_told(difference, PIECE_SECONDS)
        degrees = len(basis) - basis.shape[1]
        if steady.all() or degrees < 2:
            return self
        solve = np.linalg.pinv(basis)
        amounts = np.tensordot(solve, means, 1)
        left = np.sum((means - np.tensordot(basis, amounts, 1)) ** 2, axis=0, where=self.alive) / degrees
        variance = np.multiply.outer(np.sum(solve**2, axis=1), left.sum(axis=(-2, -1), keepdims=True))
        spread = np.sum((amounts - self.planes(amounts)) ** 2, axis=(-2, -1), keepdims=True, where=self.alive)
        free = 1 - np.trace(self._onto_planes, axis1=-2, axis2=-1) / np.maximum(self.alive.sum(axis=(-2, -1)), 1)
        share = 1 - variance * free[..., None, None] / np.maximum(spread, 1e-12)
        return replace(self, shrink=np.where(steady[:, None, None, None, None], 1.0, np.clip(share, 0.0, 1.0)))

    @property
    def samples(self) -> int:
        """Number of compared values: frames times channels in use."""
        return int(len(self.time) * self.alive.sum())

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
    def _pieces(self) -> Pieces:
        """Episodes side by side, merged where they follow without a break, because the sensor's memory persists."""
        return Pieces(self.time, in_one_piece(self.time, self.episodes))

    @cached_property
    def _finer_pieces(self) -> Pieces:
        """The same, interpolated between the frames."""
        return Pieces(self.time, in_one_piece(self.time, self.episodes), between=True)

    def run(self, transform: Transform, x: FloatArray) -> FloatArray:
        """Run `transform` on the sequence `x`, restarting it at each episode that does not continue the previous one.

        Latency and low-pass filters, which act on the time scale of the frame interval, run on interpolated frames.
        """
        if isinstance(transform, Chain):
            for member in transform.members:
                x = self.run(member, x)
            return x
        given = {name: c for name, c in self.covariates.items() if name in transform.covariate_names}
        if not transform.has_memory:
            return in_blocks(x, lambda part: transform(x[part], {name: c[part] for name, c in given.items()}))
        if isinstance(transform, Latency):  # interpolated points need a larger buffer
            more = int(np.ceil(4 * abs(float(transform.delay)) / FINE_STEP)) + 4
            return self._finer_pieces.run(replace(transform, capacity=max(transform.capacity, more)), x, {})
        pieces = self._finer_pieces if isinstance(transform, LowPass) else self._pieces
        return pieces.run(transform, x, given)

    @cached_property
    def counting(self) -> Counting:
        """How the sensor turns forces into readings."""
        return Counting(self.step, self.dither, self.clips, self.phase)

    def read(self, force: FloatArray) -> FloatArray:
        """Mean reading of the sensor for `force`, see `Counting`."""
        return self.counting.read(force)

    def select(self, episodes: Sequence[int]) -> Problem:
        """The problem restricted to these episodes, in the given order."""
        return self._at([np.arange(len(self.time))[self.episodes[number]] for number in episodes])

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
            sigma=self.sigma[which],
            curves=None if self.curves is None else self.curves[:, which],
            fitted=None if self.fitted is None else self.fitted[which],
            scene=None if self.scene is None else self.scene.select(which),
        )

    @cached_property
    def stride(self) -> int:
        """Stride of the frames that suffice for a fit: between them the simulation is linear to within the noise.

        A small recording is not thinned. Models with memory also assume a linear input between frames.
        """
        most = min(self._spare, int(MAX_FRAME_INTERVAL / max(self.interval, 1e-9)))
        for stride in range(most, 1, -1):
            if self._bend(stride) < MAX_INTERPOLATION_ERROR:
                return stride
        return 1

    def _bend(self, stride: int) -> float:
        """Mean squared error of interpolating the simulation linearly between every n-th frame, in noise units."""
        total = 0.0
        for span in self.episodes:
            kept, middle = self.simulated[span][::stride], self.simulated[span][stride // 2 :: stride]
            count = min(len(kept) - 1, len(middle))
            if count > 0:
                way = (stride // 2) / stride
                off = kept[:count] * (1 - way) + kept[1 : count + 1] * way - middle[:count]
                total += float(np.sum((off * self.weight[span][stride // 2 :: stride][:count]) ** 2))
        return total * stride / self.samples

    @property
    def thinned(self) -> Problem:
        """The problem restricted to every `stride`-th frame."""
        return self if self.stride == 1 else self._thinned

    @property
    def compared(self) -> Problem:
        """The problem restricted to the frames that suffice to compare a prediction."""
        return self if self._spare == 1 else self._compared

    # cached apart from `thinned` and `compared`: a cached reference to self would delay freeing until a collection
    @cached_property
    def _thinned(self) -> Problem:
        return self.every(self.stride)

    @cached_property
    def _compared(self) -> Problem:
        return self.every(self._spare)

    def at_compared(self, values: NDArray[Any]) -> NDArray[Any]:
        """Select from ``(T, ...)`` values those at the frames of `compared`."""
        return values if self._spare == 1 else values[self.frames(self._spare)]

    def at_thinned(self, values: NDArray[Any]) -> NDArray[Any]:
        """Select from ``(T, ...)`` values those at the frames of `thinned`."""
        return values if self.stride == 1 else values[self.frames(self.stride)]

    @property
    def _spare(self) -> int:
        return max(1, round(self.samples / MAX_FITTED_VALUES))

    def frames(self, stride: int) -> NDArray[np.intp]:
        """Indices of every `stride`-th frame of each episode."""
        return np.concatenate([np.arange(span.start, span.stop, stride) for span in self.episodes])

    def every(self, stride: int) -> Problem:
        """The problem restricted to every `stride`-th frame of each episode."""
        return self if stride == 1 else self._at([np.arange(s.start, s.stop, stride) for s in self.episodes])

    @cached_property
    def runs_through(self) -> bool:
        """Whether time never goes backwards between episodes, which slow effects such as drift require."""
        starts = [self.time[span.start] for span in self.episodes]
        ends = [self.time[span.stop - 1] for span in self.episodes]
        return all(after >= before for before, after in zip(ends, starts[1:], strict=False))

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
            zero = self.zero_of(difference).reshape(len(self.curves), -1)
            weighed = difference - (self.curves.T @ zero).reshape(difference.shape)
            weighed *= self.weight
        return weighed if self._deviations is None else self._deviations.removed(weighed)

    @cached_property
    def _deviations(self) -> Deviations | None:
        return None if self.scene is None else Deviations.of(self.scene, self.weight, self.episodes)


def at_rest(simulated: FloatArray, peak: float) -> NDArray[np.bool_]:
    """``(T,)`` whether no taxel is pressed."""
    return np.abs(simulated).max(axis=(1, 2, 3, 4)) < PRESSED_SHARE * max(peak, 1e-9)


def peak_of(simulated: NDArray[np.floating]) -> float:
    """Peak force (N) on the most loaded taxel, the 99.5 % quantile over time."""
    return float(np.quantile(np.abs(simulated).max(axis=(1, 2, 3, 4)), 0.995))


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
    episodes = episode_spans(recording.episode)
    peak = peak_of(simulated) or NOMINAL_PEAK
    step, phase = step_of(measured)
    covariates = {n: c for n, c in recording.covariates.items() if c.ndim == 1 and np.isfinite(c).all()}
    rest = at_rest(simulated, peak)
    directions = directions_of(covariates, rest if rest.mean() > MIN_REST_SHARE else np.ones_like(rest))
    alive = np.ones(measured.shape[1:], dtype=bool)
    if "readout" in recording.metadata:  # channels that do not respond to the load are 0 in both streams
        alive = simulated.any(axis=0)
    problem = Problem(
        measured, simulated, recording.time, covariates, episodes, np.ones(1), peak,
        alive, step, 0.0, clips=bool(measured[:, :, 2].min() >= 0),
        least=min(float(simulated.min()), 0.0), phase=phase, peaks=_peaks_of(simulated, peak), directions=directions,
        calibrated="readout" in recording.metadata, aligned="clocks_aligned_by" in recording.metadata,
        tolerance=replace(tolerance or Tolerance(), encoder=EncoderError.told_by(recording)),
        scene=scene, pads=recording.pads, layout=recording.layout,
    )  # fmt: skip
    return with_noise(problem)


def with_noise(problem: Problem) -> Problem:
    """The problem with its noise estimated from its own streams."""
    alive, step = problem.alive, problem.step
    noise = noise_of(problem.measured, problem.simulated, problem.episodes, step, alive)
    allowed = tolerated(problem.simulated, problem.time, problem.episodes, problem.tolerance)
    if alive[:, :2].any():
        dither = dither_of(
            problem.measured - problem.phase, problem.simulated, problem.at_rest, problem.untouched,
            problem.episodes, problem.interval, step, alive,
        )  # fmt: skip
    else:  # no shear is measured
        dither = float(np.sqrt(max(np.median(noise[alive]) ** 2 - step**2 / 12, 0.0))) if alive.any() else 0.0
    noise = np.where(noise < COARSE_NOISE * step, np.sqrt(step**2 / 12 + dither**2), noise)
    sigma = np.sqrt(noise**2 + allowed)
    if not np.isfinite(sigma).all():  # infinite noise would hide every discrepancy
        raise InvalidValueError(
            "the noise of the recording is not finite: is a time, a force or a tolerance too large?"
        )
    excused = 0.0 if problem.scene is None else float(np.mean((allowed / sigma**2)[:, alive]))
    return replace(problem, sigma=sigma, dither=dither, excused=excused)
