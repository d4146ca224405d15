"""InsertionVectorEnv: many native environments in one process, as a gymnasium vector environment."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

import paxisim

from .env import InsertionEnv
from .vec_env import InsertionVecEnv


class InsertionVectorEnv(VectorEnv):
    """`InsertionVecEnv` with gymnasium's interface: ``gymnasium.make_vec("paxisim/SX-2mm-v0", num_envs=20)``.

    All episodes have the same length, and new ones begin at once: a step that ends the episodes returns the first
    observations of the next ones, and the last observations in ``infos["final_obs"]``.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012 - gymnasium's own

    def __init__(self, num_envs: int = 1, *, threads: int = 1, **options: Any) -> None:
        """Build the environments.

        Args:
            num_envs: Number of environments.
            threads: Number of threads for the physics.
            **options: Options of `InsertionEnv`; the engine is the native one.

        Raises:
            InvalidValueError: There are no environments, or an option is only valid for a single environment.
        """
        if options.pop("render_mode", None) is not None or options.setdefault("engine", "native") != "native":
            raise paxisim.InvalidValueError("expected engine='native' and no render_mode for a vector environment")
        self._many = InsertionVecEnv([InsertionEnv(**options) for _ in range(num_envs)], threads=threads)
        first = self._many.envs[0]
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = first.observation_space, first.action_space
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.action_space = batch_space(first.action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, NDArray[np.float32]], dict[str, Any]]:
        """Begin an episode in each environment, with `seed`, `seed` + 1 and so on, or one seed per environment."""
        if isinstance(seed, Sequence):
            if len(seed) != self.num_envs:
                raise paxisim.InvalidValueError(f"expected {self.num_envs} seeds, got {len(seed)}")
            self._many._seeds = list(seed)
        elif seed is not None:
            self._many.seed(int(seed))
        return self._many.reset(), self._told(np.zeros(self.num_envs, dtype=bool))

    def step(  # type: ignore[override]
        self, actions: NDArray[np.floating]
    ) -> tuple[
        dict[str, NDArray[np.float32]],
        NDArray[np.float64],
        NDArray[np.bool_],
        NDArray[np.bool_],
        dict[str, Any],
    ]:
        """Apply the actions for 50 ms."""
        observation: Any
        observation, reward, done, ended = self._many.step(np.asarray(actions))
        succeeded = np.array([info["is_success"] for info in ended])
        infos = self._told(succeeded & ~done)
        if done.all():
            for index, info in enumerate(ended):
                last = {"final_obs": info["terminal_observation"], "final_info": {"is_success": info["is_success"]}}
                infos = self._add_info(infos, last, index)
        return observation, reward.astype(np.float64), np.zeros_like(done), done, infos

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the threads."""
        self._many.close()

    def _told(self, succeeded: NDArray[np.bool_]) -> dict[str, Any]:
        return {"is_success": succeeded, "_is_success": np.ones(self.num_envs, dtype=bool)}
