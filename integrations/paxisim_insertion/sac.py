"""AsymmetricSAC: stable-baselines3's SAC with an update that computes nothing twice and nothing that no one uses."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3 import SAC
from torch.nn import functional as F


class AsymmetricSAC(SAC):
    """SAC (Haarnoja et al., 2018) with the same losses as stable-baselines3's, in fewer operations.

    The gradient of the actor's loss is taken for the actor's weights alone: stable-baselines3 also computes that of
    both critics, and discards it. Losses are read only for the log.

    Args:
        actor_every: Updates of the critics for one of the actor and the temperature. 1 is SAC; with 2 the actor waits
            for the critics, as in TD3 (Fujimoto et al., 2018).
    """

    def __init__(self, *args: Any, actor_every: int = 1, **kwargs: Any) -> None:
        """Create the networks; see `stable_baselines3.SAC`."""
        self.actor_every = actor_every
        super().__init__(*args, **kwargs)

    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        """Make a number of updates."""
        self.policy.set_training_mode(True)
        self._update_learning_rate([self.actor.optimizer, self.critic.optimizer, self.ent_coef_optimizer])  # type: ignore[list-item]
        critic_loss = actor_loss = torch.zeros(())
        for _ in range(gradient_steps):
            data: Any = self.replay_buffer.sample(batch_size, env=self._vec_normalize_env)  # type: ignore[union-attr]
            temperature = self.log_ent_coef.detach().exp()  # type: ignore[union-attr]
            critic_loss = self._critic_loss(data, temperature)
            self.critic.optimizer.zero_grad()
            critic_loss.backward()
            self.critic.optimizer.step()
            if self._n_updates % self.actor_every == 0:
                actor_loss = self._update_actor(data.observations, temperature)
            with torch.no_grad():
                for target, moving in zip(self.critic_target.parameters(), self.critic.parameters(), strict=True):
                    target.lerp_(moving, self.tau)
            self._n_updates += 1
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")
        self.logger.record("train/ent_coef", float(np.exp(self.log_ent_coef.item())))  # type: ignore[union-attr]
        self.logger.record("train/actor_loss", float(actor_loss))
        self.logger.record("train/critic_loss", float(critic_loss.detach()))

    def _critic_loss(self, data: Any, temperature: torch.Tensor) -> torch.Tensor:
        with torch.no_grad():
            actions, log_prob = self.actor.action_log_prob(data.next_observations)
            after = torch.minimum(*self.critic_target(data.next_observations, actions))
            after -= temperature * log_prob[:, None]
            target = data.rewards + (1 - data.dones) * self.gamma * after
        values = self.critic(data.observations, data.actions)
        return 0.5 * sum(F.mse_loss(value, target) for value in values)  # type: ignore[return-value]

    def _update_actor(self, observations: Any, temperature: torch.Tensor) -> torch.Tensor:
        """Update the actor, then the temperature."""
        actions, log_prob = self.actor.action_log_prob(observations)
        value = torch.minimum(*self.critic(observations, actions))
        loss = (temperature * log_prob[:, None] - value).mean()
        weights = list(self.actor.parameters())
        for weight, gradient in zip(weights, torch.autograd.grad(loss, weights), strict=True):
            weight.grad = gradient
        self.actor.optimizer.step()
        optimizer: Any = self.ent_coef_optimizer
        self.log_ent_coef.grad = -(log_prob.detach().mean() + self.target_entropy).reshape(1)  # type: ignore[union-attr]
        optimizer.step()
        return loss.detach()
