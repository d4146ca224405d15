"""Trained: a policy that acts and the cost of its training, small enough to store beside its results.

Only weights and numbers are read from a folder, never Python objects: a pickle in a shared folder could run any code.
"""

from __future__ import annotations

import json
import os
import pickle
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import SAC
from stable_baselines3.common.save_util import load_from_zip_file
from torch import nn

import paxisim

from .env import InsertionEnv
from .policy import AsymmetricPolicy

ACTOR = "actor.pt"
"""File name of an actor without critic, optimisers and replay buffer."""

NOT_WEIGHTS = (
    RuntimeError,
    LookupError,
    TypeError,
    ValueError,
    AttributeError,
    EOFError,
    zipfile.BadZipFile,
    pickle.UnpicklingError,
)
"""Exceptions raised for a file with other weights or without weights."""


@dataclass(frozen=True)
class Trained:
    """A policy that acts.

    Attributes:
        policy: stable-baselines3's policy. The critic is untrained if the policy was loaded from a file.
        steps: Environment steps of the training.
        updates: Updates of the training.
        seconds: CPU seconds of the training; 0 if unknown.
    """

    policy: AsymmetricPolicy
    steps: int
    updates: int
    seconds: float = 0.0

    @classmethod
    def of(cls, model: SAC) -> Trained:
        """Return the policy of a model in training."""
        assert isinstance(model.policy, AsymmetricPolicy)
        return cls(model.policy, model.num_timesteps, model._n_updates)

    def act(self, observation: dict[str, NDArray[np.float32]], *, deterministic: bool = True) -> NDArray[np.float32]:
        """Return the most likely action, or one sampled from the policy."""
        return self.policy.predict(observation, deterministic=deterministic)[0]  # type: ignore[arg-type]

    def act_together(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return the most likely actions ``(worlds, axes)`` for observations of many worlds, on their device."""
        self.policy.to(observations["p"].device)
        self.policy.set_training_mode(False)
        with torch.no_grad():
            return self.policy.actor(observations, deterministic=True)

    def save(self, folder: Path) -> Path:
        """Write the actor to `ACTOR` in a folder, atomically."""
        return save_actor(folder, self.policy.actor, self.steps, self.updates, self.seconds)

    @classmethod
    def load(cls, folder: Path, env: InsertionEnv) -> Trained:
        """Load the actor that `save` wrote.

        Raises:
            InvalidValueError: The file is not an actor, or the actor was trained on other observations.
        """
        path = folder / ACTOR
        return _fitted(path, env, lambda: torch.load(path, map_location="cpu", weights_only=True))

    @classmethod
    def of_model(cls, path: Path, env: InsertionEnv) -> Trained:
        """Load the actor of a training's ``model.zip``: only its weights, none of the Python objects beside them.

        Raises:
            InvalidValueError: The file is not a model, or the model was trained on other observations.
        """

        def read() -> dict[str, Any]:
            weights: Any = load_from_zip_file(path, device="cpu", load_data=False)[1]
            actor = {
                name.removeprefix("actor."): value
                for name, value in weights["policy"].items()
                if name.startswith("actor.")
            }
            counts = counts_of(path)
            return {"actor": actor, "steps": counts["num_timesteps"], "updates": counts["_n_updates"]}

        return _fitted(path, env, read)


def save_actor(folder: Path, actor: nn.Module, steps: int, updates: int, seconds: float) -> Path:
    """Write an actor and the cost of its training to `ACTOR` in a folder, atomically."""
    path = folder / ACTOR
    new = path.with_suffix(".new")
    torch.save({"steps": steps, "updates": updates, "seconds": seconds, "actor": actor.state_dict()}, new)
    os.replace(new, path)
    return path


def counts_of(model: Path) -> dict[str, int]:
    """Return the integers stored in a ``model.zip`` beside its weights, such as the step count, without unpickling.

    Raises:
        LookupError, ValueError, zipfile.BadZipFile: The file is not a model.
    """
    with zipfile.ZipFile(model) as archive:
        document = json.loads(archive.read("data"))
    return {name: value for name, value in document.items() if type(value) is int}


def _fitted(path: Path, env: InsertionEnv, read: Callable[[], dict[str, Any]]) -> Trained:
    actions: Any = env.action_space
    policy = AsymmetricPolicy(env.observation_space, actions, lambda _: 0.0)
    try:
        found = read()
        policy.actor.load_state_dict(found["actor"])
        seconds = float(found.get("seconds", 0.0))
        return Trained(policy, int(found["steps"]), int(found["updates"]), seconds)
    except NOT_WEIGHTS as error:
        raise paxisim.InvalidValueError(
            f"{path} is not an actor for {env.observation_space}; perhaps its layout, k or task differ: {error}"
        ) from error
