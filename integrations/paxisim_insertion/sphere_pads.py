"""SpherePads: pads of which each taxel is a ball in place of a cube, so that it makes one contact and not four.

As ``paxisim.Pad(taxels="spheres")``, but those are as thick as the cubes, 0.5 mm in radius, and stand for indentations
up to that. A grip of 30 N presses the gel in by more than 1 mm.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

import paxisim

RADIUS = 2e-3
"""Of the balls (m). The smaller, the nearer is a round object's contact to what lies straight before the taxel."""

_HIGHEST = 3e-3  # m that a taxel may stand out


def to_spheres(spec: mujoco.MjSpec, model: mujoco.MjModel, pads: paxisim.Pads) -> None:
    """Put a ball in the place of each taxel's cube.

    Args:
        spec: Of the scene; changed. The ids of its geoms stay.
        model: With cubes, of the same scene.
        pads: The pads of `model`.
    """
    for geom in pads.geoms.reshape(-1):
        taxel = spec.geom(model.geom(geom).name)
        taxel.type = mujoco.mjtGeom.mjGEOM_SPHERE
        taxel.size = [RADIUS, 0, 0]


class SpherePads:
    """The pads of a compiled scene whose taxels are balls.

    Attributes:
        pads: paxisim's handle of the pads.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, pads: paxisim.Pads, gel: paxisim.Gel) -> None:
        """Give the pads their gel, and lie them flat.

        Args:
            model: Compiled after `to_spheres`; its contact parameters of the taxels are set.
            data: What is read.
            pads: The pads, as they were found when their taxels were cubes.
            gel: Of the pads.
        """
        self._model, self._data, self.pads = model, data, pads
        gel.apply(model, pads)
        self._readout = paxisim.TactileReadout(model, pads)
        # MuJoCo's bounding boxes are those of the compiled surface
        for body in pads.bodies:
            first = int(model.body_bvhadr[body])
            model.bvh_aabb[first : first + int(model.body_bvhnum[body]), 3:] += _HIGHEST
        self.set_surface(np.full((len(pads), pads.layout.rows, pads.layout.cols), pads.thickness[0]))

    def set_surface(self, heights: NDArray[np.floating]) -> None:
        """Give the taxels new heights, ``(pads, rows, cols)`` m, as those of cubes; takes effect at the next step."""
        for geoms, thickness, own in zip(self.pads.geoms, self.pads.thickness, heights, strict=True):
            self._model.geom_pos[geoms, 2] = thickness - own.reshape(-1) + RADIUS

    def read(self) -> NDArray[np.float32]:
        """``(pads, 3, rows, cols)`` float32 newtons: what the pads felt at the last physics step."""
        return self._readout.read(self._data)
