"""Zero: what a sensor reads without any force, a constant or a drift, read where nothing is pressed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from paxisim.diagnose.problem import FloatArray, Problem, showing

CLEARLY_DRIFT = 30.0  # energy, in units of the noise, by which a drift alone must do better than an offset
TAUS = (60.0, 120.0, 200.0, 350.0, 600.0, 1200.0)  # s, of a drift
FALSE_CHANNELS = 0.05  # share of the channels said to drift, or to be off, of which that is not so


@dataclass(frozen=True, eq=False)
class Zero:
    """What is read without any force.

    Attributes:
        offset: ``(pads, 3, rows, cols)`` N at the recording's first sample.
        amplitude: ``(pads, 3, rows, cols)`` N of the drift's curve ``1 - exp(-t / tau)``.
        tau: Of the drift (s).
        gain: By name of what is to be named, ``(episodes,)`` squared residual (noise units) that it takes away, fitted
            on the other episodes.
    """

    offset: FloatArray
    amplitude: FloatArray
    tau: float
    gain: Mapping[str, FloatArray]

    def at(self, time: FloatArray) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` newtons, `time` in seconds from the first sample."""
        curve = -np.expm1(-time / self.tau)
        return self.offset + curve[:, None, None, None, None] * self.amplitude


def nothing(problem: Problem) -> Zero:
    """No force read where there is none."""
    zeros = np.zeros(problem.alive.shape)
    return Zero(zeros, zeros, TAUS[0], {})


def zero_of(
    problem: Problem,
    prediction: FloatArray,
    material: float,
    share: float,
    *,
    names: tuple[str, ...] = ("offset", "drift"),
    resting: bool = False,
    owned: bool = False,
) -> Zero:
    """Offset and drift that `prediction`, which has none, leaves.

    They are told where nothing is pressed, as what else is wrong is small there; a sensor whose noise does not reach
    the next count tells a small offset only under load, so there all samples count.

    Args:
        problem: The recording.
        prediction: ``(T, pads, 3, rows, cols)`` newtons.
        material: Energy, as a share of the noise's, that each of the two must take away.
        share: Of the episodes, that must gain.
        names: Which of the two to look for.
        resting: Only samples before an episode's first contact, which no memory of the sensor reaches.
        owned: Whether the model holds a field that comes with a constant of its own for each pad and axis.
    """
    frames = _resting(problem) if resting else _telling(problem)
    time = problem.time - problem.time[0]
    zeros = np.zeros(problem.alive.shape)
    counts = np.array([frames[span].sum() for span in problem.episodes])
    if frames.sum() < 10:
        return nothing(problem)
    hidden = not resting and tells_under_load(problem)
    rest = problem.measured - problem.read(prediction)
    hiding = _hidden(problem, prediction) if hidden else None
    if hiding is not None:
        rest = hiding[0] + problem.measured - problem.read(prediction + hiding[0])

    with_drift = "drift" in names and problem.runs_through and time[-1] > 30 and (counts > 0).sum() >= 4
    others = [np.ones_like(time), *_field(problem, frames)]
    gains: dict[str, FloatArray] = {}
    amplitude, tau = zeros, TAUS[0]
    needed = material * problem.samples

    def matters(gain: FloatArray) -> bool:
        return bool(gain.sum() > needed and (gain[showing(gain)] > 0).mean() >= share)

    per_frame = frames.mean()  # the energy of all samples from that of those which tell
    without = _Sums(problem, rest, others, frames)
    plain = _Sums(problem, rest, others[:1], frames)
    if not matters((without.heldout() - plain.heldout()).sum(axis=1) / per_frame):
        others, without = others[:1], plain
    chosen = without

    def drifting(curves: list[FloatArray]) -> tuple[_Sums, float]:
        """The fit of `curves` and a drift, with the time constant that explains most."""
        tried = [_Sums(problem, rest, [*curves, -np.expm1(-time / tau)], frames) for tau in TAUS]
        best = max(range(len(TAUS)), key=lambda i: tried[i].explained().sum())
        return tried[best], TAUS[best]

    if with_drift:
        beside, best_tau = drifting(others)
        gain = (beside.heldout() - without.heldout()).sum(axis=1) / per_frame
        if matters(gain) and beside.rejects().any():
            gains["drift"], chosen, tau = gain, beside, best_tau
            amplitude = np.where(problem.alive, chosen.values()[..., -1].reshape(zeros.shape), 0.0)
        elif "offset" in names and not owned:  # or is it a drift from a zero that was right at the beginning?
            alone, best_tau = drifting(others[1:])
            gain = alone.heldout().sum(axis=1) / per_frame
            if matters(gain) and np.sum(alone.heldout() - without.heldout()) > CLEARLY_DRIFT:
                amplitude = np.where(problem.alive, alone.values()[..., -1].reshape(zeros.shape), 0.0)
                return Zero(zeros, amplitude, best_tau, {"drift": gain})
    offset = np.where(problem.alive, chosen.values()[..., 0].reshape(zeros.shape), 0.0)
    if "offset" in names:
        left, ratio = offset.copy(), 0.0
        if "drift" in gains:  # it may have begun before the recording: what goes with it is its own
            ratio = float(np.sum(amplitude * offset) / np.sum(amplitude**2))
            left -= amplitude * ratio
        if owned:
            left -= left.mean(axis=(2, 3), keepdims=True)
        if "drift" in gains:
            tied = ratio - np.expm1(-time / tau)
            gain = (chosen.heldout() - _Sums(problem, rest, [*others[1:], tied], frames).heldout()).sum(axis=1)
        else:
            gain = _Sums(problem, rest - (offset - left), [np.ones_like(time)], frames).heldout().sum(axis=1)
        gain = gain / per_frame
        if hiding is not None and "drift" not in gains:
            gain = hiding[1]
        if matters(gain) and (not owned or float(np.sum(left**2)) > 0.2 * float(np.sum(offset**2))):
            gains["offset"] = gain
    keeps = owned or bool(gains)
    if hiding is None and "drift" not in gains:  # so far a mean of readings, which rounding and the cut below 0 draw in
        offset = problem.unread(offset + problem.read(zeros[None])[0])
    return Zero(offset if keeps else zeros, amplitude, tau, gains)


