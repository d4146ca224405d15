"""The pads of both engines: the paper's sensor with a ball for each taxel, which makes one contact and not four."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray
from paxisim_robosuite import register
from paxisim_robosuite.gripper import DEFAULT_SENSOR

import paxisim

PAD = replace(DEFAULT_SENSOR, taxels="spheres", thickness=4e-3, mass=2e-3)
"""A grip of 30 N presses the gel in by more than 1 mm, and a ball can be pressed in by its radius: 2 mm here."""

GRIPPER = "PaxiInsertionGripper"
"""robosuite's name of the Panda's gripper with these pads."""

_BEHIND = PAD.thickness - DEFAULT_SENSOR.thickness  # m that a ball reaches behind the cube that it stands for

register(GRIPPER, "PandaGripper", PAD)


class ScenePads:
    """The pads of a compiled scene.

    Attributes:
        pads: paxisim's handle of the pads.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, pads: paxisim.Pads) -> None:
        """Give the pads of a model their gel; the model's contact parameters of the taxels are set."""
        self._model, self._data, self.pads = model, data, pads
        PAD.gel.apply(model, pads)
        self._readout = paxisim.TactileReadout(model, pads)

    def vary(self, ranges: paxisim.SceneRanges) -> paxisim.SceneVariation:
        """What draws friction, stiffness and mounts of the pads within ranges."""
        return ranges.vary(self._model, self.pads, PAD.gel)

    def set_surface(self, heights: NDArray[np.floating]) -> None:
        """Give the taxels new heights, ``(pads, rows, cols)`` m, as those of cubes; takes effect at the next step."""
        paxisim.set_surface(self._model, self.pads, heights + _BEHIND)

    def read(self) -> NDArray[np.float32]:
        """``(pads, 3, rows, cols)`` float32 newtons: what the pads felt at the last physics step."""
        return self._readout.read(self._data)
