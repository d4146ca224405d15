"""``python -m paxisim_insertion.train_warp --task SX-2mm --worlds 4096``: train with rsl-rl's PPO on MuJoCo Warp."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

import paxisim

from .encoder import LAYERS
from .env import InsertionEnv
from .evaluate import succeeds
from .results import FIRST_SEED, RUNS, folder_of, interval_of
from .shell import command
from .tasks import PARAMETERS, Parameters
from .warp_env import InsertionWarpEnv, Observation
from .warp_scene import be_quiet
from .whole import write_whole


def train_warp(
    task: str = "SX-2mm",
    method: str = "GCS",
    seed: int = 0,
    *,
    worlds: int = 4096,
    iterations: int = 500,
    horizon: int = 24,
    reward_scale: float = 1e-4,
    save_every: int = 50,
    trials: int = 50,
    out: Path | None = None,
    parameters: Parameters = PARAMETERS,
    device: str | None = None,
) -> None:
    """Train a policy with rsl-rl's PPO, and count in how many episodes it succeeds in both engines.

    Args:
        task: Name of the task.
        method: Name of the method.
        seed: Random seed of networks, episodes and exploration.
        worlds: Number of worlds.
        iterations: Number of PPO's iterations, each of `horizon` steps of all worlds.
        horizon: Steps of each world per iteration.
        reward_scale: Factor of the reward in training. Returns should be of the order of 1, as rsl-rl's PPO clips the
            changes of its value function at 0.2.
        save_every: Iterations between two saved models.
        trials: Episodes in which the trained policy, with its most likely actions, is tried in both engines, or 0.
        out: Output folder; created if missing. Default: runs/TASK_METHOD_SEED_ppo.
        parameters: Values that the paper does not specify.
        device: Warp's name of the device, e.g. cuda:0 or cpu. Default: the first GPU, or the CPU.
    """
    for name, value in {"iterations": iterations, "horizon": horizon, "save_every": save_every}.items():
        if value < 1:
            raise paxisim.InvalidValueError(f"{name} must be at least 1, got {value}")
    if trials < 0:
        raise paxisim.InvalidValueError(f"trials must be at least 0, got {trials}")
    out = out or RUNS / f"{folder_of(task, method, seed)}_ppo"
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise paxisim.OutputExistsError(f"{out} exists already: choose another folder")
    be_quiet()
    try:
        from rsl_rl.runners import OnPolicyRunner  # type: ignore - not where robosuite is

        from .rsl_env import RslEnv
    except ImportError as error:
        raise paxisim.UnsupportedError(f"PPO needs rsl-rl: pip install rsl-rl-lib ({error})") from error
    env = InsertionWarpEnv(worlds, task=task, method=method, parameters=parameters, device=device)
    torch.manual_seed(seed)
    wrapped = RslEnv(env, seed=seed, reward_scale=reward_scale)
    settings = _settings(wrapped, horizon, save_every)
    out.mkdir(parents=True, exist_ok=True)
    told = {"task": task, "method": method, "seed": seed, "worlds": worlds, "reward_scale": reward_scale}
    told |= {"settings": settings, "parameters": asdict(parameters)}
    write_whole(out / "ppo.json", json.dumps(told, indent=1) + "\n")
    runner = OnPolicyRunner(wrapped, settings, log_dir=str(out), device=wrapped.device)
    runner.learn(iterations)
    if trials:
        actor = runner.get_inference_policy(wrapped.device)

        def act(observation: Observation) -> torch.Tensor:
            with torch.inference_mode():
                return actor(wrapped.grouped(observation))

        compare(act, task, method, parameters, trials, device)


def compare(
    act: Callable[[Observation], torch.Tensor],
    task: str,
    method: str,
    parameters: Parameters,
    trials: int,
    device: str | None = None,
) -> None:
    """Print in how many of the same episodes a policy succeeds in MuJoCo Warp and in the native engine."""
    seeds = range(FIRST_SEED, FIRST_SEED + trials)
    many = InsertionWarpEnv(trials, task=task, method=method, parameters=parameters, device=device)
    found = {"MuJoCo Warp": many.solved(act, seeds)}
    env = InsertionEnv(task, method, engine="native", parameters=parameters, terminate_on_success=True)

    def alone(observation: dict[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        return act({n: torch.as_tensor(v, device=many.device)[None] for n, v in observation.items()})[0].cpu().numpy()

    found["native"] = [succeeds(env, alone, seed) for seed in seeds]
    for engine, solved in found.items():
        low, high = interval_of(sum(solved), trials)
        print(f"{task} {method}, {engine}: {sum(solved)} of {trials}, {low:.2f} to {high:.2f}")


def _settings(env: Any, horizon: int, save_every: int) -> dict[str, Any]:
    """Return rsl-rl's settings: its defaults of PPO, with networks of the sizes that SAC trains here."""
    image = any(len(env.get_observations()[name].shape) == 4 for name in env.actor)
    channels, strides = (list(values) for values in zip(*LAYERS, strict=True))
    layers = {"hidden_dims": [256, 256], "activation": "relu"}
    convolutions = {
        "output_channels": channels,
        "kernel_size": 3,
        "stride": strides,
        "padding": "zeros",
        "activation": "relu",
    }
    actor: dict[str, Any] = {**layers, "class_name": "CNNModel" if image else "MLPModel"}
    actor["distribution_cfg"] = {"class_name": "GaussianDistribution", "init_std": 0.5}
    if image:
        actor["cnn_cfg"] = convolutions
    return {
        "num_steps_per_env": horizon,
        "save_interval": save_every,
        "obs_groups": {"actor": env.actor, "critic": env.critic},
        "actor": actor,
        "critic": {**layers, "class_name": "MLPModel"},
        "algorithm": {"class_name": "PPO"},
    }


if __name__ == "__main__":
    sys.exit(command(train_warp))
