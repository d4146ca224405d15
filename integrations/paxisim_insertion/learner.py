"""Learner: the SAC model of a run, new or restored from where the run ended, and the running mean of its actors."""

from __future__ import annotations

import copy
import json
import zipfile
from pathlib import Path

import torch
from stable_baselines3 import SAC
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.vec_env import VecEnv
from torch import nn

import paxisim

from .policy import ACTOR, NOT_WEIGHTS, AsymmetricPolicy
from .replay import HistoryReplayBuffer, Redraw
from .run import Run
from .sac import AsymmetricSAC

SHARE = 0.005
"""Weight of an update in the average, as in SAC's target networks: the average spans about 200 updates."""


WINDOW = 100
"""Episodes of the success rate that is logged and that ends a training."""


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


def make_model(run: Run, env: VecEnv, device: str = "auto") -> SAC:
    """Restore the run's newest model, or create its first; the replay buffer is stored in the run's folder.

    Only the weights, the optimisers' states and the counts are read from ``model.zip``, and none of its pickles. The
    rest of a model follows from the run's settings.

    Raises:
        InvalidValueError: The model was made for other observations, such as those of another layout or k.
    """
    # SAC counts a step of all environments as one, and makes whole numbers of updates
    due = run.updates * run.envs
    redraw = _redraw(run, env)
    model = AsymmetricSAC(
        AsymmetricPolicy,
        env,
        train_freq=max(1, round(1 / due)),
        gradient_steps=max(1, round(due)),
        ent_coef=f"auto_{run.temperature}",
        policy_kwargs={"optimizer_kwargs": {"fused": True}},  # same optimiser steps, fewer passes over the weights
        actor_every=run.actor_every,
        stats_window_size=WINDOW,
        buffer_size=run.buffer,
        batch_size=run.batch,
        replay_buffer_class=HistoryReplayBuffer,
        replay_buffer_kwargs={"history": env.get_attr("history")[0].k, "redraw": redraw},
        seed=run.seed,
        device=device,
    )
    if run.model_path.exists():
        try:
            _go_on(run, model)
            if redraw is not None:  # the draws of the beginning are not repeated
                redraw.seed(run.seed_after(model.num_timesteps))
        except NOT_WEIGHTS as error:
            raise paxisim.InvalidValueError(f"{run.model_path} does not fit the environment: {error}") from error
    buffer = model.replay_buffer
    assert isinstance(buffer, HistoryReplayBuffer)
    buffer.keep_in(run.folder / "replay")
    return model


def average_of(run: Run, model: SAC) -> tuple[Average, float, float]:
    """Restore the average of a training's actors, or start a new one from the actor of `model`.

    Returns:
        The average, the CPU seconds of the training so far, and its success rate, see `Trained`.
    """
    seconds = success = 0.0
    average = Average(model.actor)
    path = run.folder / ACTOR
    if path.exists():
        try:
            found = torch.load(path, map_location=model.device, weights_only=True)
            average.actor.load_state_dict(found["actor"])
            seconds, success = (float(found.get(name, 0.0)) for name in ("seconds", "success"))
        except NOT_WEIGHTS as error:
            raise paxisim.InvalidValueError(f"{path} does not fit the environment: {error}") from error
    return average, seconds, success


def _go_on(run: Run, model: SAC) -> None:
    """Restore the weights and counts of the newest model."""
    model.set_parameters(str(run.model_path), device=model.device)
    _, _, tensors = load_from_zip_file(run.model_path, device=model.device, load_data=False)
    assert isinstance(model.log_ent_coef, torch.Tensor)
    with torch.no_grad():
        model.log_ent_coef.copy_((tensors or {})["log_ent_coef"])
    counts = _counts(run.model_path)
    for name in ("num_timesteps", "_n_updates", "_episode_num"):
        setattr(model, name, counts[name])


def _counts(model: Path) -> dict[str, int]:
    """Return the integers stored in a ``model.zip`` beside its weights, such as the step count, without unpickling.

    Raises:
        LookupError, ValueError, zipfile.BadZipFile: The file is not a model.
    """
    with zipfile.ZipFile(model) as archive:
        document = json.loads(archive.read("data"))
    return {name: value for name, value in document.items() if type(value) is int}


def _redraw(run: Run, env: VecEnv) -> Redraw | None:
    gcs = run.gcs
    if not run.redraw or gcs is None:
        return None
    return Redraw(gcs, env.get_attr("history")[0].encoding, env.get_attr("layout")[0], run.seed)
