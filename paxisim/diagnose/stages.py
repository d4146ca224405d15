"""Stages: a recording is made ready, searched for causes, and what was found is confirmed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paxisim.diagnose.causes.detected import ReadOff, read_off
from paxisim.diagnose.causes.kinds import BaselineCause, Cause, DetectedCause, FittedCause
from paxisim.diagnose.causes.scene import IMPRATIO, MEAN_POSE
from paxisim.diagnose.causes.vocabulary import CAUSES, cause, known_causes
from paxisim.diagnose.data.correspondence import CLOCKS, Correspondence, aligned, correspondence_of
from paxisim.diagnose.data.prepare import prepare
from paxisim.diagnose.data.problem import Problem
from paxisim.diagnose.data.repeats import settled
from paxisim.diagnose.data.replayed import problem_with, with_frames
from paxisim.diagnose.data.responses import Responses
from paxisim.diagnose.explain.adequacy import left_over
from paxisim.diagnose.explain.advice import NOT_ASKED
from paxisim.diagnose.explain.explanation import Explanation, explanation_of
from paxisim.diagnose.explain.heldout import SquaredErrors, affected_gain_of, explained_share, squares_of
from paxisim.diagnose.result import Interval, LeftOver
from paxisim.diagnose.rules import IN_SCENE, STREAMS, STRUCTURE, Rules
from paxisim.diagnose.scorer.scorer import PREDICTION_END, Scorer
from paxisim.recording import Recording
from paxisim.scene.doubt import recorded_doubts
from paxisim.scene.modes import hidden_by_replay

Tell = Callable[[str, float], None]


class UnrelatedError(Exception):
    """The two streams do not show the same motion, so that nothing can be fitted."""

    def __init__(self, recording: Recording, warnings: tuple[str, ...], match: Correspondence) -> None:
        """Keep the recording, the warnings about it, and how well its streams correspond."""
        super().__init__(match.why)
        self.recording, self.warnings, self.match = recording, warnings, match


@dataclass(frozen=True, eq=False)
class Ready:
    """A recording that is ready for the search.

    Attributes:
        recording: The part of the recording that is used.
        warnings: Warnings about the recording.
        doubts: Structure found before any fit: a sensor that had not settled, a replay in doubt.
        wanted: The causes to look for.
        not_searched: Reason for each excluded cause, by name.
        raw: The recording prepared for fitting.
        off: Result of the deterministic checks.
    """

    recording: Recording
    warnings: tuple[str, ...]
    doubts: tuple[LeftOver, ...]
    wanted: tuple[Cause, ...]
    not_searched: Mapping[str, str]
    raw: Problem
    off: ReadOff


def ready_for_search(
    recording: Recording, causes: Sequence[str] | None, responses: Responses | None, tell: Tell
) -> Ready:
    """Check, align and prepare a recording, and run the deterministic checks.

    Args:
        recording: As in `paxisim.diagnose`.
        causes: As in `paxisim.diagnose`.
        responses: Effects of the scene parameters; None without a scene.
        tell: As `progress` in `paxisim.diagnose`.

    Raises:
        InvalidValueError: As in `paxisim.diagnose`.
        UnrelatedError: The streams do not show the same motion.
    """
    tell("checking the recording", 0.0)
    if responses is not None:
        recording = with_frames(recording)
    given = recording
    recording, warnings = prepare(given)
    unmeasured = np.isnan(given.measured).all(axis=0)  # type: ignore[arg-type]  # as the recording says
    doubtful, warning = recorded_doubts(recording)
    warnings = (warning, *warnings) if warning else warnings
    match = correspondence_of(recording, replayed=responses is not None or "replay" in recording.metadata)
    if match.why:
        raise UnrelatedError(recording, warnings, match)
    if match.clocks_apart:
        recording, warnings = aligned(recording, match.shift), (*warnings, CLOCKS.format(match.shift))

    tell("reading layout, rounding and dead taxels", 0.02)
    raw = problem_with(recording, responses)
    wanted, not_searched = wanted_of(raw, causes, hidden_by_replay(recording))
    off = read_off(raw, wanted)
    recording, first, distance = settled(recording, off.problem.alive)
    doubts: list[LeftOver] = []
    if first:
        raw = problem_with(recording, responses)
        off = read_off(raw, wanted)
        unsettled = f"{first} of a repeated motion read differently from the later ones"
        doubts.append(LeftOver(f"{unsettled} under load", distance, STREAMS.unsettled))
        excluded = "These episodes were excluded, and the model describes the settled sensor"
        note = f"{unsettled} ({distance:.1f} times their spread): the sensor had not settled. {excluded}"
        warnings = (*warnings, note)
    silent = off.silent & ~unmeasured
    if silent.mean() > STRUCTURE.silent:
        what = f"{silent.sum()} of {silent.size} channels never change although the simulation does"
        doubts.append(LeftOver(what, float(silent.mean()), STRUCTURE.silent))
    if doubtful > STRUCTURE.doubt:
        doubts.append(LeftOver("most of the replay is in doubt", doubtful, STRUCTURE.doubt))
    return Ready(recording, warnings, tuple(doubts), tuple(wanted), not_searched, raw, off)


@dataclass(frozen=True, eq=False)
class Confirmed:
    """What a search found, and what held-out samples say of it.

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


