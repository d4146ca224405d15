"""HistoryReplayBuffer: stable-baselines3's replay buffer, which keeps each tactile frame once and not k times."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.buffers import DictReplayBuffer
from stable_baselines3.common.type_aliases import DictReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

import paxisim


class HistoryReplayBuffer(DictReplayBuffer):
    """A replay buffer for observations with a ``"tactile"`` history of k frames, oldest first.

    It keeps the newest frame of each observation and puts the history together when it is sampled: SAC's default of a
    million transitions takes 1.7 GB for GCS with k = 20, and not 29. What is sampled is what was added, to the bit. The
    first frame of an episode stands for those before it, as in `paxisim.History`.
    """

    def __init__(
        self, buffer_size: int, observation_space: spaces.Dict, *args: Any, history: int = 1, **kwargs: Any
    ) -> None:
        """As `DictReplayBuffer`.

        Args:
            buffer_size: Transitions to keep.
            observation_space: Of the environment.
            *args: For `DictReplayBuffer`.
            history: k.
            **kwargs: For `DictReplayBuffer`.

        Raises:
            InvalidValueError: The history's channels are not those of k frames.
        """
        shape = observation_space["tactile"].shape
        assert shape is not None
        if history < 1 or shape[0] % history:
            raise paxisim.InvalidValueError(f"{shape[0]} channels of tactile history are not those of {history} frames")
        self._k, self._channels = history, shape[0] // history
        frame = spaces.Box(-np.inf, np.inf, (self._channels, *shape[1:]), np.float32)
        super().__init__(buffer_size, spaces.Dict({**observation_space.spaces, "tactile": frame}), *args, **kwargs)
        # how many transitions of the same episode went before
        self._age = np.zeros((self.buffer_size, self.n_envs), dtype=np.int32)
        self._next_age = np.zeros(self.n_envs, dtype=np.int32)

    def add(
        self,
        obs: dict[str, NDArray[Any]],  # type: ignore[override]
        next_obs: dict[str, NDArray[Any]],  # type: ignore[override]
        action: NDArray[Any],
        reward: NDArray[Any],
        done: NDArray[Any],
        infos: list[dict[str, Any]],
    ) -> None:
        """Keep one transition of each environment."""
        self._age[self.pos] = self._next_age
        self._next_age = np.where(done, 0, self._next_age + 1)
        super().add(self._newest(obs), self._newest(next_obs), action, reward, done, infos)

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> DictReplayBufferSamples:
        """Draw a batch."""
        if not self.full:
            return self._get_samples(np.random.randint(0, self.pos, batch_size), env)  # noqa: NPY002 - SB3 seeds it
        # the oldest have lost what went before them
        from_oldest = np.random.randint(min(self._k - 1, self.buffer_size - 1), self.buffer_size, batch_size)  # noqa: NPY002
        return self._get_samples((from_oldest + self.pos) % self.buffer_size, env)

    def _newest(self, observation: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        return {**observation, "tactile": observation["tactile"][:, -self._channels :]}

    def _get_samples(self, batch_inds: NDArray[Any], env: VecNormalize | None = None) -> DictReplayBufferSamples:
        envs = np.random.randint(0, self.n_envs, len(batch_inds))  # noqa: NPY002
        back = np.minimum(np.arange(self._k - 1, -1, -1), self._age[batch_inds, envs][:, None])
        frames = self.observations["tactile"][(batch_inds[:, None] - back) % self.buffer_size, envs[:, None]]
        after = self.next_observations["tactile"][batch_inds, envs][:, None]
        stacks = {"observations": frames, "next_observations": np.concatenate([frames[:, 1:], after], axis=1)}
        observed = {}
        for name, stack in stacks.items():
            stored = getattr(self, name)
            values = {key: stored[key][batch_inds, envs] for key in stored if key != "tactile"}
            values["tactile"] = stack.reshape(len(batch_inds), -1, *stack.shape[3:])
            values = self._normalize_obs(values, env)
            assert isinstance(values, dict)
            observed[name] = {key: self.to_torch(value) for key, value in values.items()}
        done = self.dones[batch_inds, envs] * (1 - self.timeouts[batch_inds, envs])
        return DictReplayBufferSamples(
            observations=observed["observations"],
            actions=self.to_torch(self.actions[batch_inds, envs]),
            next_observations=observed["next_observations"],
            dones=self.to_torch(done.reshape(-1, 1)),
            rewards=self.to_torch(self._normalize_reward(self.rewards[batch_inds, envs].reshape(-1, 1), env)),
        )
