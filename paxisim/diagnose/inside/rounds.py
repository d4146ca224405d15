"""Rounds: replays and searches in turn, by which causes inside a scene are found beside those of the sensor.

1. The pose of the object in each episode is fitted and taken out (`poses.py`), from replays with other poses.
2. Each other number of the scene is replayed at a few values around its nominal one (`study.py`).
3. The search sees what the numbers do as causes like any other (`diagnose/causes/scene.py`).
4. For the causes that it found, replays near their fitted values take the place of the first ones, the poses are fitted
   again, now as the sensor reads them, and the search is repeated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.causes.scene import MEAN_POSE
from paxisim.diagnose.diagnosis import Diagnosis
from paxisim.diagnose.fitting import Fit, Fitter
from paxisim.diagnose.inside.poses import Poses, fitted_poses
from paxisim.diagnose.inside.responses import SHOWN
from paxisim.diagnose.inside.study import Study
from paxisim.diagnose.model import Model
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.report.streams import InScene
from paxisim.diagnose.searched import Begun, Searched, begin, search_of, searched
from paxisim.recording import Recording
from paxisim.scene.changed import changed
from paxisim.scene.parameters import SceneParameter
from paxisim.scene.replays import Replays
from paxisim.scene.scene import Scene

PLACINGS = 2  # times that poses are fitted before anything else
PLACED, SCREENED, FIRST = 0.1, 0.35, 0.6  # of the work, when the poses, the replays and the first search are done

Tell = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class FoundInScene:
    """What the rounds lead to.

    Attributes:
        searched: The last search.
        scene: The scene with the values that were found.
        values: By name, the numbers that were fitted, in SI units.
        streams: What it simulates.
    """

    searched: Searched
    scene: Scene
    values: Mapping[str, float]
    streams: InScene


def in_scene(
    recording: Recording,
    scene: Scene,
    causes: Sequence[str] | None,
    seed: int,
    jobs: int,
    tell: Tell,
    folder: Path | None,
) -> FoundInScene | Diagnosis:
    """See `paxisim.diagnose`.

    Returns:
        What was found, or a diagnosis that says that the streams are not of one motion.
    """
    tell("replaying the motion", 0.0)
    replay = scene.prepare(recording)
    episodes = [replay.run(number) for number in replay.episodes]
    recording = replay.paired(episodes)
    closings = {episode.number: episode.closing for episode in episodes}
    with Replays(scene, recording, closings, jobs=jobs, folder=folder) as replays:
        study = Study(replays)
        study.screen_poses(_part(tell, 0.0, PLACED))
        for _ in range(PLACINGS):
            begun = begin(_simulated(recording, study), causes, study.responses(), tell)
            if isinstance(begun, Diagnosis):
                return begun
            study.move(_poses(begun, study, begun.off.problem.thinned.at_compared))
        study.screen(_part(tell, PLACED, SCREENED))
        begun = begin(_simulated(recording, study), causes, study.responses(), tell)
        if isinstance(begun, Diagnosis):
            return begun
        first = search_of(begun.off, begun.wanted, jobs, _part(tell, SCREENED, FIRST))
        fit = first.fit(first.run())
        values = _values(fit, begun.off.problem, study)
        study.move(_poses(begun, study, _read_by(first.fitter, fit)))
        study.refine(values)
        last = _part(tell, FIRST, 1.0)
        found = searched(_simulated(recording, study), causes, study.responses(), seed, jobs, last)
        return found if isinstance(found, Diagnosis) else _result(found, study, scene)


def _simulated(recording: Recording, study: Study) -> Recording:
    return replace(recording, simulated=study.base)


def _part(tell: Tell, start: float, end: float) -> Tell:
    """The shares of one of the searches, the rest of the work being what it is after the last."""
    return lambda stage, share: tell(stage, start + (end - start) * share)


def _values(fit: Fit, problem: Problem, study: Study) -> dict[str, float]:
    """The scene's numbers that were fitted, in SI units, without what poses have in common by chance."""
    shown = {
        number.name: float(value)
        for cause in fit.causes
        if cause.change is not None and cause is not MEAN_POSE
        for number, value in zip(cause.parameters(problem), fit.whole.values[cause.name], strict=True)
    }
    return {name: value / SHOWN[study.parameters[name].unit][1] for name, value in shown.items()}


def _poses(begun: Begun, study: Study, predict: Callable[[FloatArray], FloatArray]) -> Poses:
    problem = begun.off.problem
    assert problem.scene is not None
    episode = study.replays.recording.episode[problem.scene.rows]
    return fitted_poses(problem, predict, episode, study.poses)


def _read_by(fitter: Fitter, fit: Fit) -> Callable[[FloatArray], FloatArray]:
    """What the model that was found makes of forces that are simulated in the thinned frames."""
    thin, rows = fitter.problem, fitter.rows(fit.causes, fit.shapes)

    def read(simulated: FloatArray) -> FloatArray:
        own = Model(replace(thin, simulated=simulated), fit.causes, rows)
        return own.run(fit.whole.values, fit.whole.zero)

    return read


def _matters(item: SceneParameter, value: float, named: Sequence[str]) -> bool:
    """Whether a number is of a cause that is named, or a setting of the solver that is far from the scene's."""
    return item.group in named or (item.group == "impratio" and abs(value - item.nominal) > item.material)


def _result(found: Searched, study: Study, scene: Scene) -> FoundInScene:
    fitted = _values(found.it.found.fit, found.off.problem, study)
    groups = [named.name for named in found.it.found.named if named.cause.change is not None]
    values = {name: v for name, v in fitted.items() if _matters(study.parameters[name], v, groups)}
    assert found.raw.scene is not None
    rows = found.raw.scene.rows

    def simulated(names: Sequence[str]) -> NDArray[np.float32]:
        return study.fitted({name: values[name] for name in names})[rows]

    without = {group: simulated([name for name in values if study.parameters[name].group != group]) for group in groups}
    streams = InScene(simulated(list(values)), without, dict(study.parameters), values)
    warned = tuple(f"{name} was left out: {why}" for name, why in study.unstable.items())
    extended = changed(scene, {study.parameters[name]: value for name, value in values.items()})
    return FoundInScene(replace(found, warnings=(*found.warnings, *warned)), extended, values, streams)
