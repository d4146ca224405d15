"""TactileSensor: the pads of an mjlab entity as a sensor of the scene.

mjlab builds a scene in two phases: sensors may edit the spec before it is compiled, and find their ids once after.
The pads are part of the entity's spec (`paxisim.attach` in its ``spec_fn``), so this sensor only has the second phase.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import mujoco

from paxisim.errors import InvalidValueError, MissingExtraError, UnsupportedError
from paxisim.models.gel import Gel
from paxisim.models.pads import Pads, are_spheres, find_pads

try:
    version("mjlab")
except PackageNotFoundError as error:
    raise MissingExtraError("mjlab", "mjlab", "the TactileSensor of paxisim.warp") from error

# before mjlab, whose import fails on the wrong mujoco with an error that does not say so
from paxisim.warp.engine import torch
from paxisim.warp.fields import SURFACE, view
from paxisim.warp.gel import apply_gel, restore_gel
from paxisim.warp.readout import WarpTactileReadout
from paxisim.warp.surface import set_surface

mjlab_sensor: Any = import_module("mjlab.sensor")


@dataclass
class TactileSensorCfg(mjlab_sensor.SensorCfg):
    """Configuration of a `TactileSensor`, for ``SceneCfg.sensors``.

    Attributes:
        name: Name of the sensor: ``env.scene[name]``.
        entity: Name of the entity in ``SceneCfg.entities`` whose spec has the pads.
        pads: Names of the pads to read, without the entity's prefix; default: all, in the order of their bodies.
        gel: Gel of the pads.
    """

    entity: str = ""
    pads: tuple[str, ...] = ()
    gel: Gel = field(default_factory=Gel)

    def build(self) -> TactileSensor:
        """Return the sensor; mjlab calls this."""
        return TactileSensor(self)

    def find_pads(self, model: mujoco.MjModel) -> Pads:
        """Return the pads of the compiled scene that this sensor reads.

        Raises:
            InvalidValueError: The entity has no such pads, or they differ in shape.
        """
        prefix = f"{self.entity}/"
        return find_pads(model, prefix=prefix, names=[prefix + pad for pad in self.pads] or None)


class TactileSensor(mjlab_sensor.Sensor):
    """Sensor of an mjlab scene that reads pads in newtons.

    `data` are the forces on the taxels, a torch tensor ``(worlds, pads, 3, rows, cols)`` float32 on the device,
    newtons, pad frame. It is read once a step, at the first use; the next read overwrites it. mjlab's observation
    manager clones what a term returns; elsewhere ``clone()`` what you keep.

    A world whose forces would be wrong reads NaN, as with `WarpTactileReadout`; the first reads raise an error.

    Example:
        ```python
        def tactile(env):
            return env.scene["tactile"].data.flatten(1)


        hand = EntityCfg(spec_fn=lambda: paxisim.attach("hand.xml", "paxini-gen1-l4629").spec)
        cfg.scene = SceneCfg(num_envs=4096, entities={"hand": hand}, sensors=(TactileSensorCfg("tactile", "hand"),))
        cfg.events["pads"] = EventTermCfg(func=RenewPads, mode="reset", params={"sensor": "tactile"})
        cfg.observations["actor"].terms["tactile"] = ObservationTermCfg(func=tactile)
        fit_simulation(cfg)
        ```
    """

    def __init__(self, cfg: TactileSensorCfg) -> None:
        """Keep the configuration; mjlab calls this."""
        super().__init__()
        self._cfg = cfg

    def edit_spec(self, scene_spec: mujoco.MjSpec, entities: dict[str, Any]) -> None:
        """Check that the scene has the entity; its spec brings the pads.

        Raises:
            InvalidValueError: The scene has no such entity.
        """
        if self._cfg.entity not in entities:
            known = ", ".join(map(repr, entities)) or "none"
            raise InvalidValueError(
                f"the tactile sensor {self._cfg.name!r} is of entity {self._cfg.entity!r}, but the scene has {known}"
            )

    def initialize(self, mj_model: mujoco.MjModel, model: Any, data: Any, device: str) -> None:
        """Find the pads, give them their gel and make the tensor; mjlab calls this after it has compiled the scene.

        Raises:
            InvalidValueError: The entity has no such pads, or the gel's relaxation is too short for the time step.
            UnsupportedError: The simulation has the collider with which boxes find other contacts than in MuJoCo.
        """
        self._m, self._d = (getattr(each, "struct", each) for each in (model, data))
        self._model = mj_model
        self._pads = self._cfg.find_pads(mj_model)
        boxes = not are_spheres(mj_model, self._pads.geoms.reshape(-1)).all()
        if boxes and not self._m.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD):
            # mjlab has recorded its CUDA graph already, so a flag that is set here would come too late
            raise UnsupportedError(
                "box taxels need MuJoCo's box collider: call paxisim.warp.fit_simulation(cfg) before making the "
                "environment, or set MujocoCfg(disableflags=('nativeccd',))"
            )
        # also on the host, where mjlab's randomisation takes the default values from
        self._cfg.gel.apply(mj_model, self._pads)
        apply_gel(self._m, mj_model, self._pads, self._cfg.gel)
        self._readout = WarpTactileReadout(mj_model, self._pads, self._d.nworld, device=device)

    @property
    def pads(self) -> Pads:
        """Pads that the sensor reads."""
        return self._pads

    def _compute_data(self) -> Any:
        return self._readout.read(self._m, self._d)

    def check(self) -> None:
        """Check that forces can be trusted, as `WarpTactileReadout.check` does. This waits for the device.

        Raises:
            UnsupportedError: A world has run out of room for contacts, or its gel is undone.
        """
        self._readout.check(self._m, self._d)

    def set_surface(self, heights: Any, env_ids: Any = None) -> None:
        """Give the taxels of some worlds new heights, see `set_surface`; `RenewPads` draws them at each reset.

        Args:
            heights: Thickness of the cubes (m), ``(len(env_ids), pads, rows, cols)``; an array or a tensor.
            env_ids: Ids of the worlds, a tensor; default: all.

        Raises:
            InvalidValueError: The heights have the wrong shape or are not positive and finite.
            UnsupportedError: The worlds share one surface, because no event asks for fields of their own.
        """
        worlds, device = self._d.nworld, view(self._m, "geom_pos").device
        if any(getattr(self._m, name).shape[0] != worlds for name in SURFACE):
            raise UnsupportedError(
                "all worlds share one surface: add the event paxisim.warp.RenewPads to the environment's events, "
                f"for which mjlab gives each world its own {', '.join(SURFACE)}"
            )
        heights = torch.as_tensor(heights, dtype=torch.float32, device=device)
        ids = torch.arange(worlds, device=device) if env_ids is None else torch.as_tensor(env_ids, device=device).long()
        expected = (len(ids), len(self._pads), self._pads.layout.rows, self._pads.layout.cols)
        if tuple(heights.shape) != expected:
            raise InvalidValueError(f"heights must have shape {expected}, got {tuple(heights.shape)}")
        everywhere = torch.full((worlds, *expected[1:]), self._pads.thickness[0], device=device)
        mask = torch.zeros(worlds, dtype=torch.bool, device=device)
        everywhere[ids], mask[ids] = heights, True
        set_surface(self._m, self._d, self._model, self._pads, everywhere, mask)

    def restore_gel(self) -> None:
        """Give the pads their gel again after `mujoco_warp.set_const`; `RenewPads` calls this at each reset."""
        restore_gel(self._m)
