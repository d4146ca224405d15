"""Zero: what a sensor reads without any force, a constant or a drift, read where nothing is pressed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from paxisim.diagnose.problem import FloatArray, Problem, showing
from paxisim.diagnose.sums import Sums
from paxisim.diagnose.under_load import PRIOR, UnderLoad, at_edges, quiet_frames, tells_under_load, under_load

CLEARLY_DRIFT = 30.0  # energy, in units of the noise, by which a drift alone must do better than an offset
RELINEARISED = 2  # times: what is read of a drift from 0 is no straight image of it where readings are cut
TAUS = (60.0, 120.0, 200.0, 350.0, 600.0, 1200.0)  # s, of a drift


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
        curve = _course(time, self.tau)
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
    time = problem.time - problem.time[0]
    zeros = np.zeros(problem.alive.shape)
    counts = np.array([frames[span].sum() for span in problem.episodes])
    if frames.sum() < 10:
        return nothing(problem)
    least = material if drifts is None else drifts

    def matters(gain: FloatArray, material: float = material) -> bool:
        return bool(gain.sum() > material * problem.samples and (gain[showing(gain)] > 0).mean() >= share)

    hidden = not resting and tells_under_load(problem)
    rest = problem.measured - problem.read(prediction)
    hiding = under_load(problem, prediction, [np.ones_like(time)]) if hidden else None
    if hiding is not None:
        rest = hiding.zero + problem.measured - problem.read(prediction + hiding.zero)

    with_drift = "drift" in names and problem.runs_through and time[-1] > 30 and (counts > 0).sum() >= 4
    if hiding is not None and with_drift and not owned:
        drifting_zero = _drift_under_load(problem, prediction, time, hiding, matters, "offset" in names)
        if drifting_zero is not None:
            return drifting_zero
    others = [np.ones_like(time), *_field(problem, frames)]
    gains: dict[str, FloatArray] = {}
    amplitude, tau = zeros, TAUS[0]

    per_frame = frames.mean()  # the energy of all samples from that of those which tell
    without = Sums(problem, rest, others, frames)
    plain = Sums(problem, rest, others[:1], frames)
    if not matters((without.heldout() - plain.heldout()).sum(axis=1) / per_frame):
        others, without = others[:1], plain
    chosen = without

    def drifting(curves: list[FloatArray]) -> tuple[Sums, float]:
        """The fit of `curves` and a drift, with the time constant that explains most."""
        tau = _best(lambda tau: Sums(problem, rest, [*curves, _course(time, tau)], frames).explained().sum())
        return Sums(problem, rest, [*curves, _course(time, tau)], frames), tau

    if with_drift:
        beside, best_tau = drifting(others)
        gain = (beside.heldout() - without.heldout()).sum(axis=1) / per_frame
        if matters(gain, least) and beside.rejects().any():
            gains["drift"], chosen, tau = gain, beside, best_tau
            for _ in range(0 if problem.counting.reads_all or hiding is not None else RELINEARISED):
                constant, slope = chosen.values()[:, [0, -1]].T
                own = (constant + np.outer(_course(time, tau), slope)).reshape(rest.shape)
                rest = own + problem.measured - problem.read(prediction + own)
                chosen, tau = drifting(others)
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
            tied = ratio + _course(time, tau)
            gain = (chosen.heldout() - Sums(problem, rest, [*others[1:], tied], frames).heldout()).sum(axis=1)
        else:
            gain = Sums(problem, rest - (offset - left), [np.ones_like(time)], frames).heldout().sum(axis=1)
        gain = gain / per_frame
        if hiding is not None and "drift" not in gains:
            gain = hiding.gain
        if matters(gain) and (not owned or float(np.sum(left**2)) > 0.2 * float(np.sum(offset**2))):
            gains["offset"] = gain
    keeps = owned or bool(gains)
    if hiding is None and "drift" not in gains:  # so far a mean of readings, which rounding and the cut below 0 draw in
        offset = problem.counting.unread(offset + problem.read(zeros[None])[0])
    return Zero(offset if keeps else zeros, amplitude, tau, gains)


def _drift_under_load(
    problem: Problem,
    prediction: FloatArray,
    time: FloatArray,
    constant: UnderLoad,
    matters: Callable[[FloatArray], bool],
    with_offset: bool,
) -> Zero | None:
    """The zero with a drift that steps hide, if a constant alone does not do as well."""
    always = np.ones_like(time)
    every = np.ones(len(time), dtype=bool)
    # whole counts of it show without a load
    quiet = quiet_frames(problem)
    left = problem.measured - problem.read(prediction + constant.zero)
    tau = _best(lambda tau: Sums(problem, left, [always, _course(time, tau)], quiet).explained().sum())
    curve = _course(time, tau)
    begin = Sums(problem, left, [always, curve], quiet).values(PRIOR)
    begin[:, 0] += constant.values[:, 0]
    known = (begin @ np.stack([always, curve])).T.reshape(left.shape)
    both = constant
    for _ in range(RELINEARISED):
        miss, slope = at_edges(problem, prediction + known)
        rest = miss + slope * known
        tau = _best(
            lambda tau, r=rest, s=slope: Sums(problem, r, [always, _course(time, tau)], every, s).explained().sum()
        )
        curve = _course(time, tau)
        both = under_load(problem, prediction, [always, curve], begin)
        begin, known = both.values, both.zero
    offset, amplitude = both.values.T
    # it may have begun before the recording, not long before: what goes with it is its own
    ratio = float(np.clip(np.sum(amplitude * offset) / max(np.sum(amplitude**2), 1e-12), 0.0, 1.0))
    one = ratio + curve
    near = amplitude + (offset - ratio * amplitude) / max(float(one.mean()), 0.1)
    tied = under_load(problem, prediction, [one], near[:, None])
    clearly = tied.gain.sum() > constant.gain.sum() + CLEARLY_DRIFT
    if not matters(both.gain - constant.gain) and not (clearly and matters(tied.gain)):
        return None
    if with_offset and matters(both.gain - tied.gain):
        gains = {"drift": both.gain - constant.gain, "offset": both.gain - tied.gain}
    else:
        amplitude, gains = tied.values[:, 0], {"drift": tied.gain}
        offset = ratio * amplitude

    def shaped(values: FloatArray) -> FloatArray:
        return np.where(problem.alive, values.reshape(problem.alive.shape), 0.0)

    return Zero(shaped(offset), shaped(amplitude), tau, gains)


def _course(time: FloatArray, tau: float) -> FloatArray:
    """``(T,)`` how far a drift has come, of its amplitude."""
    return -np.expm1(-time / tau)


def _best(explained: Callable[[float], float]) -> float:
    """The time constant (s) with which most is explained: the best of `TAUS`, or between its neighbours."""
    tried = [explained(tau) for tau in TAUS]
    best = int(np.argmax(tried))
    around = np.log([TAUS[max(best - 1, 0)], TAUS[min(best + 1, len(TAUS) - 1)]])
    found = minimize_scalar(
        lambda x: -explained(float(np.exp(x))), bounds=tuple(around), method="bounded", options={"xatol": 0.05}
    )
    return float(np.exp(found.x)) if -found.fun > tried[best] else TAUS[best]


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
