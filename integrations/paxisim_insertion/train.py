"""``python -m paxisim_insertion.train --task SX-2mm --method GCS --seed 0``: train with asymmetric SAC."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import set_random_seed

import paxisim

from .learner import average_of, make_model
from .policy import save_actor
from .replay import HistoryReplayBuffer, can_redraw
from .results import RUNS, folder_of
from .run import BUFFER, REWARD_SCALE, TEMPERATURE, Run
from .shell import command
from .tasks import PARAMETERS, Parameters

STEPS = 300_000


def train(
    task: str = "SX-2mm",
    method: str = "GCS",
    seed: int = 0,
    *,
    steps: int | None = None,
    envs: int = 20,
    updates: float = 0.25,
    batch: int = 128,
    temperature: float = TEMPERATURE,
    reward_scale: float = REWARD_SCALE,
    until: float | None = None,
    actor_every: int = 1,
    out: Path | None = None,
    resume: bool = False,
    save_every: float = 30.0,
    buffer: int = BUFFER,
    model: Path | None = None,
    per_episode: bool = False,
    parameters: Parameters = PARAMETERS,
    device: str = "auto",
) -> None:
    """Train a policy in the native engine, on one core. After an interruption, --resume continues the run.

    Args:
        task: Name of the task.
        method: Name of the method.
        seed: Random seed of networks, environments and exploration.
        steps: Total number of environment steps. Default: 300,000, or those of the run that is resumed.
        envs: Number of environments that collect transitions in parallel.
        updates: Network updates per environment step; the ratio is rounded to whole numbers of updates and steps.
        batch: Transitions per update.
        temperature: Initial temperature of SAC.
        reward_scale: Factor of the reward in training.
        until: Success rate at which the training ends, over the last 100 episodes, whose actions are sampled. Default:
            make all steps. With --resume it replaces that of the run.
        actor_every: Updates of the critics for one of the actor.
        out: Folder of the run; created if missing. Default: runs/TASK_METHOD_SEED, with _fitted appended for --model.
        resume: Continue an existing run with the settings it was started with.
        save_every: Seconds between two checkpoints, of the model and the transitions.
        buffer: Capacity of the replay buffer in transitions.
        model: Folder of a diagnosis written by paxisim diagnose. Its sensor model, drawn within its intervals for each
            episode, replaces the randomisation of the method. What it found in the scene is drawn as well.
        per_episode: Draw GCS once per episode, as the paper does. Default: draw it again for each sample of the replay
            buffer, unless the model has memory, such as creep, or needs the gripper's opening.
        parameters: Values that the paper does not specify.
        device: Torch device.
    """
    folder = out or RUNS / (folder_of(task, method, seed) + ("" if model is None else "_fitted"))
    if resume:
        run = Run.open(folder, resume=True)
        run = run if until is None else replace(run, until=until)
        steps = run.steps if steps is None else steps
    else:
        steps = STEPS if steps is None else steps
        found, ranges = None, paxisim.SceneRanges()
        if model is not None:
            found = load_diagnosis(model)
            ranges = paxisim.SceneRanges.around(found.scene, found.scene_intervals)
        run = Run(
            folder,
            task,
            method,
            seed,
            envs,
            buffer,
            reward_scale,
            steps=steps,
            updates=updates,
            batch=batch,
            temperature=temperature,
            until=until,
            actor_every=actor_every,
            parameters=parameters,
            diagnosis=found,
            ranges=ranges,
        )
        run = replace(run, redraw=not per_episode and can_redraw(run.gcs))
        if found is not None:
            run.insertion_env().close()  # raises for a model that does not fit, before the folder is created
        run.create()
    torch.set_num_threads(1)
    env = run.make_envs()
    try:
        sac = make_model(run, env, device)
        done = sac.num_timesteps
        # a resumed run gets other episodes than it had before
        start = run.seed_after(done)
        set_random_seed(start)
        env.seed(start)
        sac.set_logger(configure(str(folder / f"log_{done}"), ["csv", "tensorboard"]))
        print(f"{run.task} {run.name} seed {run.seed}: {done} of {steps} steps done, in {folder}", flush=True)
        progress = Progress(run, sac, steps, save_every)
        if progress.ended:
            print(f"ended at a success of {run.until:.2f}: pass a larger --until to continue", flush=True)
        elif done < steps:
            sac.learn(steps - done, callback=progress, reset_num_timesteps=False, log_interval=10)
        progress.save()
        sac.logger.close()
    finally:
        env.close()


def load_diagnosis(folder: Path) -> paxisim.diagnose.Diagnosis:
    """Load a diagnosis that has a model from its folder.

    Raises:
        InvalidValueError: The path is a file, or the diagnosis names no cause.
        FileNotFoundError: The folder has no diagnosis.
    """
    if folder.is_file():
        raise paxisim.InvalidValueError(f"expected the folder of a diagnosis, got the file {folder}")
    found = paxisim.diagnose.Diagnosis.load(folder)
    if not len(found.model) and not found.scene_values:
        raise paxisim.InvalidValueError(
            f"the diagnosis in {folder} names no cause (its verdict is {found.verdict}), so there is no model to train "
            "on: leave out --model"
        )
    return found


class Progress(BaseCallback):
    """Saves the model at intervals, prints the progress, and ends the training at the success of the run's `until`.

    Attributes:
        ended: Whether that success was reached.
    """

    def __init__(self, run: Run, model: SAC, steps: int, save_every: float) -> None:
        """Take the run, its newest model, the total number of steps and the seconds between saves."""
        super().__init__()
        self._run, self._sac, self._steps, self._save_every = run, model, steps, save_every
        self._saved = self._began = time.monotonic()
        self._first = 0
        self._average, seconds, success = average_of(run, model)
        self.ended = run.until is not None and success >= run.until
        self._success = success
        self._averaged, self._cpu_began = model._n_updates, time.process_time() - seconds

    def save(self) -> None:
        """Save the transitions, the model and the average of the actors."""
        self._take_in()
        buffer = self._sac.replay_buffer
        assert isinstance(buffer, HistoryReplayBuffer)
        buffer.flush()
        self._run.save(self._sac)
        seconds = time.process_time() - self._cpu_began
        counts = {"steps": self._sac.num_timesteps, "updates": self._sac._n_updates}
        save_actor(self._run.folder, self._average.actor, {**counts, "seconds": seconds, "success": self._success})

    def _on_training_start(self) -> None:
        self._first = self.num_timesteps

    def _on_rollout_start(self) -> None:
        self._take_in()

    def _take_in(self) -> None:
        new = self._sac._n_updates - self._averaged
        if new > 0:
            self._average.add(self._sac.actor, new)
            self._averaged += new

    def _on_step(self) -> bool:
        now, successes = time.monotonic(), self.model.ep_success_buffer
        whole = successes is not None and len(successes) == successes.maxlen
        self._success = float(np.mean(successes)) if whole else 0.0  # type: ignore[arg-type]
        self.ended = self._run.until is not None and self._success >= self._run.until
        if now - self._saved >= self._save_every or self.ended:
            self.save()
            self._saved = time.monotonic()
            rate = (self.num_timesteps - self._first) / (now - self._began)
            left = (self._steps - self.num_timesteps) / max(rate, 1e-9) / 3600
            success = (
                f"success {np.mean(successes):.2f} of {len(successes)} episodes" if successes else "no episode yet"
            )
            rest = "ended" if self.ended else f"{left:.1f} h left"
            print(f"{self.num_timesteps} steps, {rate:.1f} a second, {rest}; {success}", flush=True)
        return not self.ended


if __name__ == "__main__":
    sys.exit(command(train))
