"""Run: from a recording to its diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from paxisim.augment.transform import Transform
from paxisim.diagnose.advice import advice
from paxisim.diagnose.cause import Cause
from paxisim.diagnose.ceiling import ceiling
from paxisim.diagnose.diagnosis import Diagnosis, FoundCause, FoundPart, Interval, LeftOver, Verdict
from paxisim.diagnose.explanation import Explanation, Named
from paxisim.diagnose.folds import effects
from paxisim.diagnose.heldout import SquaredErrors, figures, gains_of, part_gains, survives
from paxisim.diagnose.inside.rounds import in_scene
from paxisim.diagnose.intervals import model_intervals, parameters_of
from paxisim.diagnose.known import KnownSensor
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.repeats import with_untold
from paxisim.diagnose.report.caveats import at_bounds, caveats, near_misses
from paxisim.diagnose.report.evidence import evidence
from paxisim.diagnose.report.streams import InScene, Streams
from paxisim.diagnose.report.symptoms import symptoms
from paxisim.diagnose.rivals import rivals_of
from paxisim.diagnose.searched import Searched, searched
from paxisim.diagnose.vocabulary import cause, known_causes
from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.recording import Recording
from paxisim.scene.scene import Scene


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
    if scene is None:
        if known is not None and recording.simulated is not None:
            recording = replace(recording, simulated=known.seen(recording.simulated, recording))
        found = searched(recording, causes, seed, jobs, tell)
        told = found if isinstance(found, Diagnosis) else _told(found, seed, jobs, tell)
    else:
        inside = in_scene(recording, scene, known, causes, seed, jobs, tell, replays)
        if isinstance(inside, Diagnosis):
            return inside
        told = _told(inside.searched, seed, jobs, tell, inside.streams)
        told = replace(told, scene=inside.scene, scene_values=inside.values)
    if known is None:
        return told
    return replace(told, model=known.before(told.model), known=str(known), not_testable={**told.not_testable, **taken})


def _told(
    done: Searched, seed: int, jobs: int, tell: Callable[[str, float], None], in_scene: InScene | None = None
) -> Diagnosis:
    """Build the diagnosis from the result of the search."""
    raw, off, it = done.raw, done.off, done.it
    found, squares = it.found, it.squares
    tell("comparing with a black box", 0.82)
    black, missing = _ceiling(off.judged, raw.simulated, seed, jobs)

    tell("looking for rivals", 0.9)
    named, short = _named(found, squares, seed, jobs)
    doubts = (*done.unsettled, *it.structure, *short.values())
    untestable = {**done.not_searched, **_not_excited(found, done.wanted)}
    untestable = {n: why for n, why in untestable.items() if n not in {item.name for item in named}}
    shift = float(done.recording.metadata.get("clocks_aligned_by", 0.0))
    warnings = (*done.warnings, *caveats(found, it.dropped, done.recording.pads, "replay" in done.recording.metadata))
    return Diagnosis(
        verdict=_verdict(named, bool(doubts or at_bounds(found)), len(raw.episodes) == 1, bool(shift)),
        clock_shift=shift,
        causes=named,
        heldout=figures(squares, seed, black, missing),
        confidence=_confidence(found, named, seed),
        not_testable=untestable,
        streams=_streams(done.recording, found, in_scene),
        symptoms=symptoms(
            off.judged, raw.simulated, found.prediction, done.recording.pads, warnings=warnings, left_over=doubts
        ),
        advice=advice(
            [(item.name, item.rivals) for item in named],
            {n: why for n, why in untestable.items() if not cause(n).barred(raw)}
            | dict.fromkeys(short, "its gain falls short of materiality"),
            {name: cause(name).excites for name in known_causes()},
            unexplained=bool(done.unsettled or it.structure),
            episodes=len(raw.episodes),
        ),
        model=found.model,
        intervals=model_intervals(found, {item.name: item.parameters for item in named}),
    )


def _check(causes: Sequence[str] | None, scene: Scene | None, seed: int, jobs: int) -> None:
    if not isinstance(jobs, int) or jobs < 1:
        raise InvalidValueError(f"jobs must be a whole number of at least 1, got {jobs!r}")
    if not isinstance(seed, (int, np.integer)) or seed < 0:
        raise InvalidValueError(f"seed must be a whole number of at least 0, got {seed!r}")
    if isinstance(causes, str):
        raise InvalidValueError(f"causes must be a sequence of names, got the string {causes!r}")
    for name in causes or ():
        if cause(name).change is not None and scene is None:
            raise InvalidValueError(f"{name} is a cause inside the scene: give diagnose the scene, too")
    if scene is not None and not isinstance(scene, Scene):
        raise InvalidValueError(f"scene must be a paxisim.Scene, got {type(scene).__name__}: Scene.load reads a file")


def _named(
    found: Explanation, squares: SquaredErrors, seed: int, jobs: int
) -> tuple[tuple[FoundCause, ...], dict[str, LeftOver]]:
    """The named causes, largest gain first, and near misses by name."""
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
            _parts(found, squares, named, gains[named.name], seed, jobs),
        )
        for named in found.named
    ]
    rivalling = {name for names in rivals.values() for name in names}
    shares = search.near_misses(found.chosen) if found.fitted else {}
    short = near_misses({n: s for n, s in shares.items() if n not in rivalling}, search.rules.near_miss)
    return tuple(sorted(causes, key=lambda c: -c.gain.value)), short


def _parts(
    found: Explanation, squares: SquaredErrors, named: Named, whole: Interval, seed: int, jobs: int
) -> tuple[FoundPart, ...]:
    """The parts of a cause that pass the test of a cause, largest gain first; a single part has that of the whole."""
    if not named.cause.parts:
        return ()
    weak = {e.name for e in found.search.evidence_of_parts(found.chosen, named.name) if not e.kept}
    gains = dict.fromkeys(named.cause.parts, whole) | part_gains(found, squares, named, seed, jobs)
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
    problem, rules, missing = found.problem.thinned, found.search.rules, {}
    for item in wanted:
        if item.read is not None or item.local is not None or item.course is not None:
            continue
        changes = effects(problem, item, problem.simulated)
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
        step=problem.step,
        alive=problem.alive,
        calibrated=problem.calibrated,
        in_scene=in_scene,
    )
