"""Average: a running mean of the actors of a training run, which is the actor that the run saves."""

from __future__ import annotations

import copy

import torch
from torch import nn

SHARE = 0.005
"""Weight of an update in the average, as in SAC's target networks: the average spans about 200 updates."""


class Average:
    """A running mean of an actor's weights and of its batch normalisation statistics.

    A policy fluctuates while it learns: within a hundred updates one on SX-2mm went from 19 of 20 episodes to 10 and
    back. The mean keeps the result of a training from depending on the update at which it happens to end.

    Attributes:
        actor: The mean, as an actor.
    """

    def __init__(self, actor: nn.Module) -> None:
        """Start the mean at an actor."""
        self.actor = copy.deepcopy(actor).requires_grad_(False)

    def add(self, actor: nn.Module, updates: int) -> None:
        """Add an actor to the mean, with the number of updates since the last one."""
        share = 1 - (1 - SHARE) ** updates
        new = actor.state_dict()
        with torch.no_grad():
            for name, mean in self.actor.state_dict().items():
                if mean.is_floating_point():
                    mean.lerp_(new[name], share)
                else:
                    mean.copy_(new[name])
