"""``python -m paxisim_insertion.train --task SX-2mm --method GCS --seed 0``: asymmetric SAC, which can be killed."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import set_random_seed

from .methods import find_method
from .run import BUFFER, Run
from .shell import command
from .tasks import Parameters

PARAMETERS = Parameters()


def train(
    task: str = "SX-2mm",
    method: str = "GCS",
    seed: int = 0,
    *,
    steps: int = 300_000,
    envs: int = 4,
    out: Path | None = None,
    resume: bool = False,
    other_versions: bool = False,
    save_every: float = 30.0,
    buffer: int = BUFFER,
    redraw: bool = True,
    parameters: Parameters = PARAMETERS,
    threads: int = 1,
    device: str = "auto",
) -> None:
    """Train a policy; go on with --resume after whatever ended it.

    Args:
        task: Name of the task.
        method: Name of the method.
        seed: Seed of networks, environments and exploration.
        steps: Environment steps in all.
        envs: Environments that collect at the same time, each in a process of its own; there is one update for a step
            of all of them.
        out: Folder of the run. Default: runs/TASK_METHOD_SEED.
        resume: Go on with the run that is there; what it is was settled when it began.
        other_versions: Go on although the software's versions are not the run's.
        save_every: Seconds between two saved models; of what was experienced nothing is lost.
        buffer: Transitions in the replay buffer.
        redraw: Draw GCS anew for each sample of the replay buffer too; the paper draws once an episode.
        parameters: What the paper leaves open.
        threads: Threads of torch.
        device: Torch's device.
    """
    folder = out or Path("runs") / f"{task}_{method}_{seed}".replace(" ", "-").replace("/", "")
    if resume:
        run = Run.open(folder, other_versions=other_versions)
    else:
        draws = redraw and find_method(method).gcs is not None
        run = Run(folder, task, method, seed, envs, buffer, redraw=draws, parameters=parameters)
        run.create()
    torch.set_num_threads(threads)
    env = run.make_envs()
    try:
        model = run.model(env, device)
        done = model.num_timesteps
        # other episodes than those before the end that it is resumed from
        start = run.seed_after(done)
        set_random_seed(start)
        env.seed(start)
        model.set_logger(configure(str(folder / f"log_{done}"), ["csv", "tensorboard"]))
        print(f"{run.task} {run.method} seed {run.seed}: {done} of {steps} steps done, in {folder}", flush=True)
        if done < steps:
            progress = Progress(run, steps, save_every)
            model.learn(steps - done, callback=progress, reset_num_timesteps=False, log_interval=10)
        run.save(model)
        model.logger.close()
    finally:
        env.close()


class Progress(BaseCallback):
    """Saves the model from time to time, and says how it goes."""

    def __init__(self, run: Run, steps: int, save_every: float) -> None:
        """For a run of so many steps in all."""
        super().__init__()
        self._run, self._steps, self._save_every = run, steps, save_every
        self._saved = self._began = time.monotonic()
        self._first = 0

    def _on_training_start(self) -> None:
        self._first = self.num_timesteps

    def _on_step(self) -> bool:
        now = time.monotonic()
        if now - self._saved >= self._save_every:
            self._run.save(self.model)  # type: ignore[arg-type]
            self._saved = time.monotonic()
            rate = (self.num_timesteps - self._first) / (now - self._began)
            left = (self._steps - self.num_timesteps) / max(rate, 1e-9) / 3600
            successes = self.model.ep_success_buffer
            told = f"success {np.mean(successes):.2f} of {len(successes)} episodes" if successes else "no episode yet"
            print(f"{self.num_timesteps} steps, {rate:.1f} a second, {left:.1f} h left; {told}", flush=True)
        return True


if __name__ == "__main__":
    sys.exit(command(train))
