"""The paper's policy for stable-baselines3's SAC: the actor sees p_t and touch, the critic sees the true poses.

In the actor (Section "RL Policy" and appendix) a CNN of four layers with batch normalisation maps the tactile history
to 128 features, one layer maps p_t to 128 features, and two layers of 256 follow. The critic has two layers of 256 on
the privileged poses. Neither sees the inputs of the other.
"""

from __future__ import annotations

from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import Actor, SACPolicy
from torch import nn

from .encoder import FEATURES, POSE_SCALE, tactile_encoder
from .env import PRIVILEGED


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

    def action_log_prob(self, obs: Any) -> tuple[torch.Tensor, torch.Tensor]:
        """Return actions and their log probabilities."""
        training = self.training
        if not torch.is_grad_enabled():
            self.set_training_mode(False)
        try:
            return super().action_log_prob(obs)
        finally:
            self.set_training_mode(training)


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
