"""Run: from a recording to its diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paxisim.diagnose.adequacy import left_over
from paxisim.diagnose.advice import NOT_ASKED, advice
from paxisim.diagnose.cause import Cause
from paxisim.diagnose.causes import CAUSES
from paxisim.diagnose.ceiling import ceiling
from paxisim.diagnose.correspondence import ALIKE, Correspondence, aligned, correspondence_of
from paxisim.diagnose.diagnosis import (
    Diagnosis,
    FittedParameter,
    FoundCause,
    HeldOut,
    Interval,
    LeftOver,
    Symptoms,
    Verdict,
)
from paxisim.diagnose.explanation import Explanation, Named, explanation_of
from paxisim.diagnose.folds import effects, folds_of
from paxisim.diagnose.heldout import SquaredErrors, explained_share, figures, gains_of, squares_of, survives
from paxisim.diagnose.intervals import model_intervals, parameters_of
from paxisim.diagnose.prepare import prepare
from paxisim.diagnose.problem import FloatArray, Problem, problem_of, showing
from paxisim.diagnose.reading import read_off
from paxisim.diagnose.repeats import settled, with_untold
from paxisim.diagnose.report.followed import followed
from paxisim.diagnose.report.streams import Streams
from paxisim.diagnose.report.symptoms import symptoms
from paxisim.diagnose.rivals import rivals_of
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.search import Search
from paxisim.diagnose.silent import silent_in_words
from paxisim.diagnose.vocabulary import cause, known_causes
from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.recording import Recording
from paxisim.scene.modes import hidden_by_replay

CLOCKS = (
    "the clocks of the two streams are apart: measured lags simulated by {:.2f} s. The streams were aligned first, so "
    "that a delay of the sensor itself cannot be told; check the clocks"
)
CHECKS = (
    "check that both streams were recorded in the same motion, that their clocks agree, that both are in newtons, and "
    "that pads and episodes are in the same order"
)
CLEAR = 2.0  # times its limit, that left-over structure must reach to be clear


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
            by name, such as `gripper_opening` (m) or the angles of joints (rad), and several episodes.
        causes: Names of the causes to look for, of `known_causes`; default: all.
        seed: Random seed of the bootstrap over episodes and of the black box; at least 0.
        jobs: Processors to use, at least 1; the answer is the same for any number.
        progress: Called with a line of text at each stage.

    Raises:
        InvalidValueError: The recording cannot be diagnosed: a stream is missing, constant, in another unit or too
            short, or the streams do not overlap.
        UnknownNameError: There is no such cause.
    """
    _check(causes, seed, jobs)
    return diagnosis_of(recording, causes, seed, jobs, progress or (lambda text: None), Rules())


def _check(causes: Sequence[str] | None, seed: int, jobs: int) -> None:
    if not isinstance(jobs, int) or jobs < 1:
        raise InvalidValueError(f"jobs must be a whole number of at least 1, got {jobs!r}")
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InvalidValueError(f"seed must be a whole number of at least 0, got {seed!r}")
    if isinstance(causes, str):
        raise InvalidValueError(f"causes must be a sequence of names, got the string {causes!r}")
    for name in causes or ():
        cause(name)


