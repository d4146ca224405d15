"""Searched: the search for causes in one recording, up to but not including the diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from paxisim.diagnose.adequacy import left_over
from paxisim.diagnose.advice import NOT_ASKED
from paxisim.diagnose.cause import Cause
from paxisim.diagnose.causes import CAUSES
from paxisim.diagnose.causes.scene import IMPRATIO, MEAN_POSE
from paxisim.diagnose.correspondence import aligned, correspondence_of
from paxisim.diagnose.diagnosis import Diagnosis, Interval, LeftOver
from paxisim.diagnose.explanation import Explanation, explanation_of
from paxisim.diagnose.folds import effects, folds_of
from paxisim.diagnose.heldout import SquaredErrors, affected_gains_of, explained_share, squares_of
from paxisim.diagnose.inside.prepared import RULES, problem_with, with_frames
from paxisim.diagnose.inside.responses import Responses
from paxisim.diagnose.prepare import prepare
from paxisim.diagnose.problem import Problem
from paxisim.diagnose.reading import ReadOff, read_off
from paxisim.diagnose.repeats import settled
from paxisim.diagnose.report.unrelated import CLOCKS, unrelated
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.search import PREDICTION_END, Search
from paxisim.diagnose.vocabulary import cause, known_causes
from paxisim.recording import Recording
from paxisim.scene.doubt import recorded_doubts
from paxisim.scene.modes import hidden_by_replay

MOSTLY = 0.5  # share of a replay in doubt above which no verdict says that the error is explained
CLEAR_STRUCTURE = 2.0  # statistic of residual structure, relative to its limit, above which the structure is clear


@dataclass(frozen=True, eq=False)
class Begun:
    """A recording that is ready for the search.

    Attributes:
        recording: The part of the recording that is used.
        warnings: Warnings about the recording.
        unsettled: Structure in the residual of a sensor that had not settled.
        wanted: The causes to look for.
        not_searched: Reason for each excluded cause, by name.
        raw: The recording prepared for fitting.
        off: Result of the deterministic checks.
    """

    recording: Recording
    warnings: tuple[str, ...]
    unsettled: tuple[LeftOver, ...]
    wanted: tuple[Cause, ...]
    not_searched: Mapping[str, str]
    raw: Problem
    off: ReadOff


@dataclass(frozen=True, eq=False)
class Searched(Begun):
    """A recording after the search.

    Attributes:
        it: Result of the search.
    """

    it: Explained


def searched(
    recording: Recording,
    causes: Sequence[str] | None,
    seed: int,
    jobs: int,
    tell: Callable[[str, float], None],
) -> Searched | Diagnosis:
    """Search a recording for causes of the sensor.

    Args:
        recording: As in `paxisim.diagnose`.
        causes: As in `paxisim.diagnose`.
        seed: As in `paxisim.diagnose`.
        jobs: As in `paxisim.diagnose`.
        tell: As `progress` in `paxisim.diagnose`.

    Returns:
        The result of the search, or a diagnosis stating that the streams do not show the same motion.

    Raises:
        InvalidValueError: As in `paxisim.diagnose`.
    """
    begun = begin(recording, causes, None, tell)
    if isinstance(begun, Diagnosis):
        return begun
    search = search_of(begun.off, begun.wanted, jobs, tell)
    it = explained(begun.off, search, seed, jobs, tell)
    return Searched(**vars(begun), it=it)


def begin(
    recording: Recording,
    causes: Sequence[str] | None,
    responses: Responses | None,
    tell: Callable[[str, float], None],
) -> Begun | Diagnosis:
    """Check a recording and run the deterministic checks; `searched` describes the arguments.

    `responses` are the effects of the scene parameters, or None without a scene.
    """
    tell("checking the recording", 0.0)
    if responses is not None:
        recording = with_frames(recording)
    recording, warnings = prepare(recording)
    doubtful, doubts = recorded_doubts(recording)
    warnings = (doubts, *warnings) if doubts else warnings
    match = correspondence_of(recording, replayed=responses is not None or "replay" in recording.metadata)
    if match.why:
        return unrelated(recording, warnings, match)
    if match.clocks_apart:
        recording, warnings = aligned(recording, match.shift), (*warnings, CLOCKS.format(match.shift))

    tell("reading layout, rounding and dead taxels", 0.02)
    raw = problem_with(recording, responses)
    wanted, not_searched = wanted_of(raw, causes, hidden_by_replay(recording))
    off = read_off(raw, wanted)
    recording, unsettled, note = settled(recording, off.problem.alive)
    if unsettled:
        raw = problem_with(recording, responses)
        off = read_off(raw, wanted)
    if doubtful > MOSTLY:
        unsettled = (*unsettled, LeftOver("most of the replay is in doubt", doubtful, MOSTLY))
    return Begun(recording, (*warnings, *note), unsettled, tuple(wanted), not_searched, raw, off)


@dataclass(frozen=True, eq=False)
class Explained:
    """Result of a search.

    Attributes:
        found: The causes, with the extended model.
        squares: Squared errors on held-out samples.
        structure: Structure in the residual.
        dropped: Causes that were fitted but are not named, each with the 90 % interval of the share of the error that
            it removes on the held-out episodes that it affects. This interval includes 0.
    """

    found: Explanation
    squares: SquaredErrors
    structure: tuple[LeftOver, ...]
    dropped: Mapping[str, Interval]


def search_of(
    off: ReadOff, wanted: Sequence[Cause], jobs: int, tell: Callable[[str, float], None], rules: Rules | None = None
) -> Search:
    """Set up the search for causes after the deterministic checks."""
    rules = rules or (Rules() if off.problem.scene is None else RULES)
    known = (*CAUSES, MEAN_POSE, IMPRATIO)
    nuisances = [item for item in known if item.nuisance and item not in wanted and not item.barred(off.raw)]
    searched = [item for item in (*wanted, *nuisances) if item.read is None]
    return Search(off.problem, searched, folds_of(off.problem, searched, rules), rules, jobs, tell)


def explained(off: ReadOff, search: Search, seed: int, jobs: int, tell: Callable[[str, float], None]) -> Explained:
    """Run a search and drop causes whose gain is not significantly above 0.

    All causes are dropped if they explain little and clear structure remains in the residual.
    """
    found = explanation_of(off, search, search.run(), jobs)
    squares = squares_of(found, jobs)
    tell("looking for structure in the residual", PREDICTION_END)
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


def wanted_of(
    raw: Problem, causes: Sequence[str] | None, hidden: Mapping[str, str]
) -> tuple[list[Cause], dict[str, str]]:
    """The causes to look for, and the reason for each excluded cause by name."""
    wanted, not_searched = [], {}
    for name in known_causes():
        item = cause(name)
        if causes is not None and name not in causes:
            not_searched[name] = NOT_ASKED
        elif item.change is not None and raw.scene is None:
            continue
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
    """Reason why a cause has no effect in a recording without contact; empty if it has one or if there is contact."""
    if raw.has_contact or item.course is not None or item.read is not None:
        return ""
    acts = item.local is None and any(change.any() for change in effects(raw.thinned, item, raw.thinned.simulated))
    return "" if acts else "it has no effect without contact"


def _explains_too_little(squares: SquaredErrors, structure: Sequence[LeftOver], rules: Rules, seed: int) -> bool:
    """Whether clear structure remains while the causes explain little; they are then not the real causes."""
    share = explained_share(squares, squares.after, seed)
    clear = any(item.statistic > CLEAR_STRUCTURE * item.limit for item in structure)
    return clear and share is not None and share.value < rules.explains
