"""Searched: the search for causes in one recording, before anything is said of it."""

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
from paxisim.diagnose.search import PREDICTS, Search
from paxisim.diagnose.vocabulary import cause, known_causes
from paxisim.recording import Recording
from paxisim.scene.modes import hidden_by_replay

CLEAR = 2.0  # times its limit, that left-over structure must reach to be clear


@dataclass(frozen=True, eq=False)
class Begun:
    """A recording that is ready for the search.

    Attributes:
        recording: The recording, as far as it was used.
        warnings: What is to be said of it.
        unsettled: Structure of a sensor that had not settled.
        wanted: The causes that are looked for.
        not_searched: By name why others are not.
        raw: The recording made ready.
        off: What the checks read off.
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
    """The same with what the search found.

    Attributes:
        it: What was found.
    """

    it: Explained


def searched(
    recording: Recording,
    causes: Sequence[str] | None,
    responses: Responses | None,
    seed: int,
    jobs: int,
    tell: Callable[[str, float], None],
) -> Searched | Diagnosis:
    """Search a recording for causes.

    Args:
        recording: See `paxisim.diagnose`.
        causes: See there.
        responses: What the numbers of the scene do, if there is one.
        seed: See there.
        jobs: See there.
        tell: See there.

    Returns:
        What was found, or a diagnosis that says that the streams are not of one motion.

    Raises:
        InvalidValueError: See there.
    """
    begun = begin(recording, causes, responses, tell)
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
    """Check a recording and read off what needs no search; see `searched`."""
    tell("checking the recording", 0.0)
    if responses is not None:
        recording = with_frames(recording)
    recording, warnings = prepare(recording)
    match = correspondence_of(recording, replayed=responses is not None)
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
    return Begun(recording, (*warnings, *note), unsettled, tuple(wanted), not_searched, raw, off)


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
    off: ReadOff, wanted: Sequence[Cause], jobs: int, tell: Callable[[str, float], None], rules: Rules | None = None
) -> Search:
    """The search for causes in what the checks have left."""
    rules = rules or (Rules() if off.problem.scene is None else RULES)
    known = (*CAUSES, MEAN_POSE, IMPRATIO)
    nuisances = [item for item in known if item.nuisance and item not in wanted and not item.barred(off.raw)]
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


def wanted_of(
    raw: Problem, causes: Sequence[str] | None, hidden: Mapping[str, str]
) -> tuple[list[Cause], dict[str, str]]:
    """The causes that can be looked for, and by name why the others cannot."""
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
