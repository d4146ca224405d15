"""SceneRanges: domain randomisation of a simulated scene within the intervals that a diagnosis leaves open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError, UnsupportedError
from paxisim.models.gel import Gel
from paxisim.models.pads import Pads
from paxisim.scene.changed import of_target, quaternion_of, remounted, rotation_of
from paxisim.scene.parameters import SceneParameter, height_map, parameters_of
from paxisim.scene.rig import build_rig

if TYPE_CHECKING:
    from paxisim.scene.scene import Scene

_OF_PADS = ("friction", "gel_stiffness", "mount_offset", "mount_tilt", "surface")


@dataclass(frozen=True)
class SceneRanges:
    """Ranges of the scene parameters that a diagnosis found to be wrong, to sample from in each training episode.

    Example:
        ```python
        ranges = paxisim.SceneRanges.around(diagnosis.scene, diagnosis.scene_intervals)
        variation = ranges.vary(model, pads, gel)  # once
        drawn = variation.draw(rng)  # for each episode
        paxisim.set_surface(model, pads, heights + drawn.heights)
        ```

    Attributes:
        parameters: The parameters.
        intervals: ``(low, high)`` of each parameter, in its SI unit.
        pads: Names of the recorded scene's pads, in the order of a reading's ``pads`` axis.

    Raises:
        InvalidValueError: Bounds are not finite or not in order.
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
        """Return ranges from the intervals of a diagnosis.

        Args:
            scene: The diagnosed scene, ``diagnosis.scene``; None gives empty ranges.
            intervals: ``(low, high)`` by parameter name, in SI units, as in ``diagnosis.scene_intervals``.

        Raises:
            UnknownNameError: The scene does not have a parameter.
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
        """Draw values by parameter name, each uniform over its range.

        Args:
            rng: Random number generator.
        """
        ends = zip(self.parameters, self.intervals, strict=True)
        return {item.name: float(rng.uniform(low, high)) for item, (low, high) in ends}

    def vary(self, model: mujoco.MjModel, pads: Pads, gel: Gel | None = None) -> SceneVariation:
        """Prepare to vary the pads of a model.

        Friction, stiffness, mounts and surfaces belong to the pads and are written into the model. Parameters of the
        recorded scene (an object's size or pose, a drive's zero, the grip force) are not; they are in
        `SceneDraw.values`. Pads are matched by their position in a reading, regardless of their names.

        Args:
            model: Any compiled model with pads; each draw modifies it.
            pads: Pads of the model.
            gel: Gel of the pads; default: the default gel.

        Raises:
            UnsupportedError: A range concerns a mount or a surface, but the model has a different number of pads than
                the recorded scene; or it concerns a surface, but the taxels are not on a grid.
        """
        return SceneVariation(self, model, pads, gel or Gel())


@dataclass(frozen=True, eq=False)
class SceneDraw:
    """Values drawn for an episode.

    Attributes:
        values: Drawn values by parameter name, in SI units.
        gel: Current gel of the pads.
        heights: ``(pads, rows, cols)`` heights (m), to be added to the taxel heights that the episode sets.
    """

    values: Mapping[str, float]
    gel: Gel
    heights: NDArray[np.float64]


class SceneVariation:
    """Writes draws into one compiled model.

    Attributes:
        ranges: The ranges to draw from.
    """

    def __init__(self, ranges: SceneRanges, model: mujoco.MjModel, pads: Pads, gel: Gel) -> None:
        """Store the original poses of the pads and check the ranges; see `SceneRanges.vary`."""
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
                raise UnsupportedError(f"{item.name} is a height map on a grid of taxels, but these pads have no grid")

    def draw(self, rng: np.random.Generator) -> SceneDraw:
        """Draw values and write friction, stiffness and mounts into the model; the caller must set the heights.

        Args:
            rng: Random number generator.
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
            offset, tilt, surface = (of_target(of, group, pad) for group in ("mount_offset", "mount_tilt", "surface"))
            if offset or tilt:
                turn = rotation_of(self._turn[number])
                body = self._pads.bodies[number]
                self._model.body_pos[body], turned = remounted(self._position[number], turn, offset, tilt)
                self._model.body_quat[body] = quaternion_of(turned)
            heights[number] = height_map(self._pads.layout, surface)
        return SceneDraw(values, gel, heights)
