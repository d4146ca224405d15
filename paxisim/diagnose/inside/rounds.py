"""Rounds: alternate replays and searches to find causes inside a scene together with those of the sensor.

1. Fit the pose of the object in each episode together with all numbers of the scene (`poses.py`), from replays in which
   each number is changed a little.
2. Replay each number at a few values around its nominal value (`study.py`).
3. Search. The effects of the numbers are candidate causes like any other (`diagnose/causes/scene.py`). What the poses
   still explain of a residual is removed from it (`deviations.py`).
4. Replace the replays of the causes found, and of their rivals, by replays near their fitted values, fit the poses
   again, now through the sensor model found, and repeat the search.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.causes.scene import MEAN_POSE
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.data.responses import SHOWN
from paxisim.diagnose.inside.poses import Poses, fitted_poses
from paxisim.diagnose.inside.study import Study
from paxisim.diagnose.known import KnownSensor
from paxisim.diagnose.result import InScene
from paxisim.diagnose.scorer.fitting import Fit, Fitter
from paxisim.diagnose.scorer.model import Model
from paxisim.diagnose.scorer.scorer import Scorer
from paxisim.diagnose.search import rivals_in_place, search
from paxisim.diagnose.stages import Confirmed, Ready, Tell, confirm, ready_for_search, scorer_of
from paxisim.recording import Recording
from paxisim.scene.changed import changed
from paxisim.scene.replays import Replays
from paxisim.scene.scene import Scene

POSE_FITS = 2  # fits of the poses before anything else
MAX_REFINEMENTS = 3  # most replays near the fitted values, each followed by a fit
POSES_END, REPLAYS_END, SEARCH_END = 0.1, 0.35, 0.6  # progress after the poses, the replays and the first search


@dataclass(frozen=True, eq=False)
class FoundInScene:
    """Result of the rounds.

    Attributes:
        ready: The recording as it was searched last.
        confirmed: What that search found.
        scene: The scene with the fitted values.
        values: Fitted numbers by name, in SI units.
        streams: Streams simulated in that scene.
    """

    ready: Ready
    confirmed: Confirmed
    scene: Scene
    values: Mapping[str, float]
    streams: InScene


def in_scene(
    recording: Recording,
    scene: Scene,
    known: KnownSensor | None,
    causes: Sequence[str] | None,
    seed: int,
    jobs: int,
    tell: Tell,
    folder: Path | None,
) -> FoundInScene:
    """See `paxisim.diagnose`.

    Raises:
        UnrelatedError: The streams do not show the same motion.
    """
    tell("replaying the motion", 0.0)
    replay = scene.prepare(recording)
    scene = replay.scene
    started = time.monotonic()
    episodes = [replay.run(number) for number in replay.episodes]
    seconds = time.monotonic() - started
    recording = replay.paired(episodes)
    closings = {episode.number: episode.closings for episode in episodes}
    with Replays(scene, recording, closings, jobs=jobs, folder=folder) as replays:
        study = Study(replays, known, causes)
        cost = f"{study.count} replays in all, about {_in_words(study.count * seconds / jobs)}"
        study.glance(_part(tell, 0.0, POSES_END, cost))
        for _ in range(POSE_FITS):
            ready = ready_for_search(_simulated(recording, study), causes, study.responses(), tell)
            study.move(_poses(ready.off.problem, study, ready.off.problem.thinned.at_compared))
        study.screen(_part(tell, POSES_END, REPLAYS_END, cost))
        ready = ready_for_search(_simulated(recording, study), causes, study.responses(), tell)
        scorer = scorer_of(ready, jobs, _part(tell, REPLAYS_END, SEARCH_END))
        names = search(scorer)
        sets, replayed, last = [*_rivals(scorer, names), names], {}, _part(tell, SEARCH_END, 1.0)
        for _ in range(MAX_REFINEMENTS):
            *beside, values = [_values(scorer.fit(own), scorer.problem, study) for own in sets]
            every = {name: value for own in (*beside, values) for name, value in own.items()}
            if _near(every, replayed, study):
                break
            tell("replaying near the fitted values", SEARCH_END)
            study.approach(values)
            study.move(_poses_beside(scorer.fit(sets[-1]), values, scorer, study))
            study.refine(every)
            replayed, still = every, _part(tell, SEARCH_END, SEARCH_END)
            ready = ready_for_search(_simulated(recording, study), causes, study.responses(), still)
            scorer = scorer_of(ready, jobs, last)
            sets = [tuple(name for name in own if name in scorer.causes) for own in sets]  # a replay may have failed
        return _result(ready, confirm(ready, scorer, search(scorer), seed, jobs, last), study, scene)


def _in_words(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} minutes"


def _simulated(recording: Recording, study: Study) -> Recording:
    assert recording.simulated is not None  # where the replay was in doubt, it is unknown
    return replace(recording, simulated=np.where(np.isnan(recording.simulated), np.float32(np.nan), study.base))


def _part(tell: Tell, start: float, end: float, more: str = "") -> Tell:
    """Return a progress callback for one part of the work, which runs from `start` to `end` of the whole."""
    after = f" ({more})" if more else ""
    return lambda stage, share: tell(f"{stage}{after}", start + (end - start) * share)


def _values(fit: Fit, problem: Problem, study: Study) -> dict[str, float]:
    """Return the fitted numbers of the scene in SI units, without the chance mean of the poses."""
    shown = {
        number.name: float(value)
        for cause in fit.causes
        if cause.in_scene and cause is not MEAN_POSE
        for number, value in zip(cause.parameters(problem), fit.whole.values[cause.name], strict=True)
    }
    return {name: value / SHOWN[study.parameters[name].unit][1] for name, value in shown.items()}


def _rivals(scorer: Scorer, names: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Return the sets with a rival in place of one of the causes found.

    Rivals are replayed near their fitted values, too. Otherwise the coarse interpolation of their effects would speak
    against them in the last search.
    """
    return [
        (*(n for n in names if n != name), own)
        for name in scorer.shown(names)
        for own in rivals_in_place(scorer, names, name)
    ]


