"""SceneRanges: domain randomisation of a simulated scene, within what a diagnosis of a recorded one leaves open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from paxisim.errors import InvalidValueError, UnknownNameError, UnsupportedError
from paxisim.models.gel import Gel
from paxisim.models.pads import Pads
from paxisim.scene.changed import quaternion_of, rotation_of
from paxisim.scene.parameters import SceneParameter, height_map, parameters_of
from paxisim.scene.rig import build_rig

if TYPE_CHECKING:
    from paxisim.scene.scene import Scene

_OF_PADS = ("friction", "gel_stiffness", "mount_offset", "mount_tilt", "surface")


@dataclass(frozen=True)
class SceneRanges:
    """Ranges of the scene parameters that a diagnosis found to be wrong, to draw from for each episode of a training.

    Example:
        ```python
        ranges = paxisim.SceneRanges.around(diagnosis.scene, diagnosis.scene_intervals)
        variation = ranges.vary(model, pads, gel)  # once
        drawn = variation.draw(rng)  # for each episode
        paxisim.set_surface(model, pads, heights + drawn.heights)
        ```

    Attributes:
        parameters: The parameters.
        intervals: ``(low, high)`` for each, in its SI unit.
        pads: Names of the recorded scene's pads, in the order of a reading's ``pads`` axis.

    Raises:
        InvalidValueError: Bounds that are not finite or not in order.
    """

    parameters: tuple[SceneParameter, ...] = ()
    intervals: tuple[tuple[float, float], ...] = ()
    pads: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the intervals."""
        for item, (low, high) in zip(self.parameters, self.intervals, strict=True):
            if not (np.isfinite(low) and np.isfinite(high) and low <= high):
                raise InvalidValueError(f"the range of {item.name} must be finite and in order, got {low!r}, {high!r}")

    @staticmethod
    def around(scene: Scene | None, intervals: Mapping[str, tuple[float, float]]) -> SceneRanges:
        """The ranges that a diagnosis leaves of the parameters that it found.

        Args:
            scene: The scene that it found, ``diagnosis.scene``; without one there are no ranges.
            intervals: ``(low, high)`` by name, in SI units, as ``diagnosis.scene_intervals``.

        Raises:
            UnknownNameError: The scene has no such parameter.
        """
        if scene is None or not intervals:
            return SceneRanges()
        rig = build_rig(scene)
        known = parameters_of(scene, rig)
        unknown = next((name for name in intervals if name not in known), None)
        if unknown is not None:
            raise UnknownNameError("parameter of a scene", unknown, known)
        ends = tuple((float(low), float(high)) for low, high in intervals.values())
        return SceneRanges(tuple(known[name] for name in intervals), ends, rig.pads.names)

    def sample(self, rng: np.random.Generator) -> dict[str, float]:
        """Values by name, each uniform over its range.

        Args:
            rng: Random numbers.
        """
        ends = zip(self.parameters, self.intervals, strict=True)
        return {item.name: float(rng.uniform(low, high)) for item, (low, high) in ends}

    def vary(self, model: mujoco.MjModel, pads: Pads, gel: Gel | None = None) -> SceneVariation:
        """Prepare a model whose pads are to be varied.

        Friction, stiffness, mounts and surfaces belong to the pads and are written into the model. What belongs to the
        scene that was recorded, an object's size or pose, a drive's zero and the grip force, is not; `SceneDraw.values`
        has it. Pads correspond by their place in a reading, whatever their names.

        Args:
            model: Any compiled model with pads; it is changed by each draw.
            pads: Its pads.
            gel: Their gel; default: the default gel.

        Raises:
            UnsupportedError: A range is of a mount or a surface, and the recorded scene has another number of pads or
                taxels on no grid.
        """
        return SceneVariation(self, model, pads, gel or Gel())


@dataclass(frozen=True, eq=False)
class SceneDraw:
    """What was drawn for an episode.

    Attributes:
        values: By name, in SI units.
        gel: The gel that the pads have now.
        heights: ``(pads, rows, cols)`` m, to be added to the heights that the episode gives the taxels.
    """

    values: Mapping[str, float]
    gel: Gel
    heights: NDArray[np.float64]


class SceneVariation:
    """Writes draws into one compiled model.

    Attributes:
        ranges: What is drawn from.
    """

    def __init__(self, ranges: SceneRanges, model: mujoco.MjModel, pads: Pads, gel: Gel) -> None:
        """See `SceneRanges.vary`."""
        self.ranges, self._model, self._pads, self._gel = ranges, model, pads, gel
        self._position = model.body_pos[pads.bodies].copy()
        self._turn = model.body_quat[pads.bodies].copy()
        for item in ranges.parameters:
            if item.group in ("mount_offset", "mount_tilt", "surface") and len(pads) != len(ranges.pads):
                raise UnsupportedError(
                    f"{item.name} belongs to one of the {len(ranges.pads)} pads of the recorded scene, but this model "
                    f"has {len(pads)}"
                )
            if item.group == "surface" and not pads.layout.is_grid:
                raise UnsupportedError(f"{item.name} is a height map of a grid of taxels, which these pads are not")

    def draw(self, rng: np.random.Generator) -> SceneDraw:
        """Draw anew and write friction, stiffness and mounts into the model; heights are for the caller to set.

        Args:
            rng: Random numbers.
        """
        values = self.ranges.sample(rng)
        of = {item: values[item.name] for item in self.ranges.parameters if item.group in _OF_PADS}
        friction = next((v for item, v in of.items() if item.group == "friction"), self._gel.friction)
        stiffness = next((v for item, v in of.items() if item.group == "gel_stiffness"), 1.0)
        gel = replace(self._gel, friction=friction, modulus=self._gel.modulus * stiffness)
        if any(item.group in ("friction", "gel_stiffness") for item in of):
            gel.apply(self._model, self._pads)
        heights = np.zeros((len(self._pads), self._pads.layout.rows, self._pads.layout.cols))
        for number, pad in enumerate(self.ranges.pads[: len(self._pads)]):
            own = {group: self._of_pad(of, pad, group) for group in ("mount_offset", "mount_tilt", "surface")}
            self._mount(number, own["mount_offset"], own["mount_tilt"])
            heights[number] = height_map(self._pads.layout, own["surface"])
        return SceneDraw(values, gel, heights)

    def _of_pad(self, values: Mapping[SceneParameter, float], pad: str, group: str) -> dict[int, float]:
        return {item.index: v for item, v in values.items() if item.group == group and item.target == pad}

    def _mount(self, number: int, offset: Mapping[int, float], tilt: Mapping[int, float]) -> None:
        """Move and turn a pad in its own frame, from where the model had it."""
        if not offset and not tilt:
            return
        body, turn = self._pads.bodies[number], rotation_of(self._turn[number])
        self._model.body_pos[body] = self._position[number] + turn.apply([offset.get(0, 0.0), offset.get(1, 0.0), 0.0])
        turned = turn * Rotation.from_rotvec([tilt.get(0, 0.0), tilt.get(1, 0.0), 0.0])
        self._model.body_quat[body] = quaternion_of(turned)