def scorer_of(ready: Ready, jobs: int, tell: Tell, rules: Rules | None = None) -> Scorer:
    """Set up the scorer of the causes to look for, with the nuisances that are fitted beside them."""
    rules = rules or (Rules() if ready.raw.scene is None else IN_SCENE)
    known = (*CAUSES, MEAN_POSE, IMPRATIO)
    nuisances = [item for item in known if item.nuisance and item not in ready.wanted and not item.barred(ready.raw)]
    fitted = [item for item in (*ready.wanted, *nuisances) if not isinstance(item, DetectedCause)]
    return Scorer(ready.off.problem, fitted, rules, jobs=jobs, tell=tell)


def confirm(ready: Ready, scorer: Scorer, names: Sequence[str], seed: int, jobs: int, tell: Tell) -> Confirmed:
    """Drop the causes whose gain is not significantly above 0.

    All causes are dropped if they explain little and clear structure remains in the residual: they are then not the
    real causes.
    """
    dropped: dict[str, Interval] = {}

    def explained(names: Sequence[str]) -> tuple[Explanation, SquaredErrors]:
        found = explanation_of(ready.off, scorer, names, jobs, dropped)
        return found, squares_of(found, jobs)

    found, squares = explained(names)
    tell("looking for structure in the residual", PREDICTION_END)
    structure = left_over(ready.off.problem, found.prediction)
    share = explained_share(squares, squares.after, seed)
    clear = any(item.statistic > STRUCTURE.clear * item.limit for item in structure)
    if clear and share is not None and share.value < scorer.rules.explains:
        found, squares = explained(())
    while True:
        shares = {n.name: affected_gain_of(squares, squares.without[n.name], seed) for n in found.fitted}
        doubtful = {name: share for name, share in shares.items() if share.ends[0] <= 0}
        if not doubtful:
            return Confirmed(found, squares, structure, dropped)
        least = min(doubtful, key=lambda name: doubtful[name].value)
        dropped[least] = doubtful[least]
        found, squares = explained(found.chosen)


def wanted_of(
    raw: Problem, causes: Sequence[str] | None, hidden: Mapping[str, str]
) -> tuple[list[Cause], dict[str, str]]:
    """The causes to look for, and the reason for each excluded cause by name."""
    wanted, not_searched = [], {}
    for name in known_causes():
        item = cause(name)
        if causes is not None and name not in causes:
            not_searched[name] = NOT_ASKED
        elif item.in_scene and raw.scene is None:
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
    if raw.has_contact or isinstance(item, (BaselineCause, DetectedCause)):
        return ""
    acts = any(effect.any() for effect in item.effects(raw.thinned, raw.thinned.simulated))
    return "" if acts else "it has no effect without contact"


def not_excited(problem: Problem, causes: Sequence[Cause], rules: Rules) -> dict[str, str]:
    """Reason for each cause whose effect at a material size would stay below the noise in this motion."""
    problem, missing = problem.thinned, {}
    for item in causes:
        if isinstance(item, FittedCause):
            changes = item.effects(problem, problem.simulated)
            energy = max((float(np.sum((change * problem.weight) ** 2)) for change in changes), default=np.inf)
            if energy < rules.visible * rules.material * problem.samples:
                why = "this motion does not excite it: at a material size its effect stays below the noise"
                missing[item.name] = why
    return missing