def _near(values: Mapping[str, float], replayed: Mapping[str, float], study: Study) -> bool:
    """Whether all fitted values are near enough to those replayed for a linear interpolation."""
    known = values.keys() <= replayed.keys()
    return known and all(abs(v - replayed[name]) <= study.parameters[name].step for name, v in values.items())


def _poses_beside(fit: Fit, values: Mapping[str, float], scorer: Scorer, study: Study) -> Poses:
    """Return the poses fitted in the scene with its fitted values, and through the sensor model found."""
    assert scorer.problem.scene is not None
    rows = scorer.problem.scene.rows
    problem = replace(
        scorer.problem, simulated=study.fitted(values)[rows].astype(np.float64), scene=study.responses().select(rows)
    )
    sensor = [item for item in fit.causes if not item.in_scene]
    fitter = Fitter(problem, scorer.folds)
    compared = fitter.rows(sensor, fit.shapes)

    def read(simulated: FloatArray) -> FloatArray:
        own = Model(replace(problem.thinned, simulated=simulated), sensor, compared)
        return own.run(fit.whole.values, fit.whole.zero)

    return _poses(problem, study, read)


def _poses(problem: Problem, study: Study, predict: Callable[[FloatArray], FloatArray]) -> Poses:
    assert problem.scene is not None
    episode = study.replays.recording.episode[problem.scene.rows]
    return fitted_poses(problem, predict, episode, study.poses)


def _result(ready: Ready, done: Confirmed, study: Study, scene: Scene) -> FoundInScene:
    fit = done.found.fit
    groups = [named.name for named in done.found.named if named.cause.in_scene]
    nuisances = {cause.name for cause in fit.causes if cause.nuisance}  # kept if they differ from the scene's values
    values = {}
    for name, value in _values(fit, ready.off.problem, study).items():
        item = study.parameters[name]
        if item.group in groups or (item.group in nuisances and abs(value - item.nominal) > item.material):
            values[name] = value
    assert ready.raw.scene is not None
    rows = ready.raw.scene.rows

    def simulated(names: Sequence[str]) -> NDArray[np.float32]:
        return study.fitted({name: values[name] for name in names})[rows]

    without = {group: simulated([name for name in values if study.parameters[name].group != group]) for group in groups}
    streams = InScene(simulated(list(values)), without, dict(study.parameters), values)
    warned = tuple(f"{name} was left out: {why}" for name, why in study.unstable.items())
    extended = changed(scene, {study.parameters[name]: value for name, value in values.items()})
    return FoundInScene(replace(ready, warnings=(*ready.warnings, *warned)), done, extended, values, streams)
