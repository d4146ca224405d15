"""Study: the replays of a scene that a diagnosis needs, at and around the nominal values."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.responses import Centre, Response, Responses
from paxisim.diagnose.inside.poses import Poses
from paxisim.diagnose.known import KnownSensor
from paxisim.errors import PaxisimError
from paxisim.scene.parameters import SceneParameter
from paxisim.scene.replays import Replays, Values

SCREEN_STEPS = (-2.0, 2.0)
"""Offsets from its nominal value, in steps, at which each number is replayed before the search."""
GLANCE_STEPS, POSE_STEPS = (1.0,), (-1.0, 1.0)
"""The same before the poses of the episodes are known: for the scene's other numbers, and for the poses."""
REFINE_STEPS = (-0.5, 0.5)
"""Offsets from its fitted value, in steps, after the search; other numbers of its cause keep their fitted values. The
objects' poses are moved by the same steps in the scene with all fitted values."""

BATCH = 4
"""Numbers replayed in one batch: enough to keep the processes busy, few enough to report progress often."""

Tell = Callable[[str, float], None]
_Changes = dict[SceneParameter, dict[float, NDArray[np.float32]]]  # of the simulated stream, at each replayed value


class Study:
    """Replays of a recorded motion in a scene whose numbers change.

    Attributes:
        replays: Runs the simulations.
        parameters: Numbers of the scene by name.
        base: ``(T, pads, 3, rows, cols)`` N, stream simulated at nominal values with the current poses.
        poses: Deviations of the objects' poses from their mean, by episode.
        unstable: Why a number was left out, by name.
    """

    def __init__(
        self, replays: Replays, known: KnownSensor | None = None, causes: Collection[str] | None = None
    ) -> None:
        """Start from the stream that the recording already holds, simulated at nominal values.

        Args:
            replays: Runs the simulations.
            known: Sensor through which every simulated stream is seen; None for the forces themselves.
            causes: Causes that are looked for; None for all. The poses of objects are always replayed, as no grasp
                repeats them.
        """
        assert replays.recording.simulated is not None
        self.replays, self._known = replays, known
        self.parameters = {
            name: item
            for name, item in replays.scene.parameters().items()
            if causes is None or item.group in {*causes, "object_pose", "impratio"}
        }
        self.base: NDArray[np.float32] = self._seen(replays.recording.simulated)
        self.poses: Poses = {}
        self.unstable: dict[str, str] = {}
        self._changes: _Changes = {}
        self._near_poses: tuple[Response, ...] = ()  # effects of the poses in the scene with fitted values
        self._centres: dict[str, tuple[Values, NDArray[np.float32]]] = {}

    @property
    def count(self) -> int:
        """Number of replays of the whole motion before the search."""
        poses = sum(item.by_episode for item in self.parameters.values())
        each = len(GLANCE_STEPS) + len(SCREEN_STEPS)
        return len(POSE_STEPS) * poses + each * (len(self.parameters) - poses)

    def glance(self, tell: Tell) -> None:
        """Replay the motion with each number changed a little, the objects' poses in both directions."""
        poses = {item: POSE_STEPS for item in self.parameters.values() if item.by_episode}
        self._screen(dict.fromkeys(self.parameters.values(), GLANCE_STEPS) | poses, tell)

    def screen(self, tell: Tell) -> None:
        """Replay the motion with each number except poses changed in both directions; replaces earlier replays."""
        others = [item for item in self.parameters.values() if not item.by_episode]
        for item in others:
            self._changes.pop(item, None)
        self._screen(dict.fromkeys(others, SCREEN_STEPS), tell)

    def _screen(self, steps: Mapping[SceneParameter, Sequence[float]], tell: Tell) -> None:
        parameters = list(steps)
        for first in range(0, len(parameters), BATCH):
            some = parameters[first : first + BATCH]
            tell(f"replaying with a different {some[0].name}", first / len(parameters))
            self._changes |= self._replay(
                {item: [item.nominal + by * item.step for by in steps[item]] for item in some}
            )

    def _replay(self, wanted: Mapping[SceneParameter, list[float]], centre: Values | None = None) -> _Changes:
        """Return the changes in replays with one number changed at a time, from the nominal values or from a centre."""
        clipped = {item: {float(np.clip(v, item.low, item.high)) for v in values} for item, values in wanted.items()}
        middle = {item: item.nominal for item in wanted} | dict(centre or {})
        pairs = [(item, v) for item, values in clipped.items() for v in sorted(values - {middle[item]})]
        sets = [self._with_poses({**(centre or {}), item: value}) for item, value in pairs]
        base = self.base if centre is None else self._run(centre)
        changes: _Changes = {}
        for (item, value), force in zip(pairs, self.replays.run_sets(sets), strict=True):
            if isinstance(force, PaxisimError):
                self.unstable[item.name] = f"the replay fails at {item.name} = {value:.4g}: {force}"
            else:
                changes.setdefault(item, {})[value] = self._seen(force) - base
        return changes

    def move(self, poses: Poses) -> None:
        """Adopt new poses of the objects and simulate the base stream again.

        Args:
            poses: Deviations of the objects' poses from their mean, by episode.

        Raises:
            UnsupportedError: The simulation becomes unstable with these poses.
        """
        self.poses = poses
        self.base = self._run({})

    def approach(self, values: Mapping[str, float]) -> None:
        """Replay the motion with other poses of the objects in the scene with fitted values.

        Args:
            values: Fitted values by name, in SI units.

        Raises:
            UnsupportedError: The simulation becomes unstable.
        """
        centre = {self.parameters[name]: value for name, value in values.items()}
        middles = {item: centre.get(item, item.nominal) for item in self._changes if item.by_episode}
        wanted = {item: [middle + by * item.step for by in REFINE_STEPS] for item, middle in middles.items()}
        self._near_poses = tuple(_response(i, own, middles[i]) for i, own in self._replay(wanted, centre).items())

    def refine(self, values: Mapping[str, float]) -> None:
        """Replay with some numbers near their fitted values; replaces the other replays of these numbers.

        Args:
            values: Fitted values by name, in SI units.
        """
        for group in dict.fromkeys(self.parameters[name].group for name in values):
            numbers = [item for item in self.parameters.values() if item.group == group and item.name in values]
            centre = {item: float(np.clip(values[item.name], item.low, item.high)) for item in numbers}
            self._centres[group] = centre, self._run(centre) - self.base
            for item in numbers:
                self._changes.pop(item, None)
            wanted = {item: [value + by * item.step for by in REFINE_STEPS] for item, value in centre.items()}
            self._changes |= self._replay(wanted, centre)

    def responses(self) -> Responses:
        """Return the effects of the numbers."""
        each, middles = [], {item: v for own, _ in self._centres.values() for item, v in own.items()}
        for item in self.parameters.values():
            known = self._changes.get(item)
            if known and item.name not in self.unstable:
                each.append(_response(item, known, middles.get(item, item.nominal)))
        kept = {one.parameter for one in each}
        centres = {
            group: Centre(np.array([v for item, v in own.items() if item in kept]), change)
            for group, (own, change) in self._centres.items()
        }
        failed = frozenset(self.parameters[name].group for name in self.unstable)
        poses = [one for one in self._near_poses or each if one.parameter.by_episode]
        poses = tuple(one for one in poses if one.parameter in kept)  # a pose may have failed since
        episodes, frames = np.unique(self.replays.recording.episode, return_inverse=True)
        simulated = [[self.poses.get(int(n), {}).get(one.parameter, 0.0) for n in episodes] for one in poses]
        simulated = np.reshape(simulated, (len(poses), len(episodes)))[:, frames]
        return Responses(tuple(each), poses, simulated, np.arange(len(self.base)), centres, failed)

    def fitted(self, values: Mapping[str, float]) -> NDArray[np.float32]:
        """``(T, pads, 3, rows, cols)`` N, stream simulated with all fitted values at once.

        Args:
            values: Fitted values by name, in SI units.

        Raises:
            UnsupportedError: The simulation becomes unstable.
        """
        return self._run({self.parameters[n]: v for n, v in values.items()})

    def _run(self, values: Mapping[SceneParameter, float]) -> NDArray[np.float32]:
        return self._seen(self.replays.run_each(self._with_poses(values)))

    def _seen(self, force: NDArray[np.float32]) -> NDArray[np.float32]:
        return force if self._known is None else self._known.seen(force, self.replays.recording)

    def _with_poses(self, values: Mapping[SceneParameter, float]) -> dict[int, dict[SceneParameter, float]]:
        """Return the values for each episode; values of poses are added to the episode's own pose."""
        out = {}
        for number in self.replays.episodes:
            own = dict(self.poses.get(number, {}))
            for item, value in values.items():
                own[item] = value + own.get(item, 0.0)
            out[number] = own
        return out


def _response(item: SceneParameter, changes: Mapping[float, NDArray[np.float32]], middle: float) -> Response:
    at = sorted(changes)
    return Response(item, middle, np.array(at), np.stack([changes[v] for v in at]))
