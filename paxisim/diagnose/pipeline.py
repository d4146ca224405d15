"""Pipeline: from a recording to its diagnosis.

The recording is checked, aligned and prepared (`stages.ready_for_search`), searched for causes (`search`), and what was
found is confirmed on held-out samples (`stages.confirm`) and explained here. With a scene, the same stages alternate
with replays (`inside/rounds.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.diagnosis import Diagnosis
from paxisim.diagnose.explain.advice import advice
from paxisim.diagnose.explain.ceiling import ceiling
from paxisim.diagnose.explain.evidence import at_bounds, caveats, confidence, found_causes, near_misses
from paxisim.diagnose.explain.heldout import figures
from paxisim.diagnose.explain.intervals import model_intervals
from paxisim.diagnose.explain.symptoms import symptoms
from paxisim.diagnose.inside.rounds import in_scene
from paxisim.diagnose.known import KnownSensor
from paxisim.diagnose.result import FoundCause, HeldOut, InScene, LeftOver, Streams, Symptoms, Verdict
from paxisim.diagnose.rules import STREAMS
from paxisim.diagnose.search import search
from paxisim.diagnose.stages import (
    Confirmed,
    Ready,
    Tell,
    UnrelatedError,
    confirm,
    not_excited,
    ready_for_search,
    scorer_of,
)
from paxisim.errors import InvalidValueError
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
    try:
        if scene is None:
            if known is not None and recording.simulated is not None:
                recording = replace(recording, simulated=known.seen(recording.simulated, recording))
            ready = ready_for_search(recording, causes, None, tell)
            scorer = scorer_of(ready, jobs, tell)
            chosen = search(scorer)
            confirmed = confirm(ready, scorer, chosen, seed, jobs, tell)
            found = _explained(ready, confirmed, seed, jobs, tell)
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


def _explained(
    ready: Ready, confirmed: Confirmed, seed: int, jobs: int, tell: Tell, in_scene: InScene | None = None
) -> Diagnosis:
    """Build the diagnosis of what was found and confirmed."""
    recording, raw, judged = ready.recording, ready.raw, ready.off.judged
    found, squares = confirmed.found, confirmed.squares
    tell("comparing with a black box", 0.82)
    black_box, note = ceiling(judged, raw.simulated, seed, jobs)

    tell("looking for rivals", 0.9)
    causes = found_causes(found, squares, seed, jobs)
    short, bounded = near_misses(found, causes), at_bounds(found)
    doubts = (*ready.doubts, *confirmed.structure, *short.values())
    why = [f"{item.what[0].upper()}{item.what[1:]}" for item in ready.doubts]
    why += ["The residual has structure"] if confirmed.structure else []
    why += [words.partition(":")[0] for words in (*(item.what for item in short.values()), *bounded.values())]
    untestable = {**ready.not_searched, **not_excited(found.problem, ready.wanted, found.scorer.rules)}
    untestable = {n: why for n, why in untestable.items() if n not in {item.name for item in causes}}
    shift = float(recording.metadata.get("clocks_aligned_by", 0.0))
    warnings = caveats(found, confirmed.dropped, recording.pads, "replay" in recording.metadata)
    return Diagnosis(
        verdict=_verdict(causes, bool(doubts or bounded), len(raw.episodes) == 1, bool(shift)),
        clock_shift=shift,
        causes=causes,
        heldout=figures(squares, seed, black_box, note),
        confidence=confidence(found, causes, seed),
        not_testable=untestable,
        streams=Streams(
            time=recording.time,
            episode=recording.episode,
            measured=recording.measured,  # type: ignore[arg-type]
            simulated=recording.simulated,  # type: ignore[arg-type]
            extended=judged.read(found.heldout).astype(np.float32),
            covariates=judged.covariates,
            pads=recording.pads,
            layout=recording.layout,
            step=judged.noise.step,
            alive=judged.alive,
            calibrated=judged.calibrated,
            in_scene=in_scene,
        ),
        symptoms=replace(
            symptoms(judged, raw.simulated, found.prediction, recording.pads),
            warnings=(*ready.warnings, *warnings),
            left_over=doubts,
            reasons=tuple(f"{words}." for words in why),
        ),
        advice=advice(
            [(item.name, item.rivals) for item in causes],
            {n: why for n, why in untestable.items() if not cause(n).barred(raw)}
            | dict.fromkeys(short, "its gain falls short of materiality"),
            {name: cause(name).excites for name in known_causes()},
            unexplained=bool(ready.doubts or confirmed.structure),
            episodes=len(raw.episodes),
        ),
        model=found.model,
        intervals=model_intervals(found, {item.name: item.parameters for item in causes}),
    )


def _verdict(causes: Sequence[FoundCause], doubts: bool, one: bool, shifted: bool) -> Verdict:
    if doubts:
        return "partly_explained" if causes else "unexplained"
    if not causes:
        return "clocks_differ" if shifted else "no_discrepancy"
    return "ambiguous" if one or any(item.rivals for item in causes) else "explained"


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
