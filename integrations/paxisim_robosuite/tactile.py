"""TactileSim reads the pads of a robosuite simulation; TactileWrapper adds tactile observables to an environment."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import numpy as np
from numpy.typing import NDArray
from robosuite.utils.binding_utils import MjSim
from robosuite.utils.observables import Observable
from robosuite.wrappers import Wrapper

import paxisim

from .gripper import TactileGripper


class TactileSim:
    """The pads of one gripper in one compiled simulation. robosuite compiles a new one at every hard reset.

    Attributes:
        pads: paxisim's handle of the pads, in the order of a reading's ``pads`` axis.
    """

    def __init__(self, sim: MjSim, gripper: TactileGripper) -> None:
        """Find the pads and apply their gel.

        Args:
            sim: The simulation; the contact parameters of the taxels are set in its model.
            gripper: The gripper's model.
        """
        self._model, self._data = sim.model._model, sim.data._data
        self.pads = paxisim.find_pads(self._model, prefix=gripper.naming_prefix)
        gripper.pad.gel.apply(self._model, self.pads)
        self._readout = paxisim.TactileReadout(self._model, self.pads)

    def set_surface(self, heights: NDArray[np.floating]) -> None:
        """Set the heights of the taxels, ``(pads, rows, cols)`` m; takes effect at the next step."""
        paxisim.set_surface(self._model, self.pads, heights)

    def rebump(self, gcs: paxisim.GCS, rng: np.random.Generator) -> None:
        """Draw a surface as in the paper's G (geometry)."""
        self.set_surface(gcs.sample_surface(rng, layout=self.pads.layout, pads=len(self.pads)))

    def read(self) -> NDArray[np.float32]:
        """Return the forces at the last physics step, ``(pads, 3, rows, cols)`` float32 newtons."""
        return self._readout.read(self._data)


class TactileWrapper(Wrapper):
    """Add a tactile observable to a robosuite environment for each gripper with pads.

    The observable is ``(pads, 3, rows, cols)`` float32 newtons, named ``"robot0_tactile"``, or
    ``"robot0_right_tactile"`` on a robot with two arms. Like any observable of robosuite it can be corrupted, delayed
    and switched off. The surface is redrawn in every episode. Wrap a `GymWrapper` around this wrapper with
    ``flatten_obs=False`` to keep the observable's shape.

    Attributes:
        gcs: Randomisation from which the surface is drawn; None for the pads' own surface.

    Example:
        ```python
        env = TactileWrapper(suite.make("Lift", robots="Panda", gripper_types="PaxiPandaGripper", ...))
        observation = env.reset()
        observation["robot0_tactile"]  # (2, 3, 6, 5)
        ```
    """

    def __init__(self, env: Any, gcs: paxisim.GCS | None = paxisim.GCS(), seed: int | None = None) -> None:  # noqa: B008
        """Wrap an environment.

        Args:
            env: The environment, with at least one gripper that `register` made.
            gcs: Randomisation from which the surface is drawn, or None for the pads' own surface.
            seed: Random seed of the surfaces; default: from the operating system.

        Raises:
            InvalidValueError: No gripper of the environment has pads.
        """
        super().__init__(env)
        self.gcs = gcs
        self._rng = np.random.default_rng(seed)
        self._sim: MjSim | None = None
        self._tactile: dict[str, TactileSim] = {}
        self._prepare()
        if not self._tactile:
            found = ", ".join(type(gripper).__name__ for _, gripper in self._grippers()) or "none"
            raise paxisim.InvalidValueError(
                f"no gripper of the environment has pads (its grippers: {found}); "
                'use gripper_types="PaxiPandaGripper" or another that paxisim_robosuite.register made'
            )
        for name in self._tactile:
            env.add_observable(Observable(name, self._sensor(name), sampling_rate=env.control_freq))

    def reset(self) -> OrderedDict:
        """Reset the environment and draw the episode's surface."""
        self.env.reset()
        self._prepare()
        self.env.sim.forward()
        return self.env._get_observations(force_update=True)

    def _grippers(self) -> list[tuple[str, Any]]:
        found = []
        for robot in self.env.robots:
            for arm, gripper in robot.gripper.items():
                side = f"{arm}_" if len(robot.arms) > 1 else ""
                found.append((f"{robot.robot_model.naming_prefix}{side}tactile", gripper))
        return found

    def _prepare(self) -> None:
        if self._sim is not self.env.sim:
            self._sim = self.env.sim
            tactile = [(name, g) for name, g in self._grippers() if isinstance(g, TactileGripper)]
            self._tactile = {name: TactileSim(self.env.sim, gripper) for name, gripper in tactile}
        if self.gcs is not None:
            for tactile in self._tactile.values():
                tactile.rebump(self.gcs, self._rng)

    def _sensor(self, name: str) -> Any:
        def read(_cache: dict[str, Any]) -> NDArray[np.float32]:
            return self._tactile[name].read()

        # robosuite concatenates the observables of a modality, and pads of two robots may differ in shape
        read.__modality__ = name  # type: ignore[attr-defined]
        return read