def diagnosis_of(
    recording: Recording,
    causes: Sequence[str] | None,
    seed: int,
    jobs: int,
    tell: Callable[[str], None],
    rules: Rules,
) -> Diagnosis:
    """As `diagnose`, with other rules."""
    tell("checking the recording")
    recording, warnings = prepare(recording)
    match = correspondence_of(recording)
    if match.why:
        return _unrelated(recording, warnings, match)
    if match.clocks_apart:
        recording, warnings = aligned(recording, match.shift), (*warnings, CLOCKS.format(match.shift))
    recording, unsettled, note = settled(recording)

    tell("reading layout, rounding and dead taxels")
    raw = problem_of(recording)
    wanted, not_searched = _wanted(raw, causes, hidden_by_replay(recording))
    off = read_off(raw, wanted)

    nuisances = [item for item in CAUSES if item.nuisance and item not in wanted and not item.barred(raw)]
    searched = [item for item in (*wanted, *nuisances) if item.read is None]
    search = Search(off.problem, searched, folds_of(off.problem, searched, rules), rules, jobs, tell)
    chosen = search.run()

    tell("predicting held-out episodes")
    found = explanation_of(off, search, chosen, jobs)
    squares = squares_of(found, jobs)

    tell("looking for structure in the residual")
    structure = left_over(off.problem, found.prediction)
    if _explains_too_little(squares, structure, rules, seed):
        found = explanation_of(off, search, (), jobs)
        squares = squares_of(found, jobs)

    tell("comparing with a black box")
    black, missing = _ceiling(off.judged, raw.simulated, seed, jobs)

    tell("looking for rivals")
    judged = _judged(found, squares, seed)
    doubts = (*unsettled, *structure, *judged.near_misses)
    verdict = _verdict(judged.causes, doubts, len(raw.episodes) == 1)
    untestable = {**not_searched, **_not_excited(found, wanted)}
    untestable = {n: why for n, why in untestable.items() if n not in {item.name for item in judged.causes}}
    silent = off.raw.alive & ~off.judged.alive
    warnings = (*warnings, *note, *silent_in_words(silent, recording.pads), *_at_bounds(found))
    return Diagnosis(
        verdict=verdict,
        causes=judged.causes,
        heldout=figures(squares, seed, black, missing),
        confidence=_confidence(found, judged, seed),
        not_testable=untestable,
        streams=_streams(recording, found),
        symptoms=symptoms(
            off.judged, raw.simulated, found.prediction, recording.pads, warnings=warnings, left_over=doubts
        ),
        advice=advice(
            [(item.name, item.rivals) for item in judged.causes],
            {n: why for n, why in untestable.items() if not cause(n).barred(raw)}
            | dict.fromkeys(judged.missed, "its gain falls short of materiality"),
            {name: cause(name).excites for name in known_causes()},
            unexplained=bool(unsettled or structure),
            episodes=len(raw.episodes),
        ),
        model=found.model,
        intervals=model_intervals(found, judged.parameters),
    )


def _unrelated(recording: Recording, warnings: Sequence[str], match: Correspondence) -> Diagnosis:
    """That the streams are not of one motion: nothing is fitted then."""
    assert recording.measured is not None
    assert recording.simulated is not None
    measured = recording.measured.astype(np.float64)
    error = float(np.sqrt(np.sum((measured - recording.simulated) ** 2) / max(float(np.sum(measured**2)), 1e-300)))
    return Diagnosis(
        verdict="unrelated",
        causes=(),
        heldout=HeldOut(error, error, 0.0, "", None, ()),
        confidence={},
        not_testable={},
        symptoms=Symptoms(tuple(warnings), (LeftOver(match.why, match.alike, ALIKE),)),
        advice=(CHECKS,),
    )


@dataclass(frozen=True)
class Judged:
    """The named causes with what is said of each.

    Attributes:
        causes: By gain.
        parameters: By cause, with intervals.
        missed: Causes that fall a little short of being named.
        near_misses: The same in words.
    """

    causes: tuple[FoundCause, ...]
    parameters: Mapping[str, tuple[FittedParameter, ...]]
    missed: tuple[str, ...]
    near_misses: tuple[LeftOver, ...]


def _judged(found: Explanation, squares: SquaredErrors, seed: int) -> Judged:
    gains = gains_of(squares, seed)
    rules, search = found.search.rules, found.search
    remembering = [name for name, item in search.causes.items() if item.remembers]
    rivals = with_untold(found.problem, rivals_of(found), remembering)
    parameters = parameters_of(found)
    causes = [
        FoundCause(
            named.name,
            parameters[named.name],
            gains[named.name],
            rivals[named.name],
            _evidence(squares.without[named.name] - squares.after, gains[named.name])
            + _covariate(found.problem, named),
        )
        for named in found.named
    ]
    rivalling = {name for names in rivals.values() for name in names}
    shares = search.near_misses(found.chosen) if found.fitted else {}
    shares = {n: s for n, s in shares.items() if s > rules.near_miss and n not in rivalling}
    lines = tuple(
        LeftOver(
            f"{name} is a near miss: it reaches {min(share, 1):.0%} of the gain required to name it",
            share,
            rules.near_miss,
        )
        for name, share in shares.items()
    )
    return Judged(tuple(sorted(causes, key=lambda c: -c.gain.value)), parameters, tuple(shares), lines)


def _wanted(
    raw: Problem, causes: Sequence[str] | None, hidden: Mapping[str, str]
) -> tuple[list[Cause], dict[str, str]]:
    """The causes that can be looked for, and by name why the others cannot."""
    wanted, not_searched = [], {}
    for name in known_causes():
        item = cause(name)
        if causes is not None and name not in causes:
            not_searched[name] = NOT_ASKED
        elif name in hidden:
            not_searched[name] = hidden[name]
        elif item.covariate and item.covariate not in raw.covariates:
            not_searched[name] = f"the recording has no covariate {item.covariate!r}"
        elif why := item.barred(raw) or _needs_contact(raw, item):
            not_searched[name] = why
        else:
            wanted.append(item)
    return wanted, not_searched


