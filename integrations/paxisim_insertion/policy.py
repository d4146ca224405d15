"""The paper's policy for stable-baselines3's SAC: the actor feels and sees little, the critic knows the poses.

The actor (Section "RL Policy" and appendix): the tactile history through a CNN of four layers with batch normalisation
to 128 numbers, p_t through one layer to 128, both through two layers of 256. The critic: two layers of 256 on the
privileged poses. Neither sees what is the other's.
"""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import Actor, SACPolicy
from torch import nn

from .env import PRIVILEGED

FEATURES = 128
"""Size of each encoder's output (paper)."""

LAYERS = ((32, 2), (32, 1), (64, 2), (64, 1))
"""Channels and stride of the CNN's layers, 3x3 kernels all: our choice. Without strides an update takes three times as
long on a CPU."""

POSE_SCALE = 100.0
"""Poses enter the networks in cm and centiradian, as a layer learns slowly from inputs of some thousandths."""


class ActorFeatures(BaseFeaturesExtractor):
    """What the actor makes of an observation: ``p`` and ``tactile``, never the privileged part.

    Attributes:
        tactile: The tactile encoder, None for a method without.
        pose: The encoder of p_t, and of a tactile vector (TF, CoP) beside it.
    """

    def __init__(self, observation_space: spaces.Dict) -> None:
        """Build the encoders that the observation needs."""
        space = observation_space.spaces.get("tactile")
        shape = space.shape if space is not None else None
        is_image = shape is not None and len(shape) == 3
        super().__init__(observation_space, FEATURES * (2 if is_image else 1))
        vector = shape[0] if shape is not None and not is_image else 0
        self.pose = nn.Sequential(nn.Linear(6 + vector, FEATURES), nn.ReLU())
        self.tactile = tactile_encoder(*shape) if shape is not None and is_image else None
        self._has_vector = vector > 0

    def forward(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        """``(batch, features)``."""
        pose = POSE_SCALE * observations["p"]
        if self._has_vector:
            pose = torch.cat([pose, observations["tactile"]], dim=1)
        features = self.pose(pose)
        if self.tactile is None:
            return features
        return torch.cat([features, self.tactile(observations["tactile"])], dim=1)


class CriticFeatures(BaseFeaturesExtractor):
    """What the critic sees: the poses."""

    def __init__(self, observation_space: spaces.Dict) -> None:
        """Nothing to learn here."""
        shape = observation_space.spaces[PRIVILEGED].shape
        assert shape is not None
        super().__init__(observation_space, shape[0])

    def forward(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        """``(batch, 12)``."""
        return POSE_SCALE * observations[PRIVILEGED]


class AsymmetricActor(Actor):
    """The actor; its batch normalisation learns from the actor's own update and from nothing else.

    SAC asks the actor twice in an update: for the actions of the states, whose gradient trains it, and, without
    gradient, for those of the next states, which make the critic's target. With batch statistics the target would
    depend on what else is in the batch, and the running statistics would mix both. So the second runs as it does when
    it acts.
    """

    def action_log_prob(self, obs: Any) -> tuple[torch.Tensor, torch.Tensor]:
        """Actions and their log probabilities."""
        training = self.training
        if not torch.is_grad_enabled():
            self.set_training_mode(False)
        try:
            return super().action_log_prob(obs)
        finally:
            self.set_training_mode(training)


class AsymmetricPolicy(SACPolicy):
    """stable-baselines3's SAC policy with these features. It takes no ``features_extractor_class`` of its own."""

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> AsymmetricActor:
        """The actor on its features."""
        assert isinstance(self.observation_space, spaces.Dict)
        features = features_extractor or ActorFeatures(self.observation_space)
        return AsymmetricActor(**self._update_features_extractor(self.actor_kwargs, features)).to(self.device)

    def make_critic(self, features_extractor: BaseFeaturesExtractor | None = None) -> ContinuousCritic:
        """A critic, or its target, on its features."""
        assert isinstance(self.observation_space, spaces.Dict)
        features = features_extractor or CriticFeatures(self.observation_space)
        return ContinuousCritic(**self._update_features_extractor(self.critic_kwargs, features)).to(self.device)


def tactile_encoder(channels: int, rows: int, cols: int) -> nn.Sequential:
    """The CNN: ``(batch, channels, rows, cols)`` to ``(batch, 128)``."""
    layers: list[nn.Module] = []
    for size, stride in LAYERS:
        layers += [nn.Conv2d(channels, size, 3, stride, padding=1, bias=False), nn.BatchNorm2d(size), nn.ReLU()]
        channels, rows, cols = size, -(-rows // stride), -(-cols // stride)
    return nn.Sequential(*layers, nn.Flatten(), nn.Linear(channels * rows * cols, FEATURES), nn.ReLU())
