"""The paper's policy for stable-baselines3's SAC, and a trained one that acts.

The actor sees p_t and touch, the critic sees the true poses.

In the actor (Section "RL Policy" and appendix) a CNN of four layers with batch normalisation maps the tactile history
to 128 features, one layer maps p_t to 128 features, and two layers of 256 follow. The critic has two layers of 256 on
the privileged poses. Neither sees the inputs of the other.
"""

from __future__ import annotations

import math
import os
import pickle
import zipfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import Actor, SACPolicy
from torch import nn

import paxisim

from .env import InsertionEnv
from .observations import PRIVILEGED

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

FEATURES = 128
"""Output size of each encoder (paper)."""

LAYERS = ((32, 2), (32, 1), (64, 2), (64, 1))
"""Channels and stride of the CNN's layers, all with 3x3 kernels: our choice. Without strides an update takes three
times as long on a CPU."""

SQUASHED = 1e-6
"""Keeps the logarithm of tanh's slope finite, as in stable-baselines3."""

POSE_SCALE = 100.0
"""Factor that converts poses to cm and centiradian: a layer learns slowly from inputs of a few thousandths."""


def tactile_encoder(channels: int, rows: int, cols: int) -> nn.Sequential:
    """Build the CNN that maps ``(batch, channels, rows, cols)`` to ``(batch, 128)``."""
    layers: list[nn.Module] = []
    for size, stride in LAYERS:
        layers += [nn.Conv2d(channels, size, 3, stride, padding=1, bias=False), nn.BatchNorm2d(size), nn.ReLU()]
        channels, rows, cols = size, -(-rows // stride), -(-cols // stride)
    return nn.Sequential(*layers, nn.Flatten(), nn.Linear(channels * rows * cols, FEATURES), nn.ReLU())


class ActorFeatures(BaseFeaturesExtractor):
    """Features of the actor, from ``p`` and ``tactile`` and never from the privileged part of the observation.

    Attributes:
        tactile: Encoder of tactile images; None for a method without them.
        pose: Encoder of p_t together with a tactile vector (TF, CoP), if there is one.
    """

    def __init__(self, observation_space: spaces.Dict) -> None:
        """Build the encoders for an observation space."""
        space = observation_space.spaces.get("tactile")
        shape = space.shape if space is not None else None
        is_image = shape is not None and len(shape) == 3
        super().__init__(observation_space, FEATURES * (2 if is_image else 1))
        vector = shape[0] if shape is not None and not is_image else 0
        self.pose = nn.Sequential(nn.Linear(6 + vector, FEATURES), nn.ReLU())
        self.tactile = tactile_encoder(*shape) if shape is not None and is_image else None
        self._has_vector = vector > 0

    def forward(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return the features ``(batch, features)``."""
        pose = POSE_SCALE * observations["p"]
        if self._has_vector:
            pose = torch.cat([pose, observations["tactile"]], dim=1)
        features = self.pose(pose)
        if self.tactile is None:
            return features
        return torch.cat([features, self.tactile(observations["tactile"])], dim=1)


class CriticFeatures(BaseFeaturesExtractor):
    """Features of the critic: the privileged poses."""

    def __init__(self, observation_space: spaces.Dict) -> None:
        """Create the extractor; it has nothing to learn."""
        shape = observation_space.spaces[PRIVILEGED].shape
        assert shape is not None
        super().__init__(observation_space, shape[0])

    def forward(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return the scaled poses ``(batch, 12)``."""
        return POSE_SCALE * observations[PRIVILEGED]


class AsymmetricActor(Actor):
    """An actor whose batch normalisation learns from the actor's own update only.

    SAC evaluates the actor twice per update: on the states, with gradients that train the actor, and on the next
    states, without gradients, for the critic's target. With batch statistics the target would depend on the rest of the
    batch, and the running statistics would mix both passes. The second pass therefore runs in evaluation mode.
    """

    @cached_property
    def _norms(self) -> list[nn.Module]:
        """The modules that behave differently in training; `set_training_mode` walks through all, which is slow."""
        return [module for module in self.modules() if isinstance(module, nn.BatchNorm2d)]

    def action_log_prob(self, obs: Any) -> tuple[torch.Tensor, torch.Tensor]:
        """Return actions drawn from the policy, a Gaussian squashed by tanh, and their log probabilities."""
        norms = [] if torch.is_grad_enabled() else self._norms
        for norm in norms:
            norm.training = False
        try:
            mean, log_std, _ = self.get_action_dist_params(obs)
        finally:
            for norm in norms:
                norm.training = self.training
        noise = torch.randn_like(mean)
        action = torch.tanh(mean + log_std.exp() * noise)
        log_prob = -0.5 * (noise**2 + math.log(2 * math.pi)) - log_std - torch.log(1 - action**2 + SQUASHED)
        return action, log_prob.sum(dim=1)


class AsymmetricPolicy(SACPolicy):
    """stable-baselines3's SAC policy with these feature extractors; ``features_extractor_class`` is ignored."""

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> AsymmetricActor:
        """Build the actor on its features."""
        assert isinstance(self.observation_space, spaces.Dict)
        features = features_extractor or ActorFeatures(self.observation_space)
        return AsymmetricActor(**self._update_features_extractor(self.actor_kwargs, features)).to(self.device)

    def make_critic(self, features_extractor: BaseFeaturesExtractor | None = None) -> ContinuousCritic:
        """Build a critic, or its target network, on its features."""
        assert isinstance(self.observation_space, spaces.Dict)
        features = features_extractor or CriticFeatures(self.observation_space)
        return ContinuousCritic(**self._update_features_extractor(self.critic_kwargs, features)).to(self.device)


@dataclass(frozen=True)
class Trained:
    """A policy that acts.

    Attributes:
        policy: stable-baselines3's policy. Its critic is untrained.
        steps: Environment steps of the training.
        updates: Updates of the training.
        seconds: CPU seconds of the training; 0 if unknown.
        success: Success rate of the last 100 training episodes; 0 if unknown or if there were fewer.
    """

    policy: AsymmetricPolicy
    steps: int
    updates: int
    seconds: float
    success: float = 0.0

    @classmethod
    def load(cls, folder: Path, env: InsertionEnv) -> Trained:
        """Load the actor that `save_actor` wrote: only weights and numbers, as a pickle could run any code.

        Raises:
            InvalidValueError: There is no actor yet, or it was trained on other observations.
        """
        path = folder / ACTOR
        if not path.exists():
            raise paxisim.InvalidValueError(f"{folder} has no actor yet: train it first")
        actions: Any = env.action_space
        policy = AsymmetricPolicy(env.observation_space, actions, lambda _: 0.0)
        try:
            found = torch.load(path, map_location="cpu", weights_only=True)
            policy.actor.load_state_dict(found["actor"])
            more = (float(found.get(name, 0.0)) for name in ("seconds", "success"))
            return cls(policy, int(found["steps"]), int(found["updates"]), *more)
        except NOT_WEIGHTS as error:
            raise paxisim.InvalidValueError(
                f"{path} is not an actor for {env.observation_space}; perhaps its layout, k or task differ: {error}"
            ) from error

    def act(self, observation: dict[str, NDArray[np.float32]], *, deterministic: bool = True) -> NDArray[np.float32]:
        """Return the most likely action, or one sampled from the policy."""
        return self.policy.predict(observation, deterministic=deterministic)[0]  # type: ignore[arg-type]

    def act_together(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return the most likely actions ``(worlds, axes)`` for observations of many worlds, on their device."""
        self.policy.to(observations["p"].device)
        self.policy.set_training_mode(False)
        with torch.no_grad():
            return self.policy.actor(observations, deterministic=True)


def save_actor(folder: Path, actor: nn.Module, numbers: dict[str, float]) -> None:
    """Write an actor and numbers about its training, see `Trained`, to `ACTOR` in a folder, atomically."""
    new = folder / f"{ACTOR}.new"
    torch.save({**numbers, "actor": actor.state_dict()}, new)
    os.replace(new, folder / ACTOR)
