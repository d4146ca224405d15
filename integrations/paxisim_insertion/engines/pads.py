"""The pads of both engines: the paper's sensor with balls for taxels, which make one contact instead of four."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

import paxisim

from ..tasks import Parameters

_CUBES = paxisim.Pad(paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2))  # the paper's sensor

THICKNESS = 3.3e-3
"""Thickness (m) of the gel."""

PAD = replace(_CUBES, taxels="spheres", thickness=4e-3, mass=2e-3)
"""The pad of both scenes. A grip of 30 N indents the gel by more than 1 mm; balls allow their radius, here 2 mm."""

BEHIND = PAD.thickness - _CUBES.thickness
"""Distance (m) by which a ball reaches behind the cube that it replaces."""


class ScenePads:
    """The pads of a compiled scene.

    Attributes:
        pads: paxisim's handle of the pads.
        gel: The gel of the scene's parameters.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, pads: paxisim.Pads, parameters: Parameters) -> None:
        """Apply the gel of the parameters to the pads of a model."""
        self._model, self._data, self.pads = model, data, pads
        self.gel = paxisim.Gel(parameters.gel_modulus, THICKNESS)
        self.set_gel(self.gel)
        self._readout = paxisim.TactileReadout(model, pads)

    def set_gel(self, gel: paxisim.Gel) -> None:
        """Set the contact parameters of the taxels to those of a gel; takes effect at the next step."""
        gel.apply(self._model, self.pads)

    def vary(self, ranges: paxisim.SceneRanges) -> paxisim.SceneVariation:
        """Return a variation that draws friction, stiffness and mounts of the pads within ranges."""
        return ranges.vary(self._model, self.pads, self.gel)

    def set_surface(self, heights: NDArray[np.floating]) -> None:
        """Set the heights of the taxels, ``(pads, rows, cols)`` m, as for cubes; takes effect at the next step."""
        paxisim.set_surface(self._model, self.pads, heights + BEHIND)

    def read(self) -> NDArray[np.float32]:
        """Return the forces at the last physics step, ``(pads, 3, rows, cols)`` float32 newtons."""
        return self._readout.read(self._data)
