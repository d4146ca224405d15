"""Pipeline: from a recording to its diagnosis.

The recording is checked, prepared and aligned (`stages.ready_for_search`), searched for causes (`search`), and what was
found is confirmed on held-out samples (`stages.confirmed`) and explained here. With a scene, the same stages alternate
with replays (`inside/rounds.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.kinds import Cause, FittedCause
from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.data.repeats import with_untold
from paxisim.diagnose.diagnosis import Diagnosis
from paxisim.diagnose.explain.advice import advice
from paxisim.diagnose.explain.caveats import at_bounds, caveats, near_misses
from paxisim.diagnose.explain.ceiling import ceiling
from paxisim.diagnose.explain.evidence import evidence
from paxisim.diagnose.explain.explanation import Explanation, Named, reading_without
from paxisim.diagnose.explain.heldout import SquaredErrors, by_episode, figures, gain_of, survives
from paxisim.diagnose.explain.intervals import model_intervals, parameters_of
from paxisim.diagnose.explain.rivals import rivals_of
from paxisim.diagnose.explain.symptoms import symptoms
from paxisim.diagnose.inside.rounds import in_scene
from paxisim.diagnose.known import KnownSensor
from paxisim.diagnose.result import (
    FoundCause,
    FoundPart,
    HeldOut,
    InScene,
    Interval,
    LeftOver,
    Streams,
    Symptoms,
    Verdict,
)
from paxisim.diagnose.rules import STREAMS
from paxisim.diagnose.search import search
from paxisim.diagnose.stages import Confirmed, Ready, Tell, UnrelatedError, confirm, ready_for_search, scorer_of
from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.recording import Recording
from paxisim.scene.scene import Scene

CHECKS = (
    "check that both streams were recorded during the same motion, that their clocks agree, that both are in newtons, "
    "and that pads and episodes are in the same order"
)


def diagnose(
    recording: Recording,
    causes: Sequence[str] | None = None,
    *,
    scene: Scene | None = None,
    sensor: Transform | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[str, float], None] | None = None,
    replays: Path | None = None,
) -> Diagnosis:
    """Diagnose what the simulation gets wrong, why, and how much a correction gains.

    Args:
        recording: Recording with measured and simulated tensors in newtons and several episodes; the simulation replays
            the same motion. It may have covariates, such as `gripper_opening` (m) or joint angles (rad).
        causes: Names of the causes to look for, from `known_causes`; default: all but those of a known sensor.
        scene: Scene driven by the recording's streams. It adds causes inside the scene, such as friction or the
            position of a pad, and the recording then needs no simulated tensor. Replays run in `jobs` processes, so a
            script needs an ``if __name__ == "__main__":`` guard.
        sensor: Model of the sensor known beforehand, such as the `Diagnosis.model` of a recording of the same unit, or
            `paxisim.nominal_operator` of the product. What its layer and magnets do is taken as known: the simulation
            is seen through it, and causes are searched in what it does not explain. Its own causes are not searched
            again unless `causes` has them. What its electronics do, such as a zero offset, may change and is fitted
            anew.
        seed: Random seed of the bootstrap over episodes and of the black box; at least 0.
        jobs: Number of processors, at least 1; it does not affect the result.
        progress: Called with a description of the current stage and the estimated share of the work done, from 0 to 1.
        replays: Cache folder for replays, which a later diagnosis reuses.

    Raises:
        InvalidValueError: The recording cannot be diagnosed: a stream is missing, constant, in another unit or too
            short, or the streams do not overlap; a cause inside the scene is requested without the scene; or the
            given sensor has another layout, or has nothing that could be known beforehand.
        UnknownNameError: There is no such cause, or the scene has no such stream or joint.
        UnsupportedError: The simulation of the scene becomes unstable.
    """
    _check(causes, scene, seed, jobs)
    tell = progress or (lambda stage, share: None)
    known = None if sensor is None else KnownSensor.of(sensor)
    taken: dict[str, str] = {}
    if known is not None and causes is None:
        taken = dict.fromkeys(known.causes, "it is taken as known")
        causes = [name for name in known_causes() if name not in taken]
    if scene is None and known is not None and recording.simulated is not None:
        recording = replace(recording, simulated=known.seen(recording.simulated, recording))
    try:
        if scene is None:
            ready = ready_for_search(recording, causes, None, tell)
            scorer = scorer_of(ready, jobs, tell)
            done = confirm(ready, scorer, search(scorer), seed, jobs, tell)
            found = _explained(ready, done, seed, jobs, tell)
        else:
            inside = in_scene(recording, scene, known, causes, seed, jobs, tell, replays)
            found = _explained(inside.ready, inside.confirmed, seed, jobs, tell, inside.streams)
            found = replace(found, scene=inside.scene, scene_values=inside.values)
    except UnrelatedError as error:
        return _unrelated(error)
    if known is None:
        return found
    model, untestable = known.before(found.model), {**found.not_testable, **taken}
    return replace(found, model=model, known=str(known), not_testable=untestable)


def _explained(
    ready: Ready, done: Confirmed, seed: int, jobs: int, tell: Tell, in_scene: InScene | None = None
) -> Diagnosis:
    """Build the diagnosis of what was found and confirmed."""
    raw, off, found, squares = ready.raw, ready.off, done.found, done.squares
    tell("comparing with a black box", 0.82)
    black, missing = _ceiling(off.judged, raw.simulated, seed, jobs)

    tell("looking for rivals", 0.9)
    named, short = _named(found, squares, seed, jobs)
    doubts = (*ready.doubts, *done.structure, *short.values())
    untestable = {**ready.not_searched, **_not_excited(found, ready.wanted)}
    untestable = {n: why for n, why in untestable.items() if n not in {item.name for item in named}}
    shift = float(ready.recording.metadata.get("clocks_aligned_by", 0.0))
    recording, replayed = ready.recording, "replay" in ready.recording.metadata
    warnings = (*ready.warnings, *caveats(found, done.dropped, recording.pads, replayed))
    return Diagnosis(
        verdict=_verdict(named, bool(doubts or at_bounds(found)), len(raw.episodes) == 1, bool(shift)),
        clock_shift=shift,
        causes=named,
        heldout=figures(squares, seed, black, missing),
        confidence=_confidence(found, named, seed),
        not_testable=untestable,
        streams=_streams(recording, found, in_scene),
        symptoms=symptoms(
            off.judged, raw.simulated, found.prediction, recording.pads, warnings=warnings, left_over=doubts
        ),
        advice=advice(
            [(item.name, item.rivals) for item in named],
            {n: why for n, why in untestable.items() if not cause(n).barred(raw)}
            | dict.fromkeys(short, "its gain falls short of materiality"),
            {name: cause(name).excites for name in known_causes()},
            unexplained=bool(ready.doubts or done.structure),
            episodes=len(raw.episodes),
        ),
        model=found.model,
        intervals=model_intervals(found, {item.name: item.parameters for item in named}),
    )


def _unrelated(error: UnrelatedError) -> Diagnosis:
    """Build the diagnosis of streams that do not show the same motion."""
    measured, simulated = error.recording.measured, error.recording.simulated
    assert measured is not None
    assert simulated is not None
    measured = measured.astype(np.float64)
    share = float(np.sqrt(np.sum((measured - simulated) ** 2) / max(float(np.sum(measured**2)), 1e-300)))
    return Diagnosis(
        verdict="unrelated",
        causes=(),
        heldout=HeldOut(share, share, 0.0, "", None, ()),
        confidence={},
        not_testable={},
        symptoms=Symptoms(error.warnings, (LeftOver(error.match.why, error.match.alike, STREAMS.correlation),)),
        advice=(CHECKS,),
    )


def _check(causes: Sequence[str] | None, scene: Scene | None, seed: int, jobs: int) -> None:
    if not isinstance(jobs, int) or jobs < 1:
        raise InvalidValueError(f"jobs must be a whole number of at least 1, got {jobs!r}")
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InvalidValueError(f"seed must be a whole number of at least 0, got {seed!r}")
    if isinstance(causes, str):
        raise InvalidValueError(f"causes must be a sequence of names, got the string {causes!r}")
    for name in causes or ():
        if cause(name).in_scene and scene is None:
            raise InvalidValueError(f"{name} is a cause inside the scene: give diagnose the scene, too")
    if scene is not None and not isinstance(scene, Scene):
        raise InvalidValueError(f"scene must be a paxisim.Scene, got {type(scene).__name__}: Scene.load reads a file")


def _named(
    found: Explanation, squares: SquaredErrors, seed: int, jobs: int
) -> tuple[tuple[FoundCause, ...], dict[str, LeftOver]]:
    """The named causes, largest gain first, and near misses by name."""
    gains = {name: gain_of(squares, without, seed) for name, without in squares.without.items()}
    scorer = found.scorer
    remembering = [name for name, item in scorer.causes.items() if isinstance(item, FittedCause) and item.remembers]
    rivals = with_untold(found.problem, rivals_of(found), remembering)
    parameters = parameters_of(found)
    causes = [
        FoundCause(
            named.name,
            parameters[named.name],
            gains[named.name],
            rivals[named.name],
            evidence(found.problem, named, squares.without[named.name] - squares.after, gains[named.name]),
            _parts(found, squares, named, gains[named.name], seed, jobs),
        )
        for named in found.named
    ]
    rivalling = {name for names in rivals.values() for name in names}
    shares = scorer.near_misses(found.chosen) if found.fitted else {}
    short = near_misses({n: s for n, s in shares.items() if n not in rivalling}, scorer.rules.near_miss)
    return tuple(sorted(causes, key=lambda c: -c.gain.value)), short


def _parts(
    found: Explanation, squares: SquaredErrors, named: Named, whole: Interval, seed: int, jobs: int
) -> tuple[FoundPart, ...]:
    """The parts of a cause that pass the test of a cause, largest gain first; a single part has that of the whole."""
    if not named.parts:
        return ()
    weak = {e.name for e in found.scorer.evidence_of_parts(found.chosen, named.name) if not e.kept}
    gains = dict.fromkeys(named.parts, whole)
    problem = found.off.judged
    for part in named.parts if len(named.parts) > 1 else ():
        without = by_episode(problem, problem.measured - reading_without(found, named, part, jobs))
        gains[part] = gain_of(squares, without, seed)
    parts = [FoundPart(part.name, part.words, part.parameters, gain) for part, gain in gains.items()]
    parts = [part for part in parts if part.name not in weak] or parts
    return tuple(sorted(parts, key=lambda part: -part.gain.value))


def _verdict(named: Sequence[FoundCause], doubts: bool, one: bool, shifted: bool) -> Verdict:
    if doubts:
        return "partly_explained" if named else "unexplained"
    if not named:
        return "clocks_differ" if shifted else "no_discrepancy"
    return "ambiguous" if one or any(item.rivals for item in named) else "explained"


def _ceiling(problem: Problem, simulated: FloatArray, seed: int, jobs: int) -> tuple[FloatArray | None, str]:
    try:
        return ceiling(problem, simulated, seed, jobs), ""
    except MissingExtraError as error:
        return None, f"{error}."


def _confidence(found: Explanation, causes: Sequence[FoundCause], seed: int) -> dict[str, float]:
    """How often a cause is kept when held-out episodes are resampled, divided among the cause and its rivals.

    A parameter at its bound counts as one more rival, because the true value may lie beyond.
    """
    bounded = at_bounds(found)
    kept = dict.fromkeys((named.name for named in found.named), 1.0)
    for named in found.named:
        if named.evidence is not None:
            gain = found.folds.independent(named.evidence.gain)
            kept[named.name] = survives(gain, named.evidence.needed, seed)
    return {c.name: kept[c.name] / (1 + len(c.rivals) + (c.name in bounded)) for c in causes}


def _not_excited(found: Explanation, wanted: Sequence[Cause]) -> dict[str, str]:
    """Reason for each cause whose effect at a material size would stay below the noise in this motion."""
    problem, rules, missing = found.problem.thinned, found.scorer.rules, {}
    for item in wanted:
        if not isinstance(item, FittedCause):
            continue
        changes = item.effects(problem, problem.simulated)
        energy = max((float(np.sum((change * problem.weight) ** 2)) for change in changes), default=np.inf)
        if energy < rules.visible * rules.material * problem.samples:
            missing[item.name] = "this motion does not excite it: at a material size its effect stays below the noise"
    return missing


def _streams(recording: Recording, found: Explanation, in_scene: InScene | None) -> Streams:
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
        step=problem.noise.step,
        alive=problem.alive,
        calibrated=problem.calibrated,
        in_scene=in_scene,
    )