def _needs_contact(raw: Problem, item: Cause) -> str:
    """Why a cause shows nothing in a recording without contact; empty if it does, or if there is contact."""
    if raw.has_contact or item.course is not None or item.read is not None:
        return ""
    acts = item.local is None and any(change.any() for change in effects(raw.thinned, item, raw.thinned.simulated))
    return "" if acts else "it does nothing without contact"


def _explains_too_little(squares: SquaredErrors, structure: Sequence[LeftOver], rules: Rules, seed: int) -> bool:
    """Whether clear structure is left over and the causes explain little: then they are not the cause."""
    share = explained_share(squares, squares.after, seed)
    clear = any(item.statistic > CLEAR * item.limit for item in structure)
    return clear and share is not None and share.value < rules.explains


def _verdict(named: Sequence[FoundCause], doubts: Sequence[LeftOver], one: bool) -> Verdict:
    if doubts:
        return "partly_explained" if named else "unexplained"
    if not named:
        return "no_discrepancy"
    return "ambiguous" if one or any(item.rivals for item in named) else "explained"


def _ceiling(problem: Problem, simulated: FloatArray, seed: int, jobs: int) -> tuple[FloatArray | None, str]:
    try:
        return ceiling(problem, simulated, seed, jobs), ""
    except MissingExtraError as error:
        return None, f"{error}."


def _at_bounds(found: Explanation) -> tuple[str, ...]:
    """Warnings of numbers that the data would push beyond what is allowed."""
    lines = []
    for named in found.fitted:
        for free in named.cause.free(found.problem):
            value = named.values.get(free.name)
            at = [bound for bound in (free.low, free.high) if bound != free.neutral and value == bound]
            if at and free.material is not None:
                lines.append(
                    f"{free.name} of {named.name} is at its bound, {at[0]:g} {free.unit}: do not rely on its value"
                )
    return tuple(lines)


def _evidence(gain: FloatArray, share: Interval) -> str:
    shown = showing(gain)
    worse = int((gain[shown] > 0).sum())
    return (
        f"Without it the model predicts {worse} of the {int(shown.sum())} affected held-out episodes less accurately; "
        f"it explains {share.value:.0%} of the explainable error."
    )


def _covariate(problem: Problem, named: Named) -> str:
    """The covariate that goes with what the cause reads without force; empty if it knows of none."""
    if not named.transform.covariate_names or named.cause.course is None:
        return ""
    rows, rest = problem.thinned, problem.thinned.at_rest
    rest = rest if rest.any() else np.ones_like(rest)
    added = rows.run(named.transform, np.zeros_like(rows.simulated))[rest]
    name, share = followed(named.transform, rows.covariates, added.reshape(len(added), -1), rest)
    return f" A straight line in {name} explains {share:.0%} of what it adds without contact."


def _confidence(found: Explanation, judged: Judged, seed: int) -> dict[str, float]:
    """How often a cause is kept when held-out episodes are resampled, divided among the cause and its rivals."""
    kept = dict.fromkeys((named.name for named in found.named), 1.0)
    for named in found.named:
        if named.evidence is not None:
            gain = found.folds.independent(named.evidence.gain)
            kept[named.name] = survives(gain, named.evidence.needed, seed)
    return {item.name: kept[item.name] / (1 + len(item.rivals)) for item in judged.causes}


def _not_excited(found: Explanation, wanted: Sequence[Cause]) -> dict[str, str]:
    """Causes that, at a size worth finding, would hardly change what this motion reads."""
    problem, rules, missing = found.problem.thinned, found.search.rules, {}
    for item in wanted:
        if item.read is not None or item.local is not None or item.course is not None:
            continue
        changes = effects(problem, item, problem.simulated)
        energy = max((float(np.sum((change * problem.weight) ** 2)) for change in changes), default=np.inf)
        if energy < rules.visible * rules.material * problem.samples:
            missing[item.name] = "this motion does not excite it: at a material size its effect stays below the noise"
    return missing


def _streams(recording: Recording, found: Explanation) -> Streams:
    assert recording.measured is not None
    assert recording.simulated is not None
    problem = found.off.judged
    return Streams(
        time=recording.time,
        episode=recording.episode,
        measured=recording.measured,
        simulated=recording.simulated,
        extended=problem.read(found.heldout).astype(np.float32),
        covariates=problem.covariates,
        pads=recording.pads,
        layout=recording.layout,
        step=problem.step,
        alive=problem.alive,
    )
