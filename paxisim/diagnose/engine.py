"""Engine: from a recording to the causes that it asks for, fitted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from paxisim import augment
from paxisim.augment.transform import Transform
from paxisim.diagnose.advice import NOT_ASKED
from paxisim.diagnose.cause import cause, known_causes
from paxisim.diagnose.checks import Reading, read_layout, read_rounding, read_taxels
from paxisim.diagnose.fitting import Fitted, fit, in_order, made, predict
from paxisim.diagnose.noise import Tolerance
from paxisim.diagnose.plan import Plan
from paxisim.diagnose.problem import FloatArray, Problem, problem_of, with_noise
from paxisim.diagnose.silent import silent_channels
from paxisim.diagnose.state import State, closer, first_look, with_slow, with_zero, zero_beside
from paxisim.diagnose.worth import SEVERAL, Thresholds
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

__all__ = ["Explanation", "Named", "Thresholds", "Tolerance", "explain"]

_THRESHOLDS, _TOLERANCE = Thresholds(), Tolerance()


@dataclass(frozen=True, eq=False)
class Named:
    """A cause that the recording asks for.

    Attributes:
        name: Of the cause.
        transform: What it does, with the fitted values.
        values: Fitted numbers by name; units are those of the cause's `free`, or N for arrays of forces.
        energy_gain: ``(episodes,)`` squared residual (noise units) that it takes away, the other causes refitted.
        rivals_energy: By how much more squared residual (noise units) is left, less if negative, with this cause
            replaced by a rival, by its name.
    """

    name: str
    transform: Transform
    values: Mapping[str, float | FloatArray]
    energy_gain: FloatArray
    rivals_energy: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Explanation:
    """What a recording asks for.

    Attributes:
        problem: The recording as it was compared, with what was read off it: layout, dead channels, zero.
        found: The causes, by gain.
        model: All of them in the order of the chain, to be applied to the recording's simulated stream.
        prediction: ``(T, pads, 3, rows, cols)`` newtons, what the model makes of it, before rounding.
        empty_energy: ``(episodes,)`` squared difference of the streams in noise units.
        energy: ``(episodes,)`` the same, of the model.
        not_searched: Why, by the name of each cause that was not looked for.
        nearly: By cause that was not found, what it brings as a share of what it must bring.
    """

    problem: Problem
    found: tuple[Named, ...]
    model: augment.Chain
    prediction: FloatArray
    empty_energy: FloatArray
    energy: FloatArray
    not_searched: Mapping[str, str] = field(default_factory=dict)
    nearly: Mapping[str, float] = field(default_factory=dict)
    refit: Callable[[Problem], FloatArray] = field(default=lambda part: np.zeros(0), repr=False)

    @property
    def judged(self) -> Problem:
        """The recording as the figures are given of it: what dead taxels should have read is an error, too."""
        for named in self.found:
            if named.name == "dead_taxels":
                return replace(self.problem, alive=self.problem.alive | _gone(named.values)[:, None])
        return self.problem

    def fit_on(self, spans: Sequence[slice]) -> FloatArray:
        """The prediction of the same causes, fitted on some samples only.

        Args:
            spans: The samples; each span is fitted as an episode.

        Returns:
            ``(T, pads, 3, rows, cols)`` newtons for the whole recording.
        """
        return self.refit(self.problem.cut(spans))


def explain(
    recording: Recording,
    causes: Sequence[str] | None = None,
    *,
    thresholds: Thresholds = _THRESHOLDS,
    tolerance: Tolerance = _TOLERANCE,
    device_step: float = 0.1,
    jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> Explanation:
    """The causes that a recording asks for, fitted.

    Args:
        recording: With measured and simulated tensors, the simulation replaying the same motion.
        causes: Names of those to look for; default: all that are known.
        thresholds: What a cause must bring.
        tolerance: What need not be explained.
        device_step: Newtons a count of a sensor in order; coarser rounding is a cause.
        jobs: Processors to use.
        progress: Told in words what is being done.

    Raises:
        InvalidValueError: A stream is missing, is not finite, or has nothing in it.
        UnknownNameError: There is no such cause.
    """
    tell = progress or (lambda text: None)
    raw = problem_of(recording, tolerance)
    wanted = [cause(name) for name in (known_causes() if causes is None else causes)]
    names = {item.name for item in wanted}
    not_searched = {name: NOT_ASKED for name in known_causes() if name not in names}
    for item in list(wanted):
        if item.covariate and item.covariate not in raw.covariates:
            not_searched[item.name] = f"the recording has no covariate {item.covariate!r}"
            wanted.remove(item)
        elif why := item.barred(raw):
            not_searched[item.name] = why
            wanted.remove(item)
            names.remove(item.name)
    if "drift" in names and (not raw.runs_through or len(raw.episodes) < 4):
        not_searched["drift"] = "slow changes show only over several episodes on one clock"

    tell("reading layout, rounding and dead taxels")
    read, problem = _read(raw, names, tolerance, device_step)
    slow = tuple(name for name in ("offset", "drift") if name in names)
    searched = [item for item in wanted if item.is_searched]
    plan = Plan(searched, thresholds, slow, tell, jobs)
    state = with_slow(first_look(problem, plan), plan)
    if len(problem.episodes) >= SEVERAL:
        state = closer(state, plan)
    return _explained(raw, state, read, not_searched, plan)


def _read(
    raw: Problem, names: set[str], tolerance: Tolerance, device_step: float
) -> tuple[dict[str, Reading], Problem]:
    """What the checks say, and the problem that is left."""
    read: dict[str, Reading] = {}
    problem = raw
    rounding = read_rounding(problem, device_step) if "quantisation" in names else None
    if rounding:
        read["quantisation"] = rounding
    layout = read_layout(problem) if "layout" in names else None
    if layout:
        read["layout"] = layout
        problem = with_noise(replace(problem, simulated=layout.transform(problem.simulated)), tolerance)
    taxels = read_taxels(problem) if "dead_taxels" in names else None
    if taxels:
        read["dead_taxels"] = taxels
        problem = replace(problem, alive=problem.alive & ~_gone(taxels.values)[:, None])
    silent = silent_channels(problem)
    if silent.any():
        problem = with_noise(replace(problem, alive=problem.alive & ~silent), tolerance)
    if not problem.alive.any():
        raise InvalidValueError(
            "no taxel answers to what the simulation presses on it: was the sensor connected, and is it the same "
            "motion, in newtons?"
        )
    return read, problem


def _gone(values: Mapping[str, float | FloatArray]) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels that are dead or stuck, by the values of that cause."""
    return (np.asarray(values["dead"]) + np.asarray(values["stuck"])) > 0