def _hidden(problem: Problem, prediction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Offsets that steps hide while nothing is pressed, and what they take away in each episode, fitted on the others.

    A sample tells of them as far as its mean reading moves with the force, which it does at the edge of a step.
    """
    guess = np.zeros(problem.alive.shape)
    weight = problem.weight**2
    small = 0.2 * problem.step
    up, right = np.zeros(0), np.zeros(0)
    for _ in range(4):
        force = prediction + guess
        slope = (problem.read(force + small) - problem.read(force - small)) / (2 * small)
        miss = problem.measured - problem.read(force)
        up = np.array([np.sum((weight * slope * miss)[span], axis=0) for span in problem.episodes])
        right = np.array([np.sum((weight * slope**2)[span], axis=0) for span in problem.episodes])
        change = up.sum(axis=0) / (right.sum(axis=0) + 1.0)
        guess = guess + np.clip(change, -0.3 * problem.step, 0.3 * problem.step)
    others = (up.sum(axis=0) - up) / (right.sum(axis=0) - right + 1.0)
    gain = np.empty(len(problem.episodes))
    before = problem.measured - problem.read(prediction)
    for number, span in enumerate(problem.episodes):
        after = problem.measured[span] - problem.read(prediction[span] + guess + others[number])
        gain[number] = np.sum(weight[span] * (before[span] ** 2 - after**2))
    return guess, gain


def _resting(problem: Problem) -> NDArray[np.bool_]:
    """``(T,)`` before the first contact of an episode."""
    before = np.zeros(len(problem.time), dtype=bool)
    for span in problem.episodes:
        pressed = np.flatnonzero(~problem.at_rest[span])
        before[span.start : span.start + pressed[0] if len(pressed) else span.stop] = True
    return before


def tells_under_load(problem: Problem) -> bool:
    """Whether the noise at rest does not reach the next count, so that small offsets show only under load."""
    return bool(problem.step) and problem.dither < 0.25 * problem.step


def _telling(problem: Problem) -> NDArray[np.bool_]:
    if tells_under_load(problem):
        return np.ones(len(problem.time), dtype=bool)
    return problem.at_rest if problem.at_rest.mean() > 0.05 else np.ones(len(problem.time), dtype=bool)


def _field(problem: Problem, frames: NDArray[np.bool_]) -> list[FloatArray]:
    """What the gripper's opening may add: it must not pass for a drift."""
    opening = problem.covariates.get("gripper_opening")
    if opening is None or np.ptp(opening[frames]) < 1e-4:
        return []
    centred = (opening - np.median(opening[frames])) / np.ptp(opening[frames])
    return [centred, centred**2]


class _Sums:
    """Least squares of a few curves for every channel, with the sums of each episode kept apart."""

    def __init__(self, problem: Problem, rest: FloatArray, curves: list[FloatArray], frames: NDArray[np.bool_]) -> None:
        basis = np.stack(curves)
        products, projections, energy = [], [], []
        weight = (problem.weight**2).reshape(len(rest), -1) * frames[:, None]
        flat = rest.reshape(len(rest), -1)
        for span in problem.episodes:
            w, b, r = weight[span], basis[:, span], flat[span]
            products.append(np.einsum("it,jt,tc->cij", b, b, w, optimize=True))
            projections.append(np.einsum("it,tc->ci", b, w * r))
            energy.append(np.sum(w * r**2, axis=0))
        self._products, self._projections = np.array(products), np.array(projections)
        self._energy = np.array(energy)

    def _solve(self, products: FloatArray, projections: FloatArray) -> FloatArray:
        size = products.shape[-1]
        ridge = 1e-6 * np.trace(products, axis1=-2, axis2=-1)[..., None, None] / size + 1e-9
        return np.linalg.solve(products + ridge * np.eye(size), projections[..., None])[..., 0]

    def values(self) -> FloatArray:
        """``(channels, curves)``."""
        return self._solve(self._products.sum(axis=0), self._projections.sum(axis=0))

    def _gain(self, values: FloatArray) -> FloatArray:
        quadratic = np.einsum("...ci,...cij,...cj->...c", values, self._products, values)
        return 2 * np.einsum("...ci,...ci->...c", values, self._projections) - quadratic

    def explained(self) -> FloatArray:
        """``(episodes, channels)`` energy taken away, fitted on all."""
        return self._gain(np.broadcast_to(self.values(), self._projections.shape))

    def heldout(self) -> FloatArray:
        """``(episodes, channels)`` energy taken away, fitted on the other episodes."""
        total, right = self._products.sum(axis=0), self._projections.sum(axis=0)
        return self._gain(self._solve(total - self._products, right - self._projections))

    def rejects(self) -> NDArray[np.bool_]:
        """``(channels,)`` whose last curve is there: episodes are the replicates, false discoveries are bounded."""
        values = self.values()
        inverse = np.linalg.pinv(self._products.sum(axis=0))
        score = self._projections - np.einsum("ecij,cj->eci", self._products, values)
        effect = np.einsum("cij,eci->ecj", inverse, score)[..., -1]
        used = np.abs(self._projections).sum(axis=(1, 2)) > 0
        degrees = max(int(used.sum()) - values.shape[1], 1)
        spread = np.sqrt(np.sum(effect**2, axis=0) * used.sum() / degrees)
        p = 2 * student.sf(np.abs(values[:, -1]) / np.maximum(spread, 1e-12), degrees)
        p[np.abs(values[:, -1]) < 1e-12] = 1.0
        order = np.sort(p)
        passing = np.flatnonzero(order <= FALSE_CHANNELS * np.arange(1, len(p) + 1) / len(p))
        return p <= (order[passing[-1]] if len(passing) else -1.0)
