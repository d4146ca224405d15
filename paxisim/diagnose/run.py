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
from paxisim.diagnose.correspondence import aligned, correspondence_of
from paxisim.diagnose.diagnosis import (
    Diagnosis,
    FoundCause,
    Interval,
    LeftOver,
    Verdict,
)
from paxisim.diagnose.explanation import Explanation, explanation_of
from paxisim.diagnose.folds import effects, folds_of
from paxisim.diagnose.heldout import (
    SquaredErrors,
    affected_gains_of,
    explained_share,
    figures,
    gains_of,
    squares_of,
    survives,
)
from paxisim.diagnose.intervals import model_intervals, parameters_of
from paxisim.diagnose.prepare import prepare
from paxisim.diagnose.problem import FloatArray, Problem, problem_of
from paxisim.diagnose.reading import ReadOff, read_off
from paxisim.diagnose.repeats import settled, with_untold
from paxisim.diagnose.report.caveats import at_bounds, caveats, near_misses
from paxisim.diagnose.report.evidence import evidence
from paxisim.diagnose.report.streams import Streams
from paxisim.diagnose.report.symptoms import symptoms
from paxisim.diagnose.report.unrelated import CLOCKS, unrelated
from paxisim.diagnose.rivals import rivals_of
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.search import PREDICTS, Search
from paxisim.diagnose.vocabulary import cause, known_causes
from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.recording import Recording
from paxisim.scene.modes import hidden_by_replay

CLEAR = 2.0  # times its limit, that left-over structure must reach to be clear


def diagnose(
    recording: Recording,
    causes: Sequence[str] | None = None,
    *,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[str, float], None] | None = None,
) -> Diagnosis:
    """What the simulation gets wrong, why, and what fixing it gains.

    Args:
        recording: With measured and simulated tensors in newtons, the simulation replaying the same motion; covariates
            by name, such as `gripper_opening` (m) or the angles of joints (rad), and several episodes.
        causes: Names of the causes to look for, of `known_causes`; default: all.
        seed: Random seed of the bootstrap over episodes and of the black box; at least 0.
        jobs: Processors to use, at least 1; the answer is the same for any number.
        progress: Called with the stage in words and the share of the work that is done, from 0 to 1, as it usually is.

    Raises:
        InvalidValueError: The recording cannot be diagnosed: a stream is missing, constant, in another unit or too
            short, or the streams do not overlap.
        UnknownNameError: There is no such cause.
    """
    _check(causes, seed, jobs)
    tell = progress or (lambda stage, share: None)
    tell("checking the recording", 0.0)
    recording, warnings = prepare(recording)
    match = correspondence_of(recording)
    if match.why:
        return unrelated(recording, warnings, match)
    if match.clocks_apart:
        recording, warnings = aligned(recording, match.shift), (*warnings, CLOCKS.format(match.shift))

    tell("reading layout, rounding and dead taxels", 0.02)
    raw = problem_of(recording)
    wanted, not_searched = wanted_of(raw, causes, hidden_by_replay(recording))
    off = read_off(raw, wanted)
    recording, unsettled, note = settled(recording, off.problem.alive)
    if unsettled:
        raw = problem_of(recording)
        off = read_off(raw, wanted)

    search = search_of(off, wanted, Rules(), jobs, tell)
    it = explained(off, search, seed, jobs, tell)
    found, squares = it.found, it.squares
    tell("comparing with a black box", 0.82)
    black, missing = _ceiling(off.judged, raw.simulated, seed, jobs)

    tell("looking for rivals", 0.9)
    named, short = _named(found, squares, seed)
    doubts = (*unsettled, *it.structure, *short.values())
    untestable = {**not_searched, **_not_excited(found, wanted)}
    untestable = {n: why for n, why in untestable.items() if n not in {item.name for item in named}}
    warnings = (*warnings, *note, *caveats(found, it.dropped, recording.pads))
    return Diagnosis(
        verdict=_verdict(named, bool(doubts or at_bounds(found)), len(raw.episodes) == 1),
        causes=named,
        heldout=figures(squares, seed, black, missing),
        confidence=_confidence(found, named, seed),
        not_testable=untestable,
        streams=_streams(recording, found),
        symptoms=symptoms(
            off.judged, raw.simulated, found.prediction, recording.pads, warnings=warnings, left_over=doubts
        ),
        advice=advice(
            [(item.name, item.rivals) for item in named],
            {n: why for n, why in untestable.items() if not cause(n).barred(raw)}
            | dict.fromkeys(short, "its gain falls short of materiality"),
            {name: cause(name).excites for name in known_causes()},
            unexplained=bool(unsettled or it.structure),
            episodes=len(raw.episodes),
        ),
        model=found.model,
        intervals=model_intervals(found, {item.name: item.parameters for item in named}),
    )