def _explained(
    raw: Problem, state: State, read: Mapping[str, Reading], not_searched: Mapping[str, str], plan: Plan
) -> Explanation:
    found, zero = state.found, state.zero
    problem = with_zero(state.problem, zero)  # also the constant that a field brings, which no fit had to know
    chosen = [cause(name) for name in found.fit.values]
    weight = 1 / problem.sigma

    def energy(prediction: FloatArray, read_as: Callable[[FloatArray], FloatArray] = problem.read) -> FloatArray:
        rest = ((problem.measured - read_as(prediction)) * weight) ** 2
        return np.array([rest[span].sum() for span in problem.episodes])

    def whole(problem: Problem, values: Fitted) -> FloatArray:
        prediction = predict(problem, chosen, values)[0]
        return read["dead_taxels"].transform(prediction) if "dead_taxels" in read else prediction

    prediction = whole(problem, found.fit.values)
    now = energy(prediction)
    members: list[tuple[float, str, Transform]] = []
    named: list[Named] = []

    for item in chosen:
        values = found.fit.values[item.name]
        transform = made(problem, item, values)
        members.append((item.order, item.name, transform))
        free = item.free(problem)
        figures = {f.name: float(v) for f, v in zip(free, values, strict=True)} if free else {item.solves: values}
        gain = found.without[item.name].energy - found.fit.energy
        rivals = {n: e - float(found.fit.energy.sum()) for n, e in found.rivals[item.name].items()}
        named.append(Named(item.name, transform, figures, gain, rivals))
    for name, reading in read.items():
        members.append((cause(name).order, name, reading.transform))
        if name == "layout":
            gain = energy(raw.simulated) - energy(problem.simulated)
        elif name == "quantisation":
            gain = energy(prediction, lambda force: force) - now
        else:
            gain = energy(predict(problem, chosen, found.fit.values)[0]) - now
        named.append(Named(name, reading.transform, reading.values, gain, {}))
    if np.any(zero.offset):
        transform = augment.Offset(zero.offset)
        members.append((cause("offset").order, "offset", transform))
        if "offset" in zero.gain:
            named.append(Named("offset", transform, {"value": zero.offset}, zero.gain["offset"], {}))
    if np.any(zero.amplitude):
        transform = augment.Drift(amplitude=zero.amplitude, tau=zero.tau)
        members.append((cause("drift").order, "drift", transform))
        figures = {"amplitude": zero.amplitude, "tau": zero.tau}
        named.append(Named("drift", transform, figures, zero.gain["drift"], {}))

    def refit(part: Problem) -> FloatArray:
        fitted = fit(part, chosen, found.fit.values)
        if zero.gain:
            own = zero_beside(part, fitted, plan, drifted="drift" in zero.gain)
            elapsed = problem.time - part.time[0]
            return whole(replace(problem, zero=own.at(np.maximum(elapsed, 0.0))), fitted.values)
        return whole(problem, fitted.values)

    ordered = sorted(members, key=lambda member: member[0])
    return Explanation(
        problem,
        tuple(sorted(named, key=lambda item: -item.energy_gain.sum())),
        in_order([(name, transform) for _, name, transform in ordered]),
        prediction,
        energy(raw.simulated, (lambda force: force) if "quantisation" in read else problem.read),
        now,
        not_searched,
        state.nearly,
        refit,
    )
