"""Find the zero: an offset or a drift, read where nothing is pressed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.drift_under_load import CLEARLY_DRIFT, RELINEARISED, drift_under_load
from paxisim.diagnose.problem import FloatArray, Problem, showing
from paxisim.diagnose.sums import Sums
from paxisim.diagnose.under_load import goes_with_load, tells_under_load, under_load
from paxisim.diagnose.worth import in_one_episode
from paxisim.diagnose.zero import TAUS, Zero, best_tau, course, nothing

FEWEST = 10  # frames that a zero is told from


def zero_of(
    problem: Problem,
    prediction: FloatArray,
    material: float,
    share: float,
    *,
    drifts: float | None = None,
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
        drifts: The same of a drift, if it is another.
        share: Of the episodes, that must gain.
        names: Which of the two to look for.
        resting: Only samples before an episode's first contact, which no memory of the sensor reaches.
        owned: Whether the model holds a field that comes with a constant of its own for each pad and axis.
    """
    frames = problem.untouched if resting else _telling(problem)
    if frames.sum() < FEWEST:
        return nothing(problem)

    def matters(gain: FloatArray, material: float = material) -> bool:
        return bool(gain.sum() > material * problem.samples and (gain[showing(gain)] > 0).mean() >= share)

    def lasts(gain: FloatArray, material: float = material) -> bool:
        return matters(gain, material) and not in_one_episode(gain, material * problem.samples)

    rest = problem.measured - problem.read(prediction)
    always = np.ones_like(problem.time)
    with_drift = "drift" in names and _shows_drift(problem, frames)
    hiding = None
    if not resting and tells_under_load(problem):
        hiding = under_load(problem, prediction, [always])
        if with_drift and not owned:
            found, hiding = drift_under_load(problem, prediction, hiding, lasts, "offset" in names)
            if found is not None:
                return found
        rest = hiding.zero + problem.measured - problem.read(prediction + hiding.zero)

    left = _Left(problem, rest, frames)
    constant, field = left.fit([always]), _field(problem, frames)
    without = left.fit([always, *field]) if field else constant
    if field and not matters(left.gain(without, constant)):
        field, without = [], constant

    chosen, gains = without, {}
    amplitude, tau = np.zeros(problem.alive.shape), TAUS[0]
    if with_drift:
        beside, best = left.drifting([always, *field])
        gain = left.gain(beside, without)
        if lasts(gain, material if drifts is None else drifts) and beside.rejects().any():
            gains["drift"], chosen, tau = gain, beside, best
            if not problem.counting.reads_all and hiding is None:
                left, chosen, tau = _relinearised(left, prediction, [always, *field], chosen, tau)
            amplitude = left.shaped(chosen, -1)
        elif "offset" in names and not owned:  # or is it a drift from a zero that was right at the beginning?
            alone, best = left.drifting(field)
            gain = left.gain(alone)
            if lasts(gain) and np.sum(alone.heldout() - without.heldout()) > CLEARLY_DRIFT:
                return Zero(np.zeros_like(amplitude), left.shaped(alone, -1), best, {"drift": gain})

    offset = left.shaped(chosen, 0)
    if "offset" in names:
        ratio = 0.0
        if "drift" in gains:  # it may have begun before the recording: what goes with it is its own
            ratio = float(np.sum(amplitude * offset) / np.sum(amplitude**2))
        own = offset - ratio * amplitude
        if owned:
            own -= own.mean(axis=(2, 3), keepdims=True)
        if "drift" in gains:
            gain = left.gain(chosen, left.fit([*field, ratio + course(left.time, tau)]))
        elif hiding is not None:
            gain = hiding.gain
            if matters(gain) and goes_with_load(problem, prediction, hiding):
                gain = np.zeros_like(gain)
        else:
            gain = left.gain(_Left(problem, rest - (offset - own), frames).fit([always]))
        if lasts(gain) and (not owned or float(np.sum(own**2)) > 0.2 * float(np.sum(offset**2))):
            gains["offset"] = gain
    if not (owned or gains):
        offset = np.zeros_like(offset)
    elif hiding is None and "drift" not in gains:
        # so far a mean of readings, which rounding and the cut below 0 draw in
        offset = problem.counting.unread(offset + problem.read(np.zeros((1, *offset.shape)))[0])
    return Zero(offset, amplitude, tau, gains)


class _Left:
    """What a prediction leaves where it tells of a zero, and curves of time fitted to it."""

    def __init__(self, problem: Problem, rest: FloatArray, frames: NDArray[np.bool_]) -> None:
        self.problem, self.rest, self.frames = problem, rest, frames
        self.time = problem.time - problem.time[0]

    def fit(self, curves: list[FloatArray]) -> Sums:
        """The fit of `curves`, ``(T,)`` each."""
        return Sums(self.problem, self.rest, curves, self.frames)

    def drifting(self, curves: list[FloatArray]) -> tuple[Sums, float]:
        """The fit of `curves` and a drift, with the time constant (s) that explains most."""
        tau = best_tau(lambda tau: self.fit([*curves, course(self.time, tau)]).explained().sum())
        return self.fit([*curves, course(self.time, tau)]), tau

    def gain(self, more: Sums, fewer: Sums | None = None) -> FloatArray:
        """``(episodes,)`` energy that `more` takes away beyond `fewer`, of all samples if these stand for them."""
        gain = more.heldout() if fewer is None else more.heldout() - fewer.heldout()
        return gain.sum(axis=1) / self.frames.mean()

    def shaped(self, fit: Sums, curve: int) -> FloatArray:
        """``(pads, 3, rows, cols)`` newtons of one of the curves."""
        alive = self.problem.alive
        return np.where(alive, fit.values()[..., curve].reshape(alive.shape), 0.0)


def _relinearised(
    left: _Left, prediction: FloatArray, curves: list[FloatArray], fit: Sums, tau: float
) -> tuple[_Left, Sums, float]:
    """A drift of readings that are cut: its image about what was found, not about 0."""
    problem = left.problem
    for _ in range(RELINEARISED):
        constant, slope = fit.values()[:, [0, -1]].T
        own = (constant + np.outer(course(left.time, tau), slope)).reshape(left.rest.shape)
        left = _Left(problem, own + problem.measured - problem.read(prediction + own), left.frames)
        fit, tau = left.drifting(curves)
    return left, fit, tau


def _shows_drift(problem: Problem, frames: NDArray[np.bool_]) -> bool:
    """Whether it is long enough, and rests in enough episodes."""
    resting = sum(bool(frames[span].any()) for span in problem.episodes)
    return problem.runs_through and problem.time[-1] - problem.time[0] > 30 and resting >= 4


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
