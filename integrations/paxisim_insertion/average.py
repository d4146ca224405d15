"""Average: the actor that a training leaves, a running mean of those it had."""

from __future__ import annotations

import copy

import torch
from torch import nn

SHARE = 0.005
"""Of an update in the average, as in SAC's own target networks: it spans some two hundred updates."""


class Average:
    """A running mean of an actor's weights and of the statistics of its batch normalisation.

    A policy that learns swings: within a hundred updates one of SX-2mm went from 19 of 20 episodes to 10 and back. What
    such a training should leave is no matter of the update that it happens to end with.

    Attributes:
        actor: The mean, as an actor.
    """

    def __init__(self, actor: nn.Module) -> None:
        """Begin with an actor as it is."""
        self.actor = copy.deepcopy(actor).requires_grad_(False)

    def add(self, actor: nn.Module, updates: int) -> None:
        """Take in an actor that has been updated so many times since the last."""
        share = 1 - (1 - SHARE) ** updates
        new = actor.state_dict()
        with torch.no_grad():
            for name, mean in self.actor.state_dict().items():
                if mean.is_floating_point():
                    mean.lerp_(new[name], share)
                else:
                    mean.copy_(new[name])
