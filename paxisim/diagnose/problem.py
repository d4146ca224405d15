"""Problem: a recording made ready for fitting: both streams, their noise, and how a model is judged against them."""

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
from paxisim.diagnose.between import FINE
from paxisim.diagnose.blocks import in_blocks
from paxisim.diagnose.counting import Counting
from paxisim.diagnose.directions import Directions, directions_of
from paxisim.diagnose.dither import dither_of
from paxisim.diagnose.inside.deviations import Deviations
from paxisim.diagnose.inside.responses import Responses
from paxisim.diagnose.noise import FloatArray, Tolerance, noise_of, step_of, tolerated
from paxisim.diagnose.pieces import Pieces, in_one_piece
from paxisim.errors import InvalidValueError
from paxisim.logs.recording_arrays import episode_spans
from paxisim.recording import Recording
from paxisim.scene.encoder import EncoderError

NOMINAL = 1.0  # N, taken for the peak force of a recording without contact
LEAST_PEAK = 0.05  # of the peak force, that an axis is taken to reach
PRESSED = 0.01  # of the peak force, from which on a taxel is pressed
ENOUGH = 100_000  # numbers, for a fit
LONGEST = 0.05  # s between the frames that are fitted
RESTING = 0.05  # of the samples, that must be at rest for the zero to be read there
LEAST_TOLD = 4  # samples of an episode that tell its zero
PIECE = 1.0  # s, of the pieces whose scatter says how well the zero is told
SELDOM = 1.2  # of a step: where readings change by less from one to the next, that tells little of the noise
BEND = 0.01  # of the noise's energy, that may lie between them


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
        least: The least force (N) that is simulated, at most 0.
        curves: ``(curves, T)`` courses in time that the zero of each channel may follow. They are taken out of every
            residual, read where they are told best (`told`).
        fitted: ``(T,)`` samples that take part in a fit, None for all.
        constant: ``(pads, 3, rows, cols)`` N or 0, what is read without force and is not fitted.
        owners: Names of the causes that the curves belong to.
        shrink: ``(curves, pads, 3, 1, 1)`` how much remains of what the amounts of a curve have beside a plane over a
            pad's axis; None if all does.
        phase: The reading nearest to 0 (N); 0 where readings are whole steps.
        directions: What the recorded covariates do without contact.
        peaks: ``(3,)`` as `peak`, of shear for x and y and of normal force; at least a small share of it.
        aligned: Whether clocks that were apart were aligned, so that a constant delay cannot be told.
        calibrated: Whether the channels were calibrated to a load, by `paxisim.calibrate_readout`.
        tolerance: Errors that need no explanation.
        scene: What changes of the scene do to the simulated stream; None if the scene is not known.
        excused: Energy of the errors that a replay in that scene may have, per number that is compared, in units of
            the noise.
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
    peaks: FloatArray = field(default_factory=lambda: np.full(3, NOMINAL))
    calibrated: bool = False
    aligned: bool = False
    tolerance: Tolerance = field(default_factory=Tolerance)
    scene: Responses | None = None
    excused: float = 0.0

    @cached_property
    def weight(self) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` what a residual is multiplied by: 1 / sigma, 0 for a dead channel."""
        return np.where(self.alive, 1 / self.sigma, 0.0)

    @cached_property
    def interval(self) -> float:
        """Usual seconds between two frames."""
        return float(np.median(np.diff(self.time[self.episodes[0]])))

    @cached_property
    def told(self) -> NDArray[np.bool_]:
        """``(T,)`` samples that tell the zero: where nothing is pressed, as what else is wrong is small there.

        Where noise hardly reaches the next count a small zero shows only under load, so all samples count.
        """
        rest = self.at_rest
        told = rest if rest.mean() > RESTING and not self.counting.is_steep else np.ones_like(rest)
        return told if self.fitted is None else told & self.fitted

    @cached_property
    def at_told(self) -> Problem:
        """The problem of those samples alone."""
        return self._at(self.told_by_episode)

    @cached_property
    def told_by_episode(self) -> list[NDArray[np.intp]]:
        """Their numbers, by episode."""
        return [span.start + np.flatnonzero(self.told[span]) for span in self.episodes]

    @cached_property
    def _square(self) -> FloatArray:
        """``(T, channels)`` weights with which the zero is told."""
        return (self.weight**2).reshape(len(self.time), -1) * self.told[:, None]

    @cached_property
    def _inverse(self) -> FloatArray:
        """``(channels, curves, curves)`` of the normal equations of the zero."""
        assert self.curves is not None
        normal = np.einsum("it,jt,tc->cij", self.curves, self.curves, self._square, optimize=True)
        ridge = 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] + 1e-12
        return np.linalg.inv(normal + ridge * np.eye(len(self.curves)))

    def zero_of(self, difference: FloatArray) -> FloatArray:
        """``(curves, pads, 3, rows, cols)`` amounts of `curves` that explain most of a difference (N)."""
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
        """``(pads, 3, taxels, taxels)`` from values of a pad's axis to the plane through those that take part."""
        pads, axes, rows, cols = self.alive.shape
        row, col = np.meshgrid(np.arange(rows) - (rows - 1) / 2, np.arange(cols) - (cols - 1) / 2, indexing="ij")
        plane = np.stack([np.ones(rows * cols), row.ravel(), col.ravel()], axis=1)
        alive = self.alive.reshape(pads, axes, -1)
        return plane @ np.linalg.pinv(plane * alive[..., None]) * alive[..., None, :]

    def planes(self, values: FloatArray) -> FloatArray:
        """``(..., pads, 3, rows, cols)`` the planes through values of each pad's axis."""
        flat = values.reshape(*values.shape[:-2], -1)
        return np.einsum("pkij,...pkj->...pki", self._onto_planes, flat, optimize=True).reshape(values.shape)

    def drawn(self, amounts: FloatArray) -> FloatArray:
        """Amounts of the curves, drawn to planes by `shrink`."""
        if self.shrink is None:
            return amounts
        plane = self.planes(amounts)
        return plane + self.shrink * (amounts - plane)

    def curves_owned_by(self, name: str) -> list[int]:
        """The numbers of a cause's curves."""
        return [number for number, owner in enumerate(self.owners) if owner == name]

    def means_where_told(self, values: FloatArray, piece: float = np.inf) -> FloatArray:
        """Means of ``(T, ...)`` values where the zero is told, of each episode or piece of so many seconds of one."""
        most = max(LEAST_TOLD, int(min(piece / self.interval, len(self.time))))
        pieces = [
            part
            for frames in self.told_by_episode
            for part in np.array_split(frames, max(1, len(frames) // most))
            if len(part) >= LEAST_TOLD
        ]
        return np.reshape([values[part].mean(axis=0) for part in pieces], (len(pieces), *values.shape[1:]))

    def shrunk(self, difference: FloatArray) -> Problem:
        """The problem in which the amounts of each curve but a constant are drawn to a plane over each pad's axis.

        They are drawn the more, the less their spread exceeds what the scatter of pieces at rest makes of it (the
        James-Stein estimator).

        Args:
            difference: ``(T, pads, 3, rows, cols)`` N, to be explained by the zero.
        """
        assert self.curves is not None
        steady = np.ptp(self.curves, axis=1) == 0
        basis, means = self.means_where_told(self.curves.T, PIECE), self.means_where_told(difference, PIECE)
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
        """Number of numbers that are compared."""
        return int(len(self.time) * self.alive.sum())

    @cached_property
    def has_contact(self) -> bool:
        """Whether the simulation shows a force at all."""
        return bool(self.simulated.any())

    @cached_property
    def one_load(self) -> bool:
        """Whether the simulation says one and the same for all channels, as a load cell's force does.

        Also if the channels were calibrated to several loads: their gains include all mixing between axes.
        """
        if self.calibrated:
            return True
        loads = self.simulated[:, self.alive]
        return loads.shape[1] > 1 and self.has_contact and bool(np.all(loads == loads[:, :1]))

    @cached_property
    def _pieces(self) -> Pieces:
        """Episodes side by side; those that follow one another without a break are one, as the sensor remembers."""
        return Pieces(self.time, in_one_piece(self.time, self.episodes))

    @cached_property
    def _finer_pieces(self) -> Pieces:
        """The same with points between the frames."""
        return Pieces(self.time, in_one_piece(self.time, self.episodes), between=True)

    def run(self, transform: Transform, x: FloatArray) -> FloatArray:
        """`transform` on the sequence `x`, begun anew for each episode that does not go on from the one before.

        What is fast as the frames themselves, latency and low-pass, acts on curves drawn through them.
        """
        if isinstance(transform, Chain):
            for member in transform.members:
                x = self.run(member, x)
            return x
        given = {name: c for name, c in self.covariates.items() if name in transform.covariate_names}
        if not transform.has_memory:
            return in_blocks(x, lambda part: transform(x[part], {name: c[part] for name, c in given.items()}))
        if isinstance(transform, Latency):  # as many frames more as there are points between them
            more = int(np.ceil(4 * abs(float(transform.delay)) / FINE)) + 4
            return self._finer_pieces.run(replace(transform, capacity=max(transform.capacity, more)), x, {})
        pieces = self._finer_pieces if isinstance(transform, LowPass) else self._pieces
        return pieces.run(transform, x, given)

    @cached_property
    def counting(self) -> Counting:
        """How the sensor turns forces into readings."""
        return Counting(self.step, self.dither, self.clips, self.phase)

    def read(self, force: FloatArray) -> FloatArray:
        """What the sensor reads of `force` on average, see `Counting`."""
        return self.counting.read(force)

    def select(self, episodes: Sequence[int]) -> Problem:
        """The problem of these episodes alone, in the order given."""
        return self._at([np.arange(len(self.time))[self.episodes[number]] for number in episodes])

    def _at(self, frames: Sequence[NDArray[np.intp]]) -> Problem:
        """The problem of some frames of each episode."""
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
        """Every how many frames are enough for a fit: between them the simulation runs straight, to the noise.

        A recording of few numbers is not thinned; models with memory hold their input straight between frames too.
        """
        most = min(self._spare, int(LONGEST / max(self.interval, 1e-9)))
        for stride in range(most, 1, -1):
            if self._bend(stride) < BEND:
                return stride
        return 1

    def _bend(self, stride: int) -> float:
        """Mean square, in noise units, by which the simulation leaves the straight lines between every n-th frame."""
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
        """The problem of every `stride`-th frame."""
        return self if self.stride == 1 else self._thinned

    @property
    def compared(self) -> Problem:
        """The problem of as many frames as are needed to compare a prediction that was made for all of them."""
        return self if self._spare == 1 else self._compared

    # one that kept itself would be freed only when garbage is collected
    @cached_property
    def _thinned(self) -> Problem:
        return self.every(self.stride)

    @cached_property
    def _compared(self) -> Problem:
        return self.every(self._spare)

    def at_compared(self, values: NDArray[Any]) -> NDArray[Any]:
        """Of ``(T, ...)`` values those at the frames of `compared`."""
        return values if self._spare == 1 else values[self.frames(self._spare)]

    def at_thinned(self, values: NDArray[Any]) -> NDArray[Any]:
        """Of ``(T, ...)`` values those at the frames of `thinned`."""
        return values if self.stride == 1 else values[self.frames(self.stride)]

    @property
    def _spare(self) -> int:
        return max(1, round(self.samples / ENOUGH))

    def frames(self, stride: int) -> NDArray[np.intp]:
        """The numbers of every `stride`-th frame of each episode."""
        return np.concatenate([np.arange(span.start, span.stop, stride) for span in self.episodes])

    def every(self, stride: int) -> Problem:
        """The problem of every `stride`-th frame of each episode."""
        return self if stride == 1 else self._at([np.arange(s.start, s.stop, stride) for s in self.episodes])

    @cached_property
    def runs_through(self) -> bool:
        """Whether time goes on from one episode to the next, as slow changes need it."""
        starts = [self.time[span.start] for span in self.episodes]
        ends = [self.time[span.stop - 1] for span in self.episodes]
        return all(after >= before for before, after in zip(ends, starts[1:], strict=False))

    @cached_property
    def at_rest(self) -> NDArray[np.bool_]:
        """``(T,)`` where no taxel is pressed."""
        return at_rest(self.simulated, self.peak)

    @cached_property
    def untouched(self) -> NDArray[np.bool_]:
        """``(T,)`` before the first contact of an episode, where no memory of one is."""
        before = np.zeros(len(self.time), dtype=bool)
        for span in self.episodes:
            pressed = np.flatnonzero(~self.at_rest[span])
            before[span.start : span.start + pressed[0] if len(pressed) else span.stop] = True
        return before

    def residual(self, prediction: FloatArray) -> FloatArray:
        """What is left of the measurement, in units of the noise, if a sensor is given `prediction` to read."""
        return self.weigh(self.measured - self.read(prediction))

    def weigh(self, difference: FloatArray) -> FloatArray:
        """A difference of tensors in units of the noise, freed of what a zero that follows `curves` explains.

        In a scene it is also freed of what the poses of single episodes explain.
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
    """``(T,)`` where no taxel is pressed."""
    return np.abs(simulated).max(axis=(1, 2, 3, 4)) < PRESSED * max(peak, 1e-9)


def peak_of(simulated: NDArray[np.floating]) -> float:
    """The force (N) that the most loaded taxel reaches, 99.5 % quantile over time."""
    return float(np.quantile(np.abs(simulated).max(axis=(1, 2, 3, 4)), 0.995))


def _peaks_of(simulated: NDArray[np.floating], peak: float) -> FloatArray:
    """``(3,)`` N, the same of x, y and z, both shears alike, at least `LEAST_PEAK` of `peak`."""
    by_axis = np.quantile(np.abs(simulated).max(axis=(1, 3, 4)), 0.995, axis=0)
    by_axis[:2] = by_axis[:2].max()
    return np.maximum(by_axis, LEAST_PEAK * peak)


def showing(gain: FloatArray) -> NDArray[np.bool_]:
    """``(episodes,)`` those that say something of a cause, by what it gains or loses in each: not those at rest."""
    return np.abs(gain) > 1e-2 * np.abs(gain).max()


def problem_of(recording: Recording, scene: Responses | None = None, tolerance: Tolerance | None = None) -> Problem:
    """A recording made ready.

    Args:
        recording: Both streams.
        scene: What changes of the scene do to the simulated one; None if the scene is not known.
        tolerance: Errors that need no explanation.

    Raises:
        InvalidValueError: A stream is missing or holds NaN.
    """
    if recording.measured is None or recording.simulated is None:
        missing = "measured" if recording.measured is None else "simulated"
        raise InvalidValueError(f"a diagnosis compares two streams, but the recording has no {missing} tensor")
    measured, simulated = recording.measured.astype(np.float64), recording.simulated.astype(np.float64)
    for name, values in (("measured", measured), ("simulated", simulated)):
        if not np.isfinite(values).all():
            raise InvalidValueError(f"{name} must be finite; load the recording with missing='drop'")
    episodes = episode_spans(recording.episode)
    if min(span.stop - span.start for span in episodes) < 2:
        raise InvalidValueError("each episode needs two samples at least")
    peak = peak_of(simulated) or NOMINAL
    step, phase = step_of(measured)
    covariates = {n: c for n, c in recording.covariates.items() if c.ndim == 1 and np.isfinite(c).all()}
    rest = at_rest(simulated, peak)
    directions = directions_of(covariates, rest if rest.mean() > RESTING else np.ones_like(rest))
    alive = np.ones(measured.shape[1:], dtype=bool)
    if "readout" in recording.metadata:  # channels that do not answer to the load are 0 in both streams
        alive = simulated.any(axis=0)
    problem = Problem(
        measured, simulated, recording.time, covariates, episodes, np.ones(1), peak,
        alive, step, 0.0, clips=bool(measured[:, :, 2].min() >= 0),
        least=min(float(simulated.min()), 0.0), phase=phase, peaks=_peaks_of(simulated, peak), directions=directions,
        calibrated="readout" in recording.metadata, aligned="clocks_aligned_by" in recording.metadata,
        tolerance=replace(tolerance or Tolerance(), encoder=EncoderError.told_by(recording)),
        scene=scene,
    )  # fmt: skip
    return with_noise(problem)


def with_noise(problem: Problem) -> Problem:
    """The problem with its noise read from its own streams."""
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
    noise = np.where(noise < SELDOM * step, np.sqrt(step**2 / 12 + dither**2), noise)
    sigma = np.sqrt(noise**2 + allowed)
    if not np.isfinite(sigma).all():  # against it nothing would stand out, and all would seem well
        raise InvalidValueError(
            "the noise of the recording is not finite: is a time, a force or a tolerance too large?"
        )
    excused = 0.0 if problem.scene is None else float(np.mean((allowed / sigma**2)[:, alive]))
    return replace(problem, sigma=sigma, dither=dither, excused=excused)