def _check(causes: Sequence[str] | None, seed: int, jobs: int) -> None:
    if not isinstance(jobs, int) or jobs < 1:
        raise InvalidValueError(f"jobs must be a whole number of at least 1, got {jobs!r}")
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InvalidValueError(f"seed must be a whole number of at least 0, got {seed!r}")
    if isinstance(causes, str):
        raise InvalidValueError(f"causes must be a sequence of names, got the string {causes!r}")
    for name in causes or ():
        cause(name)


@dataclass(frozen=True, eq=False)
class Explained:
    """What is said of a recording.

    Attributes:
        found: The causes.
        squares: Their errors on held-out samples.
        structure: What is left in the residual.
        dropped: Causes that were fitted and are not named: the 90 % interval of the share that each takes off the error
            of the held-out episodes that it affects includes 0.
    """

    found: Explanation
    squares: SquaredErrors
    structure: tuple[LeftOver, ...]
    dropped: Mapping[str, Interval]


def search_of(
    off: ReadOff, wanted: Sequence[Cause], rules: Rules, jobs: int, tell: Callable[[str, float], None]
) -> Search:
    """The search for causes in what the checks have left."""
    nuisances = [item for item in CAUSES if item.nuisance and item not in wanted and not item.barred(off.raw)]
    searched = [item for item in (*wanted, *nuisances) if item.read is None]
    return Search(off.problem, searched, folds_of(off.problem, searched, rules), rules, jobs, tell)


def explained(off: ReadOff, search: Search, seed: int, jobs: int, tell: Callable[[str, float], None]) -> Explained:
    """The causes that a search finds, and that are certain to explain something."""
    found = explanation_of(off, search, search.run(), jobs)
    squares = squares_of(found, jobs)
    tell("looking for structure in the residual", PREDICTS)
    structure = left_over(off.problem, found.prediction)
    if _explains_too_little(squares, structure, search.rules, seed):
        found = explanation_of(off, search, (), jobs)
        squares = squares_of(found, jobs)
    dropped: dict[str, Interval] = {}
    while True:
        shares = affected_gains_of(squares, seed)
        shares = {named.name: shares.get(named.name, Interval(0.0)) for named in found.fitted}
        doubtful = {n: s for n, s in shares.items() if (s.value if s.low is None else s.low) <= 0}
        if not doubtful:
            return Explained(found, squares, structure, dropped)
        least = min(doubtful, key=lambda name: doubtful[name].value)
        dropped[least] = doubtful[least]
        found = explanation_of(off, search, [name for name in found.chosen if name not in dropped], jobs)
        squares = squares_of(found, jobs)


def _named(found: Explanation, squares: SquaredErrors, seed: int) -> tuple[tuple[FoundCause, ...], dict[str, LeftOver]]:
    """The named causes by what they explain, with what is said of each, and near misses by name."""
    gains = gains_of(squares, seed)
    search = found.search
    remembering = [name for name, item in search.causes.items() if item.remembers]
    rivals = with_untold(found.problem, rivals_of(found), remembering)
    parameters = parameters_of(found)
    causes = [
        FoundCause(
            named.name,
            parameters[named.name],
            gains[named.name],
            rivals[named.name],
            evidence(found.problem, named, squares.without[named.name] - squares.after, gains[named.name]),
        )
        for named in found.named
    ]
    rivalling = {name for names in rivals.values() for name in names}
    shares = search.near_misses(found.chosen) if found.fitted else {}
    short = near_misses({n: s for n, s in shares.items() if n not in rivalling}, search.rules.near_miss)
    return tuple(sorted(causes, key=lambda c: -c.gain.value)), short


def wanted_of(
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


def _verdict(named: Sequence[FoundCause], doubts: bool, one: bool) -> Verdict:
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


def _confidence(found: Explanation, causes: Sequence[FoundCause], seed: int) -> dict[str, float]:
    """How often a cause is kept when held-out episodes are resampled, divided among the cause and its rivals.

    A cause with a number at its bound has one rival more: what lies beyond.
    """
    bounded = at_bounds(found)
    kept = dict.fromkeys((named.name for named in found.named), 1.0)
    for named in found.named:
        if named.evidence is not None:
            gain = found.folds.independent(named.evidence.gain)
            kept[named.name] = survives(gain, named.evidence.needed, seed)
    return {c.name: kept[c.name] / (1 + len(c.rivals) + (c.name in bounded)) for c in causes}


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
        calibrated=problem.calibrated,
    )
