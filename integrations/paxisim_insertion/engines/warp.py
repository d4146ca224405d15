"""WarpScene: the native engine's scene in many worlds of MuJoCo Warp, stepped together on one device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import torch
from gymnasium.utils import seeding

import paxisim

from ..chains import choose, convert_chain, stack_chains
from ..observations import observed_poses
from ..reward import Insertion, insertion
from ..tasks import Parameters, Task
from .native import CONTROL_STEPS, TIMESTEP, NativeScene
from .pads import BEHIND
from .scene import FREE, PINNED, Grasp, Placement

Poses = tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]


@dataclass(frozen=True)
class Starts:
    """How an episode begins in each world; tensors are float32 on the device.

    Attributes:
        bottom: ``(worlds, 3)`` position of the peg's bottom (m), see `Scene.place`.
        offset: ``(worlds, 3)`` offset of the fingers (m), see `Grasp`.
        lean: ``(worlds,)`` rotation of the peg (rad), see `Grasp`.
        heights: ``(worlds, pads, rows, cols)`` heights of the taxels (m).
        chain: The chain through which the readings pass, with parameters for each world.
    """

    bottom: torch.Tensor
    offset: torch.Tensor
    lean: torch.Tensor
    heights: torch.Tensor
    chain: paxisim.Chain

    @classmethod
    def draw(
        cls, rng: torch.Generator, worlds: int, parameters: Parameters, gcs: paxisim.GCS, pads: paxisim.Pads
    ) -> Starts:
        """Draw all worlds at once, on the generator's device."""

        def uniform(*shape: int) -> torch.Tensor:
            return torch.rand(worlds, *shape, generator=rng, device=rng.device)

        low, high = (torch.tensor(corner, device=rng.device) for corner in parameters.start)
        bottom = low + (high - low) * uniform(3)
        offset = (2 * uniform(3) - 1) * torch.tensor(parameters.grasp_offset, device=rng.device)
        lean = (2 * uniform() - 1) * parameters.grasp_lean
        heights = gcs.sample_surface(rng, (worlds,), layout=pads.layout, pads=len(pads))
        return cls(bottom, offset, lean, heights, gcs.sample(rng, (worlds,), layout=pads.layout, pads=len(pads)))

    @classmethod
    def of_seeds(
        cls,
        seeds: Sequence[int | None],
        parameters: Parameters,
        gcs: paxisim.GCS,
        pads: paxisim.Pads,
        device: torch.device,
    ) -> Starts:
        """Draw world by world on the host, each as `InsertionEnv.reset` does with this seed."""
        bottoms, grasps, heights, chains = [], [], [], []
        for seed in seeds:
            rng = seeding.np_random(seed)[0]
            bottoms.append(rng.uniform(*parameters.start))
            grasps.append(Grasp.draw(rng, parameters))
            heights.append(gcs.sample_surface(rng, layout=pads.layout, pads=len(pads)))
            chains.append(gcs.sample(rng, layout=pads.layout, pads=len(pads)))

        def put(values: Any) -> torch.Tensor:
            return torch.as_tensor(np.asarray(values), dtype=torch.float32, device=device)

        offset, lean = put([grasp.offset for grasp in grasps]), put([grasp.lean for grasp in grasps])
        return cls(put(bottoms), offset, lean, put(heights), convert_chain(stack_chains(chains), put))


@dataclass(frozen=True)
class Settled:
    """Worlds whose fingers have closed on the peg, at the begin of an episode.

    Attributes:
        starts: How the episodes begin.
        state: The changing arrays of the worlds, by name.
        force: ``(worlds, pads, 3, rows, cols)`` readings (N); NaN if they are wrong.
    """

    starts: Starts
    state: dict[str, torch.Tensor]
    force: torch.Tensor


