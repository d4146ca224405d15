"""Run: from a recording to its diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from paxisim import augment
from paxisim.diagnose.adequacy import left_over
from paxisim.diagnose.advice import advice
from paxisim.diagnose.cause import cause, known_causes
from paxisim.diagnose.ceiling import ceiling
from paxisim.diagnose.diagnosis import Diagnosis, FittedParameter, FoundCause, Interval, LeftOver, Verdict
from paxisim.diagnose.engine import Explanation, Thresholds, Tolerance, explain
from paxisim.diagnose.heldout import Squares, explained_share, figures, gains_of, hold_out, survives
from paxisim.diagnose.intervals import model_intervals, parameters_of
from paxisim.diagnose.prepare import prepare
from paxisim.diagnose.problem import FloatArray, Problem, showing
from paxisim.diagnose.repeats import settled, with_untold
from paxisim.diagnose.rivals import rivals_of
from paxisim.diagnose.silent import silent_in_words
from paxisim.diagnose.streams import Streams
from paxisim.diagnose.symptoms import symptoms
from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.recording import Recording

LITTLE = 0.2  # of what can be explained: who explains less, and leaves clear structure, has not found it
CLEAR = 2.0  # limits that a left-over must reach to be clear
NEARLY = 0.75  # of what a cause must bring to be named: who brings so much may be in it
FAINT = 2.0  # times what is material that a cause must change the prediction by, to be testable


def diagnose(
    recording: Recording,
    causes: Sequence[str] | None = None,
    *,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """What the simulation gets wrong, why, and what fixing it gains.

    Args:
        recording: With measured and simulated tensors in newtons, the simulation replaying the same motion; covariates
            by name (`gripper_opening` in m), and several episodes.
        causes: Names of those to look for, of `known_causes`; default: all.
        seed: Of what is drawn: the bootstrap over episodes and the black box; at least 0.
        jobs: Processors to use, at least 1; the answer is the same for any number.
        progress: Told in words what is being done.

    Raises:
        InvalidValueError: The recording cannot be diagnosed: a stream is missing, constant, in another unit or too
            short, or the streams do not overlap.
        UnknownNameError: There is no such cause.
    """
    if not isinstance(jobs, int) or jobs < 1:
        raise InvalidValueError(f"jobs must be a whole number of at least 1, got {jobs!r}")
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InvalidValueError(f"seed must be a whole number of at least 0, got {seed!r}")
    if isinstance(causes, str):
        raise InvalidValueError(f"causes must be a sequence of names, got the string {causes!r}")
    for name in causes or ():
        cause(name)
    tell = progress or (lambda text: None)
    tell("checking the recording")
    recording, warnings = prepare(recording)
    recording, unsettled, note = settled(recording)
    warnings += note
    thresholds = Thresholds()
    found = explain(recording, causes, thresholds=thresholds, tolerance=Tolerance(), jobs=jobs, progress=progress)
    assert recording.simulated is not None
    simulated = recording.simulated.astype(np.float64)
    problem, judged = found.problem, found.judged
    warnings += silent_in_words(~judged.alive, recording.pads)
    tell("refitting to some episodes, judging on the others")
    squares = hold_out(found, simulated, jobs)
    tell("looking for structure in what is left")
    structure = left_over(problem, found.prediction)
    share = explained_share(squares, squares.after, seed)
    clear = any(item.statistic > CLEAR * item.limit for item in structure)
    if found.found and clear and share is not None and share.value < LITTLE:
        found, squares = _nothing(found, simulated), replace(squares, after=squares.before, prediction=simulated)
    gains = gains_of(found, squares, seed)
    structure = (*unsettled, *_not_held(found, gains), *structure)
    tell("comparing with a black box")
    black, note = _ceiling(judged, simulated, seed, jobs)
    tell("looking for what would do as well")
    rivals = rivals_of(found, thresholds.material * problem.samples / 2)
    searched = [name for name in causes or known_causes() if name not in found.not_searched]
    rivals = with_untold(problem, rivals, searched)
    faint = _faint(found, rivals)
    left = (*structure, *_as_left_over(faint))
    parameters = parameters_of(found)
    warnings += _at_bounds(found)
    named = _named(found, gains, rivals, parameters)
    one = len(problem.episodes) == 1
    verdict = _verdict(named, left, one)
    missing = {**found.not_searched, **_not_excited(problem, found, set(causes or known_causes()))}
    missing = {name: why for name, why in missing.items() if name not in {item.name for item in named}}
    to_show = {name: why for name, why in missing.items() if not cause(name).barred(problem)}
    return Diagnosis(
        verdict=verdict,
        causes=named,
        heldout=figures(squares, seed, black, note),
        confidence=_confidence(found, rivals, thresholds, seed, bool(structure)),
        not_testable=missing,
        streams=_streams(recording, judged, squares),
        symptoms=symptoms(judged, simulated, found.prediction, recording.pads, warnings=warnings, left_over=left),
        advice=advice(
            [(item.name, item.rivals) for item in named],
            {**to_show, **dict.fromkeys(faint, "it is too faint to be named")},
            unexplained=bool(structure),
            episodes=len(problem.episodes),
        ),
        model=found.model,
        intervals=model_intervals(found, parameters),
    )


def _verdict(named: Sequence[FoundCause], structure: Sequence[LeftOver], one: bool) -> Verdict:
    if structure:
        return "partly_explained" if named else "unexplained"
    if not named:
        return "no_discrepancy"
    return "ambiguous" if one or any(item.rivals for item in named) else "explained"


def _faint(found: Explanation, rivals: Mapping[str, tuple[str, ...]]) -> dict[str, float]:
    """What causes bring of what they must bring to be named that may be at work beside those that are."""
    told = {name for names in rivals.values() for name in names}
    return {n: share for n, share in found.nearly.items() if found.found and share > NEARLY and n not in told}


def _as_left_over(shares: Mapping[str, float]) -> tuple[LeftOver, ...]:
    """Causes that may be at work, but bring too little to be named, or no more than others in their place."""
    return tuple(
        LeftOver(
            f"{name} may be at work too: it brings {min(share, 1):.0%} of what it must bring to be named", share, NEARLY
        )
        for name, share in shares.items()
    )


def _not_held(found: Explanation, gains: Mapping[str, Interval]) -> tuple[LeftOver, ...]:
    """Causes that were fitted, and take nothing away from episodes that took no part in the fit."""
    return tuple(
        LeftOver(f"{item.name} gains nothing on episodes that it was not fitted to: do not rely on it", 1.0, 1.0)
        for item in found.found
        if cause(item.name).is_searched and gains[item.name].value <= 0
    )


def _nothing(found: Explanation, simulated: FloatArray) -> Explanation:
    """Without the causes, which explain too little of what is structured to be believed."""
    return replace(
        found,
        found=(),
        model=augment.Chain(),
        prediction=simulated,
        energy=found.empty_energy,
        refit=lambda _: simulated,
    )


def _ceiling(problem: Problem, simulated: FloatArray, seed: int, jobs: int) -> tuple[FloatArray | None, str]:
    try:
        return ceiling(problem, simulated, seed, jobs), ""
    except MissingExtraError as error:
        return None, str(error)


def _at_bounds(found: Explanation) -> tuple[str, ...]:
    """Numbers that would go on beyond what is allowed: what they are part of is not to be believed as it stands."""
    lines = []
    for item in found.found:
        for free in cause(item.name).free(found.problem):
            value = item.values.get(free.name)
            at = [bound for bound in (free.low, free.high) if bound != free.neutral and value == bound]
            if at and free.material is not None:
                lines.append(
                    f"{free.name} of {item.name} is at its bound, {at[0]:g} {free.unit}: other causes may hold it there"
                )
    return tuple(lines)


def _named(
    found: Explanation,
    gains: Mapping[str, Interval],
    rivals: Mapping[str, tuple[str, ...]],
    parameters: Mapping[str, tuple[FittedParameter, ...]],
) -> tuple[FoundCause, ...]:
    causes = [
        FoundCause(
            item.name,
            parameters[item.name],
            gains[item.name],
            rivals[item.name],
            _evidence(item.energy_gain, gains[item.name]),
        )
        for item in found.found
    ]
    return tuple(sorted(causes, key=lambda item: -item.gain.value))


def _evidence(gain: FloatArray, share: Interval) -> str:
    shown = gain[showing(gain)]
    better = int((shown > 0).sum())
    worse = f"Without it the model is worse in {better} of the {len(shown)} episodes that show it"
    if share.value <= 0:
        return f"{worse}, but it gains nothing on episodes that it was not fitted to."
    return f"{worse}, and {share.value:.0%} of the explainable error comes back."


def _confidence(
    found: Explanation, rivals: Mapping[str, tuple[str, ...]], limits: Thresholds, seed: int, structure: bool
) -> dict[str, float]:
    """How often a cause is kept when episodes are drawn anew, shared with its rivals, halved with structure left."""
    least = limits.material * found.problem.samples
    return {
        item.name: survives(item.energy_gain, least, seed) / (1 + len(rivals[item.name])) * (0.5 if structure else 1.0)
        for item in found.found
    }


def _not_excited(problem: Problem, found: Explanation, wanted: set[str]) -> dict[str, str]:
    """Causes that, at a size worth finding, would hardly change what this motion reads."""
    missing: dict[str, str] = {}
    limit = FAINT * Thresholds().material
    for name in sorted(wanted):
        item = cause(name)
        if (
            item.probes is None
            or name in found.not_searched
            or (item.covariate and item.covariate not in problem.covariates)
        ):
            continue
        try:
            effects = [item.make(values, problem) for values in item.probes(problem)]
            energy = max(
                (np.sum(problem.weigh(problem.run(e, problem.simulated) - problem.simulated) ** 2) for e in effects),
                default=np.inf,
            )
        except ValueError:
            continue
        if energy < limit * problem.samples:
            missing[name] = "this motion does not excite it: at a size worth finding it would stay within the noise"
    return missing


def _streams(recording: Recording, problem: Problem, squares: Squares) -> Streams:
    assert recording.measured is not None
    assert recording.simulated is not None
    return Streams(
        time=recording.time,
        episode=recording.episode,
        measured=recording.measured,
        simulated=recording.simulated,
        extended=problem.read(squares.prediction).astype(np.float32),
        covariates=problem.covariates,
        pads=recording.pads,
        layout=recording.layout,
        step=problem.step,
        alive=problem.alive,
    )
