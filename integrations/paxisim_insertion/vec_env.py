"""InsertionVecEnv: many native environments in one process, with batched computations."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

import paxisim

from .chains import stack_chains
from .engines.native import NativeScene
from .env import CONTROL_DT, InsertionEnv
from .observations import RAW, observed_poses
from .reward import insertion, reward_terms, weighted


class InsertionVecEnv(VecEnv):
    """A stable-baselines3 vector environment of one task and method.

    Each environment matches an `InsertionEnv` of the native engine with the same seed, up to rounding. All episodes
    have the same length: they begin and end together, and new ones begin at once.

    Attributes:
        envs: The environments, which provide the scenes and the random numbers.
    """

    def __init__(self, envs: Sequence[InsertionEnv], *, reward_scale: float = 1.0) -> None:
        """Combine environments with the same options.

        Args:
            envs: Environments of the native engine without sensor, gap and ``terminate_on_success``.
            reward_scale: Factor of the reward; the returns in ``infos`` are not scaled.

        Raises:
            InvalidValueError: There is no environment, or one has another engine, a sensor, a gap or
                ``terminate_on_success``.
        """
        if not envs or not all(isinstance(env.scene, NativeScene) for env in envs):
            raise paxisim.InvalidValueError("expected at least one environment, all with engine='native'")
        if any(env.stand_in is not None or env.has_gap or env.terminates for env in envs):
            raise paxisim.InvalidValueError("expected environments without sensor=, gap= and terminate_on_success=")
        self.envs = list(envs)
        count, first = len(envs), envs[0]
        self._scale, self._axes = reward_scale, list(first.task.axes)
        self._scenes: list[Any] = [env.scene for env in envs]
        self._poses = [_poses(scene) for scene in self._scenes]
        self._history = first.method.history(first.task, first.layout)
        self._force = np.zeros((count, *first.reading.shape), dtype=np.float32)
        self._chain: paxisim.Chain = paxisim.Chain([])
        self._state: Any = ()
        self._home, self._actions = np.zeros((count, 3)), np.zeros((count, len(self._axes)))
        self._steps, self._began = 0, time.time()
        self._succeeded, self._return = np.zeros(count, dtype=bool), np.zeros(count)
        super().__init__(count, first.observation_space, first.action_space)

    def reset(self) -> dict[str, NDArray[np.float32]]:
        """Begin an episode in each environment, with the seeds set by `seed`."""
        for env, seed in zip(self.envs, self._seeds, strict=True):
            if seed is not None:
                env.np_random = seeding.np_random(seed)[0]
        self._reset_seeds()
        return self._begin()

    def step_async(self, actions: NDArray[np.floating]) -> None:
        """Set the actions ``(environments, axes)`` of the next step."""
        self._actions = np.clip(np.asarray(actions, dtype=float), -1, 1)

    def step_wait(
        self,
    ) -> tuple[dict[str, NDArray[np.float32]], NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Apply the actions for 50 ms."""
        first = self.envs[0]
        goals = self._home.copy()
        goals[:, self._axes] = self._read_poses()[0][:, self._axes] + first.task.action_scale * self._actions
        for scene, goal in zip(self._scenes, goals, strict=True):
            scene.aim(goal)
        for index, scene in enumerate(self._scenes):
            scene.advance()
            self._force[index] = scene.tactile.read()
        self._steps += 1
        self._feel(CONTROL_DT)
        poses = self._read_poses()
        state = insertion(first.task, first.parameters, poses[2] - first.scene.base, poses[3])
        reward = weighted(reward_terms(state, self._actions, first.parameters.epsilon))
        self._succeeded |= state.success
        self._return += reward
        observation = self._observe(poses)
        infos: list[dict[str, Any]] = [{"is_success": bool(success)} for success in self._succeeded]
        done = self._steps >= first.task.max_steps
        if done:
            for index, info in enumerate(infos):
                info["TimeLimit.truncated"] = True
                info["terminal_observation"] = {name: value[index] for name, value in observation.items()}
                episode = {"r": self._return[index], "l": self._steps, "t": time.time() - self._began}
                info["episode"] = {name: round(float(value), 6) for name, value in episode.items()}
            observation = self._begin()
        return observation, (self._scale * reward).astype(np.float32), np.full(self.num_envs, done), infos

    def close(self) -> None:
        """Close the environments."""
        for env in self.envs:
            env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the environments."""
        return [getattr(self.envs[index], attr_name) for index in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the environments."""
        for index in self._get_indices(indices):
            setattr(self.envs[index], attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of the environments."""
        return [getattr(self.envs[index], method_name)(*args, **kwargs) for index in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each environment: none is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def _begin(self) -> dict[str, NDArray[np.float32]]:
        self._chain = stack_chains([env.begin() for env in self.envs])
        for index, scene in enumerate(self._scenes):
            self._force[index] = scene.tactile.read()
        poses = self._read_poses()
        self._home = poses[0]
        self._steps, self._succeeded, self._return = 0, np.zeros_like(self._succeeded), np.zeros_like(self._return)
        self._history.reset()
        self._state = self._chain.initial_state(self._force, self._covariates())
        self._feel(0.0)
        return self._observe(poses)

    def _feel(self, dt: float) -> None:
        force, self._state = self._chain.step(self._force, self._state, dt, self._covariates())
        self._history.append(np.asarray(force, dtype=np.float32))

    def _covariates(self) -> dict[str, Any]:
        if not self._chain.covariate_names:
            return {}
        return {"gripper_opening": np.array([scene.opening for scene in self._scenes])}

    def _read_poses(self) -> list[NDArray[np.floating]]:
        """Return position and rotation of the fingertips, then of the pegs."""
        return [np.array(views) for views in zip(*self._poses, strict=True)]

    def _observe(self, poses: list[NDArray[np.floating]]) -> dict[str, NDArray[np.float32]]:
        observation = observed_poses(self._scenes[0], *poses)
        if "tactile" in self.envs[0].observation_space.spaces:
            observation["tactile"] = self._history.read()
        if RAW in self.envs[0].observation_space.spaces:
            observation[RAW] = self._force.copy()
        return observation


def _poses(scene: NativeScene) -> tuple[NDArray[np.floating], ...]:
    """Return views of MuJoCo's position and rotation of the fingertip, then of the peg."""
    _, data = scene.model_and_data
    site, body = scene.grip_site, scene.peg_body
    return (
        data.site_xpos[site],
        data.site_xmat[site].reshape(3, 3),
        data.xpos[body],
        data.xmat[body].reshape(3, 3),
    )