class WarpScene:
    """Worlds with the native engine's model. Each has its own surface, grasp and start.

    Attributes:
        native: The scene from which the worlds are made; its own simulation stays as it is.
        worlds: Number of worlds.
        pads: paxisim's handle of the pads.
        device: Torch device of all tensors.
    """

    def __init__(self, task: Task, parameters: Parameters, worlds: int, device: str | None = None) -> None:
        """Build the worlds.

        Args:
            task: The task.
            parameters: Values that the paper does not specify.
            worlds: Number of worlds.
            device: Warp's name of the device, e.g. ``"cuda:0"`` or ``"cpu"``; default: the first GPU, or the CPU.

        Raises:
            MissingExtraError: MuJoCo Warp is not installed.
            UnsupportedError: The versions of mujoco and mujoco-warp do not go together.
            InvalidValueError: There is less than one world.
        """
        self.native = native = NativeScene(task, parameters)
        self.worlds, self.pads = worlds, native.tactile.pads
        self._model, _ = native.model_and_data
        # first, as it says what is missing
        self._m, self._d = paxisim.warp.put_worlds(self._model, self.pads, worlds, device=device)
        self._warp: Any = import_module("warp")
        self._warp.config.log_level = self._warp.LOG_WARNING  # otherwise it names every kernel that it loads
        self._engine: Any = import_module("mujoco_warp")
        self._readout = paxisim.warp.WarpTactileReadout(self._model, self.pads, worlds, device=device)
        self._device = self._d.qpos.device
        self.device: torch.device = torch.device(self._warp.device_to_torch(self._device))
        self._views()
        self._heights: torch.Tensor | None = None
        self._graphs: dict[int, Any] = {}  # of some physics steps at once
        if self._device.is_cuda:
            self._record()

    def _views(self) -> None:
        """View Warp's arrays as tensors that share their memory."""
        m, d, native = self._m, self._d, self.native
        shared = m.actuator_biasprm
        own = np.repeat(shared.numpy()[:1], self.worlds, axis=0)  # where the fingers meet differs between the worlds
        m.actuator_biasprm = self._warp.array(own, dtype=shared.dtype, device=shared.device)
        view = self._warp.to_torch
        self._bias = view(m.actuator_biasprm)
        self._qpos, self._qvel, self._ctrl = view(d.qpos), view(d.qvel), view(d.ctrl)
        self._poses: Poses = (
            view(d.site_xpos)[:, native.grip_site],
            view(d.site_xmat)[:, native.grip_site],
            view(d.xpos)[:, native.peg_body],
            view(d.xmat)[:, native.peg_body],
        )
        names = ("qpos", "qvel", "act", "ctrl", "time", "qacc_warmstart")
        names += ("xpos", "xmat", "site_xpos", "site_xmat", "geom_xpos", "geom_xmat")
        arrays = {name: view(getattr(d, name)) for name in names}
        self._state = {name: values for name, values in arrays.items() if values.numel()} | {"bias": self._bias}
        self._base = torch.tensor(native.base, dtype=torch.float32, device=self.device)
        self._towards = torch.tensor(native.pull[:, :3].T, dtype=torch.float32, device=self.device)
        self._fingers, self._grippers = (
            torch.as_tensor(indices, dtype=torch.long, device=self.device)
            for indices in (native.finger_qpos, native.finger_actuators)
        )

    def _record(self) -> None:
        """Record a physics step, and those of a control step, as CUDA graphs, after one that loads the kernels."""
        self._step()
        for steps in (1, CONTROL_STEPS):
            with self._warp.ScopedDevice(self._device), self._warp.ScopedCapture() as capture:
                for _ in range(steps):
                    self._engine.step(self._m, self._d)
            self._graphs[steps] = capture.graph

    def _step(self, steps: int = 1) -> None:
        if steps in self._graphs:
            self._warp.capture_launch(self._graphs[steps])
            return
        with self._warp.ScopedDevice(self._device):
            for _ in range(steps):
                self._engine.step(self._m, self._d)

    def place(self, starts: Starts) -> None:
        """Begin an episode in each world: place the peg and close the fingers on it, as `Scene.place` does."""
        native = self.native
        self._surface(starts.heights)
        at: Placement = native.placement(starts.bottom, starts.offset, starts.lean)
        with self._warp.ScopedDevice(self._device):
            self._engine.reset_data(self._m, self._d)
        stiffness = -self._bias[:, self._grippers, 1]
        self._bias[:, self._grippers, 0] = stiffness * at.aside
        self._qpos[:, :3] = at.grip - self._base
        self._qpos[:, self._fingers], self._qpos[:, native.peg_qpos] = at.fingers, at.peg
        self.aim(at.grip)
        for _ in range(round(PINNED / TIMESTEP)):
            self._step()
            self._qpos[:, native.peg_qpos], self._qvel[:, native.peg_dofs] = at.peg, 0.0
        for _ in range(round(FREE / TIMESTEP)):
            self._step()

    def settle(self, starts: Starts) -> Settled:
        """Return the worlds as `place` leaves them, and leave them as they were."""
        before, heights = self._copied(), self._heights
        self.place(starts)
        settled = Settled(starts, self._copied(), self.read().clone())
        for name, values in before.items():
            self._state[name].copy_(values)
        if heights is not None:
            self._surface(heights)
        return settled

    def begin(self, settled: Settled, mask: torch.Tensor) -> None:
        """Begin an episode in the masked worlds, from the beginning of `settled` for each."""
        for name, values in self._state.items():
            values.copy_(choose(mask, settled.state[name], values))
        heights = settled.starts.heights
        self._surface(heights if self._heights is None else choose(mask, heights, self._heights))

    def _copied(self) -> dict[str, torch.Tensor]:
        return {name: values.clone() for name, values in self._state.items()}

    def _surface(self, heights: torch.Tensor) -> None:
        self._heights = heights
        paxisim.warp.set_surface(self._m, self._d, self._model, self.pads, heights + BEHIND)

    def aim(self, position: torch.Tensor) -> None:
        """Pull the fingertips towards positions ``(worlds, 3)`` (m, world) from the next physics step on."""
        self._ctrl[:, :6] = (position - self._base) @ self._towards

    def advance(self) -> None:
        """Simulate 50 ms. Nothing waits for the device."""
        self._step(CONTROL_STEPS)

    def read(self) -> torch.Tensor:
        """Return the forces at the last physics step, ``(worlds, pads, 3, rows, cols)`` newtons; NaN if they are wrong.

        The next read overwrites the tensor.
        """
        return self._readout.read(self._m, self._d)

    @property
    def fingertip(self) -> torch.Tensor:
        """``(worlds, 3)`` positions of the fingertips (m, world); the next step overwrites the tensor."""
        return self._poses[0]

    @property
    def opening(self) -> torch.Tensor:
        """``(worlds,)`` distances (m) between the faces of the two fingers."""
        apart = self._qpos[:, self._fingers]
        return apart[:, 0] - apart[:, 1] - 2 * self.native.closed

    @property
    def insertion(self) -> Insertion:
        """Progress of the insertions."""
        native, (_, _, peg, rotation) = self.native, self._poses
        return insertion(native.task, native.parameters, peg - self._base, rotation)

    @property
    def diverged(self) -> torch.Tensor:
        """``(worlds,)`` whether the simulation of a world has lost its numbers; placing the peg anew repairs it."""
        return ~torch.isfinite(self._qpos).all(dim=-1)

    def observe(self) -> dict[str, torch.Tensor]:
        """Return the poses that the networks see, see `observed_poses`."""
        return observed_poses(self.native, *self._poses)
