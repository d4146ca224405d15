"""Study: the replays of a scene that a diagnosis needs, at its nominal values and around them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.inside.poses import Poses
from paxisim.diagnose.inside.responses import Response, Responses
from paxisim.errors import PaxisimError
from paxisim.scene.parameters import SceneParameter
from paxisim.scene.replays import Replays

SCREENED = (-2.0, 2.0)
"""Steps from its nominal value at which each number is replayed before the search."""
POSES = (-1.0, 1.0)
"""The same of the objects' poses."""
NEAR = (-0.5, 0.0, 0.5)
"""Steps from its fitted value, after it."""

TOGETHER = 4
"""Numbers that are replayed at once: as many as keep the processes busy, and few enough to tell how far it is."""

Tell = Callable[[str, float], None]


class Study:
    """What a scene simulates of a recorded motion when its numbers change.

    Attributes:
        replays: What simulates.
        parameters: The scene's numbers by name.
        base: ``(T, pads, 3, rows, cols)`` N, the scene as it is, with the poses that are known.
        poses: By episode, by how much the objects' poses differ from their mean.
        unstable: By name, why a number was not studied.
    """

    def __init__(self, replays: Replays) -> None:
        """Nothing is simulated yet but the scene as it is, which the recording has."""
        assert replays.recording.simulated is not None
        self.replays, self.parameters = replays, replays.scene.parameters()
        self.base: NDArray[np.float32] = replays.recording.simulated
        self.poses: Poses = {}
        self.unstable: dict[str, str] = {}
        self._changes: dict[SceneParameter, dict[float, NDArray[np.float32]]] = {}

    def screen_poses(self, tell: Tell) -> None:
        """Replay the motion with the objects moved to either side."""
        self._screen([item for item in self.parameters.values() if item.group == "object_pose"], tell)

    def screen(self, tell: Tell) -> None:
        """Replay it with each other number moved to either side."""
        self._screen([item for item in self.parameters.values() if item.group != "object_pose"], tell)

    def _screen(self, parameters: Sequence[SceneParameter], tell: Tell) -> None:
        for first in range(0, len(parameters), TOGETHER):
            some = parameters[first : first + TOGETHER]
            tell(f"replaying with another {some[0].name}", first / len(parameters))
            self._replay({item: [item.nominal + steps * item.step for steps in _screened(item)] for item in some})

    def _replay(self, wanted: Mapping[SceneParameter, list[float]]) -> None:
        """Add replays at some values of numbers, one number at a time."""
        clipped = {item: {float(np.clip(v, item.low, item.high)) for v in values} for item, values in wanted.items()}
        pairs = [(item, value) for item, values in clipped.items() for value in sorted(values - {item.nominal})]
        made = self.replays.run_sets([self._with_poses({item: value}) for item, value in pairs])
        for (item, value), force in zip(pairs, made, strict=True):
            if isinstance(force, PaxisimError):
                self.unstable[item.name] = f"the replay fails at {item.name} = {value:.4g}: {force}"
            else:
                self._changes.setdefault(item, {})[value] = force - self.base

    def move(self, poses: Poses) -> None:
        """Take up poses of the objects.

        Raises:
            UnsupportedError: The simulation becomes unstable with them.
        """
        self.poses = poses
        self.base = self.replays.run_each(self._with_poses({}))

    def refine(self, values: Mapping[str, float]) -> None:
        """Replay with some numbers near the values that were fitted, in the place of their other replays.

        Args:
            values: By name.
        """
        wanted = {}
        for name, value in values.items():
            item = self.parameters[name]
            around = [value + steps * item.step for steps in NEAR]
            ends = min(*around, item.nominal), max(*around, item.nominal)
            beyond = [item.nominal + steps * item.step for steps in (SCREENED[0], SCREENED[-1])]
            wanted[item] = [*around, *(v for v in beyond if not ends[0] <= v <= ends[1])]
            self._changes.pop(item, None)
        self._replay(wanted)

    def responses(self) -> Responses:
        """What the numbers do."""
        each = []
        for item in self.parameters.values():
            known = self._changes.get(item)
            if known and item.name not in self.unstable:
                values = sorted(known)
                each.append(Response(item, np.array(values), np.stack([known[v] for v in values])))
        failed = frozenset(self.parameters[name].group for name in self.unstable)
        return Responses(tuple(each), np.arange(len(self.base)), failed)

    def fitted(self, values: Mapping[str, float]) -> NDArray[np.float32]:
        """``(T, pads, 3, rows, cols)`` N, the scene with the fitted values, all at once.

        Raises:
            UnsupportedError: The simulation becomes unstable.
        """
        return self.replays.run_each(self._with_poses({self.parameters[n]: v for n, v in values.items()}))

    def _with_poses(self, values: Mapping[SceneParameter, float]) -> dict[int, dict[SceneParameter, float]]:
        """By episode the values, those of poses added to the episode's own."""
        out = {}
        for number in self.replays.episodes:
            own = dict(self.poses.get(number, {}))
            for item, value in values.items():
                own[item] = value + own.get(item, 0.0)
            out[number] = own
        return out


def _screened(item: SceneParameter) -> tuple[float, ...]:
    """The steps; a pose is also an episode's own, which is smaller."""
    return POSES if item.group == "object_pose" else SCREENED
