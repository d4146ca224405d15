"""Trained: a policy that acts, and what its training cost; small enough to be kept beside its results."""

from __future__ import annotations

import os
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import SAC

import paxisim

from .env import InsertionEnv
from .policy import AsymmetricPolicy

ACTOR = "actor.pt"
"""The file of an actor without critic, optimisers and replay buffer."""


@dataclass(frozen=True)
class Trained:
    """A policy that acts.

    Attributes:
        policy: stable-baselines3's policy; of one that was loaded from `ACTOR` the critic means nothing.
        steps: Environment steps of its training.
        updates: Updates of its training.
    """

    policy: AsymmetricPolicy
    steps: int
    updates: int

    @classmethod
    def of(cls, model: SAC) -> Trained:
        """The policy of a model in training."""
        assert isinstance(model.policy, AsymmetricPolicy)
        return cls(model.policy, model.num_timesteps, model._n_updates)

    def act(self, observation: dict[str, NDArray[np.float32]], *, deterministic: bool = True) -> NDArray[np.float32]:
        """The most likely action, or one that is drawn."""
        return self.policy.predict(observation, deterministic=deterministic)[0]  # type: ignore[arg-type]

    def save(self, folder: Path) -> Path:
        """Write the actor to `ACTOR` in a folder, whole or not at all."""
        path = folder / ACTOR
        new = path.with_suffix(".new")
        document: dict[str, Any] = {"steps": self.steps, "updates": self.updates}
        torch.save({**document, "actor": self.policy.actor.state_dict()}, new)
        os.replace(new, path)
        return path

    @classmethod
    def load(cls, folder: Path, env: InsertionEnv) -> Trained:
        """The actor that `save` wrote.

        Raises:
            InvalidValueError: It is not one, or was trained on other observations.
        """
        path = folder / ACTOR
        actions: Any = env.action_space
        policy = AsymmetricPolicy(env.observation_space, actions, lambda _: 0.0)
        try:
            found = torch.load(path, map_location="cpu", weights_only=True)
            policy.actor.load_state_dict(found["actor"])
            return cls(policy, found["steps"], found["updates"])
        except (RuntimeError, KeyError, TypeError, ValueError, EOFError, pickle.UnpicklingError) as error:
            raise paxisim.InvalidValueError(f"{path} is no actor for {env.observation_space}: {error}") from error
