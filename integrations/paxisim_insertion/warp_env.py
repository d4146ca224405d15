"""InsertionWarpEnv: an insertion task in thousands of worlds on a GPU, as a gymnasium vector environment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

import paxisim

from .chains import choose, merge_chains
from .engines.warp import Settled, Starts, WarpScene
from .env import CONTROL_DT
from .methods import NOTHING_DRAWN, find_method
from .observations import RAW, make_spaces
from .reward import reward_terms, weighted
from .tasks import Parameters, find_task

Observation = dict[str, torch.Tensor]


class InsertionWarpEnv(VectorEnv):
    """The native engine's task in many worlds of MuJoCo Warp: ``gymnasium.make_vec("paxisim/SX-2mm-warp-v0", 4096)``.

    Scene, observations and rewards are those of `InsertionEnv` with ``engine="native"``. Observations, rewards and
    flags are torch tensors on the device instead of arrays, and actions may be too. A step waits for nothing.

    All episodes have the same length, and new ones begin at once: a step that ends an episode returns the first
    observation of the next one, and the last observation in ``infos["final_obs"]``. ``infos["is_success"]`` tells
    in which worlds the insertion has succeeded in this episode. A world whose simulation diverges, or whose contacts
    MuJoCo Warp has dropped, has observations and rewards of 0 until the episode ends, and ``infos["is_wrong"]``.

    The worlds end their episodes together, or, if `staggered`, at different steps: the first episode of each ends after
    a random number of steps. On-policy methods learn from a few steps of all worlds at a time, which should not all be
    of one phase of the episode. The grasps of new episodes settle together, in one of as many steps as an episode has.

    Attributes:
        scene: The worlds.
        task: The task.
        method: The method.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012 - gymnasium's own

    def __init__(
        self,
        num_envs: int = 1,
        *,
        task: str = "SX-2mm",
        method: str = "GCS",
        gcs: paxisim.GCS | None = None,
        parameters: Parameters | None = None,
        staggered: bool = False,
        device: str | None = None,
    ) -> None:
        """Build the worlds.

        Args:
            num_envs: Number of worlds.
            task: Name of a task.
            method: Name of a method.
            gcs: Randomisation drawn for each episode. Default: that of the method.
            parameters: Values that the paper does not specify.
            staggered: Whether the worlds end their episodes at different steps.
            device: Warp's name of the device, e.g. ``"cuda:0"`` or ``"cpu"``; default: the first GPU, or the CPU.

        Raises:
            UnknownNameError: There is no such task or method.
            MissingExtraError: MuJoCo Warp is not installed.
            InvalidValueError: There is less than one world.
        """
        self.task, self.method = find_task(task), find_method(method)
        gcs = self.method.gcs if gcs is None else gcs
        self._gcs = NOTHING_DRAWN if gcs is None else gcs
        self.parameters = parameters or Parameters()
        self.scene = WarpScene(self.task, self.parameters, num_envs, device)
        self.device = self.scene.device
        pads = self.scene.pads
        self.layout = pads.layout
        self._history = self.method.history(self.task, self.layout)
        self._has_raw = gcs is not None
        one, action = make_spaces(self.task, self._history, pads.shape, raw=self._has_raw)
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = one, action
        self.observation_space, self.action_space = batch_space(one, num_envs), batch_space(action, num_envs)
        self._has_tactile = "tactile" in one.spaces
        self._axes = torch.tensor(self.task.axes, device=self.device)
        self._rng = torch.Generator(self.device)
        self._rng.seed()
        self._chain, self._state = paxisim.Chain(), ()
        self._staggered, self._steps = staggered, 0
        self._phase = torch.zeros(num_envs, dtype=torch.long, device=self.device)
        self._next: Settled | None = None
        self._home: torch.Tensor | None = None
        self._raw = torch.zeros((num_envs, *pads.shape), device=self.device)
        self._all = torch.ones(num_envs, dtype=torch.bool, device=self.device)
        self._succeeded, self._wrong = ~self._all, ~self._all

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode in each world.

        Args:
            seed: Seed of the draws on the device. A sequence of one seed per world draws on the host instead, and
                world by world begins as `InsertionEnv` does with that seed; the following episodes are drawn on the
                device.
            options: Not used.

        Raises:
            InvalidValueError: The number of seeds is not that of the worlds.
        """
        if isinstance(seed, Sequence):
            if len(seed) != self.num_envs:
                raise paxisim.InvalidValueError(f"expected {self.num_envs} seeds, got {len(seed)}")
            starts = Starts.of_seeds(seed, self.parameters, self._gcs, self.scene.pads, self.device)
        else:
            if seed is not None:
                self._rng.manual_seed(int(seed))
            starts = self._draw()
        self._begin_all(starts)
        return self._observe(), self._infos()

    def step(  # type: ignore[override]
        self, actions: Any
    ) -> tuple[Observation, torch.Tensor, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Apply actions ``(worlds, axes)`` for 50 ms.

        Returns:
            Observations, and per world the reward, whether it is terminated (never), whether it is truncated, and
            `infos`.

        Raises:
            InvalidValueError: The actions have another shape, or no episode has begun.
        """
        scene, shape = self.scene, (self.num_envs, len(self._axes))
        action = torch.as_tensor(actions, dtype=torch.float32, device=self.device).clip(-1.0, 1.0)
        if action.shape != shape or self._home is None:
            began = "" if self._home is not None else "; call reset() first"
            raise paxisim.InvalidValueError(f"expected actions of shape {shape}, got {tuple(action.shape)}{began}")
        goal = self._home.clone()
        goal[:, self._axes] = scene.fingertip[:, self._axes] + self.task.action_scale * action
        scene.aim(goal)
        scene.advance()
        self._steps += 1
        self._feel(CONTROL_DT)
        state = scene.insertion
        reward = weighted(reward_terms(state, action, self.parameters.epsilon))
        reward = torch.where(self._wrong, 0.0, reward)
        self._succeeded = self._succeeded | (state.success & ~self._wrong)
        observation, infos = self._observe(), self._infos()
        renewed = self._steps % self.task.max_steps == 0
        if renewed:
            self._next = scene.settle(self._draw())
        ended = ~self._all
        if renewed or self._staggered:
            ended = (self._steps + self._phase) % self.task.max_steps == 0
            last = {name: infos[name] for name in ("is_success", "is_wrong")}
            self._begin(ended)
            infos = self._infos() | {"final_obs": observation, "final_info": last}
            infos |= {"_final_obs": ended, "_final_info": ended}
            observation = self._observe()
        return observation, reward, ~self._all, ended, infos

    def solved(self, act: Callable[[Observation], Any], seeds: Sequence[int]) -> list[bool]:
        """Return in which worlds a policy solves the episode of the world's seed; wrong worlds count as not solved.

        Args:
            act: The policy, which maps observations to actions ``(worlds, axes)``.
            seeds: One seed per world, see `reset`.
        """
        observation, infos = self.reset(seed=seeds)
        for _ in range(self.task.max_steps):
            observation, _, _, _, infos = self.step(act(observation))
        return infos["final_info"]["is_success"].tolist()

    def _draw(self) -> Starts:
        return Starts.draw(self._rng, self.num_envs, self.parameters, self._gcs, self.scene.pads)

    def _begin_all(self, starts: Starts) -> None:
        """Begin the first episode of each world."""
        scene = self.scene
        scene.place(starts)
        self._home, self._chain = scene.fingertip.clone(), starts.chain
        self._steps, self._succeeded, self._wrong = 0, ~self._all, ~self._all
        self._history.reset()
        self._raw = self._sense(scene.read())
        self._state = self._chain.initial_state(self._raw, self._covariates())
        self._history.append(self._through(0.0))
        self._next = None
        if self._staggered:
            self._phase.random_(self.task.max_steps, generator=self._rng)
            self._next = scene.settle(self._draw())

    def _begin(self, ended: torch.Tensor) -> None:
        """Begin the next episode of the worlds whose episode has ended."""
        scene, new = self.scene, self._next
        assert new is not None
        assert self._home is not None
        scene.begin(new, ended)
        self._home = choose(ended, scene.fingertip, self._home)
        self._succeeded, self._wrong = self._succeeded & ~ended, self._wrong & ~ended
        self._raw = choose(ended, self._sense(choose(ended, new.force, self._raw)), self._raw)
        self._chain = merge_chains(ended, new.starts.chain, self._chain)
        fresh = self._chain.initial_state(self._raw, self._covariates())
        kept = self._state
        self._state = choose(ended, fresh, kept)
        first = self._through(0.0)
        self._state = choose(ended, self._state, kept)
        self._history.begin(first, ended)

    def _sense(self, force: torch.Tensor) -> torch.Tensor:
        self._wrong = self._wrong | self.scene.diverged | ~torch.isfinite(force).all(dim=(1, 2, 3, 4))
        return torch.nan_to_num(force)

    def _through(self, dt: float) -> torch.Tensor:
        """Return the newest reading as the sensor gives it."""
        force, self._state = self._chain.step(self._raw, self._state, dt, self._covariates())
        return force

    def _feel(self, dt: float) -> None:
        self._raw = self._sense(self.scene.read())
        self._history.append(self._through(dt))

    def _covariates(self) -> dict[str, Any]:
        return {"gripper_opening": self.scene.opening} if self._chain.covariate_names else {}

    def _observe(self) -> Observation:
        observation = self.scene.observe()
        if self._has_tactile:
            observation["tactile"] = self._history.read()
        if self._has_raw:
            observation[RAW] = self._raw
        return {
            name: value.masked_fill(self._wrong.reshape(-1, *[1] * (value.ndim - 1)), 0.0)
            for name, value in observation.items()
        }

    def _infos(self) -> dict[str, Any]:
        return {
            "is_success": self._succeeded,
            "_is_success": self._all,
            "is_wrong": self._wrong,
            "_is_wrong": self._all,
        }
