"""RslEnv: the worlds on MuJoCo Warp as rsl-rl's vector environment, with an asymmetric actor and critic."""

from __future__ import annotations

from typing import Any

import torch
from rsl_rl.env import VecEnv  # type: ignore - not where robosuite is
from tensordict import TensorDict  # type: ignore - likewise

from .encoder import POSE_SCALE
from .env import PRIVILEGED
from .warp_env import InsertionWarpEnv, Observation


class RslEnv(VecEnv):
    """An `InsertionWarpEnv` for rsl-rl's runners, with one observation group per entry that a network sees.

    Poses are in cm and centiradian, as the networks of SAC see them. Episodes begin together, so rsl-rl's option to
    begin them at random lengths has no effect.

    Attributes:
        env: The worlds.
        actor: Groups that the actor sees.
        critic: Groups that the critic sees.
    """

    def __init__(self, env: InsertionWarpEnv, *, seed: int, reward_scale: float) -> None:
        """Begin the first episodes.

        Args:
            env: The worlds.
            seed: Seed of the episodes.
            reward_scale: Factor of the reward.
        """
        self.env, self._scale = env, reward_scale
        self.num_envs, self.num_actions = env.num_envs, len(env.task.axes)
        self.max_episode_length, self.device = env.task.max_steps, str(env.device)
        self.cfg: dict[str, Any] = {}
        observation, _ = env.reset(seed=seed)
        self.actor = [name for name in ("p", "tactile") if name in observation]
        self.critic = [PRIVILEGED]
        self.episode_length_buf = torch.zeros(env.num_envs, dtype=torch.long, device=env.device)
        self._now = self.grouped(observation)

    def get_observations(self) -> TensorDict:
        """Return the current observations."""
        return self._now

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Apply actions ``(worlds, axes)``; ``extras["log"]`` has the success rate when episodes end."""
        observation, reward, _, truncated, infos = self.env.step(actions)
        self._now = self.grouped(observation)
        self.episode_length_buf = (self.episode_length_buf + 1) * ~truncated
        extras: dict[str, Any] = {"time_outs": truncated}
        if "final_info" in infos:
            last = infos["final_info"]
            extras["log"] = {f"/{name}": last[name].float().mean() for name in ("is_success", "is_wrong")}
        return self._now, self._scale * reward, truncated, extras

    def grouped(self, observation: Observation) -> TensorDict:
        """Return the groups of an observation."""
        groups = {name: observation[name] for name in (*self.actor, *self.critic)}
        for name in ("p", PRIVILEGED):
            groups[name] = POSE_SCALE * groups[name]
        return TensorDict(groups, batch_size=[len(observation["p"])])
