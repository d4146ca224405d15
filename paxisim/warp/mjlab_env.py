"""What pads need in the configuration of an mjlab environment: room for their contacts, and an event at resets."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from paxisim.augment import GCS
from paxisim.errors import InvalidValueError

# SURFACE by way of this module, which first sees whether there is an mjlab
from paxisim.warp.mjlab_sensor import SURFACE, TactileSensor, TactileSensorCfg
from paxisim.warp.room import sizes

BOX_COLLIDER = "nativeccd"
"""Flag that MuJoCo Warp disables to let boxes meet by MuJoCo's own box collider."""


def fit_simulation(cfg: Any) -> None:
    """Fit the simulation of an mjlab environment to the pads of its tactile sensors.

    Sets ``nconmax`` and ``njmax`` of ``cfg.sim`` to room for an object on every taxel, and selects MuJoCo's box
    collider (``cfg.sim.mujoco.disableflags``), as `put_worlds` does. Call it once the scene and the solver's options
    are complete.

    Args:
        cfg: The ``ManagerBasedRlEnvCfg``; its ``sim`` is changed in place.

    Raises:
        InvalidValueError: The scene has no `TactileSensorCfg`, or a sensor's entity has no pads.
    """
    sensors = [sensor for sensor in cfg.scene.sensors if isinstance(sensor, TactileSensorCfg)]
    if not sensors:
        raise InvalidValueError("the scene has no tactile sensor: add a TactileSensorCfg to SceneCfg.sensors")
    if BOX_COLLIDER not in cfg.sim.mujoco.disableflags:
        cfg.sim.mujoco.disableflags = (*cfg.sim.mujoco.disableflags, BOX_COLLIDER)
    model = import_module("mjlab.scene").Scene(cfg.scene, device="cpu").compile()
    cfg.sim.mujoco.apply(model)
    cfg.sim.nconmax, cfg.sim.njmax = (
        int(each) for each in np.sum([sizes(model, sensor.find_pads(model)) for sensor in sensors], axis=0)
    )


class RenewPads:
    """Event of an mjlab environment at resets: the pads' gel as it was applied and, if asked, a new surface.

    An event that changes masses makes mjlab call `mujoco_warp.set_const`, which undoes the gel of all worlds. If that
    event has the mode ``"startup"`` or ``"reset"``, this one restores the gel at the reset, after all other events. It
    does not see events of mode ``"interval"`` or ``"step"``: forces are then NaN until the next reset.

    Parameters in ``EventTermCfg.params``: ``sensor``, the name of the `TactileSensor`, and ``surface``, a `paxisim.GCS`
    whose G is drawn for each world that begins an episode (default: surfaces stay).

    Example:
        ```python
        params = {"sensor": "tactile", "surface": paxisim.GCS()}
        cfg.events["pads"] = EventTermCfg(func=RenewPads, mode="reset", params=params)
        ```
    """

    model_fields = SURFACE
    """Fields of which mjlab gives each world its own copy."""

    def __init__(self, cfg: Any, env: Any) -> None:
        """Find the sensor; mjlab calls this.

        Args:
            cfg: The ``EventTermCfg``.
            env: The environment, whose seed also seeds the surfaces.

        Raises:
            InvalidValueError: The parameter ``sensor`` names no tactile sensor of the scene.
        """
        name = cfg.params.get("sensor")
        sensors = {key: each for key, each in env.scene.sensors.items() if isinstance(each, TactileSensor)}
        if name not in sensors:
            known = ", ".join(map(repr, sensors)) or "none"
            raise InvalidValueError(
                f"RenewPads needs the name of a tactile sensor, got {name!r}; the scene has {known}"
            )
        self._sensor = sensors[name]
        self._rng = np.random.default_rng(env.cfg.seed)

    def __call__(self, env: Any, env_ids: Any, sensor: str, surface: GCS | None = None) -> None:
        """Draw new surfaces; mjlab calls this with the worlds that begin an episode (None: all)."""
        if surface is None:
            return
        pads, worlds = self._sensor.pads, env.num_envs if env_ids is None else len(env_ids)
        heights = surface.sample_surface(self._rng, (worlds,), layout=pads.layout, pads=len(pads))
        self._sensor.set_surface(heights, env_ids)

    def reset(self, env_ids: Any = None) -> None:
        """Restore the gel; mjlab calls this after all events of a reset and what it recomputes for them."""
        self._sensor.restore_gel()
