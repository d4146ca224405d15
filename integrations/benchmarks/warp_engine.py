"""The tasks on MuJoCo Warp against the native engine: `python integrations/benchmarks/warp_engine.py`.

A noisy expert acts in the native engine, and the worlds get the same actions. Readings are not randomised. The columns
are those of `paxisim_insertion.engines`, which compares the native engine with robosuite's. `--nudge` compares the
native engine with itself after the fingertip was moved by 1e-7 m, which shows what any rounding error grows to.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray
from paxisim_insertion import TASKS, InsertionEnv
from paxisim_insertion.engines import NOISE
from paxisim_insertion.env import PRIVILEGED
from paxisim_insertion.expert import expert_action
from paxisim_insertion.results import FIRST_SEED
from paxisim_insertion.warp_env import InsertionWarpEnv
from paxisim_insertion.warp_scene import be_quiet


def differences(task: str, episodes: int, steps: int, nudge: bool) -> NDArray[np.floating]:
    """Return L1 of the taxels, distance of the pegs (mm) and largest difference of a pad's sum (N), ``(3, rows)``."""
    seeds = range(FIRST_SEED, FIRST_SEED + episodes)
    natives = [InsertionEnv(task, "DT", engine="native") for _ in seeds]
    nudged = [InsertionEnv(task, "DT", engine="native") for _ in seeds] if nudge else []
    worlds = None if nudge else InsertionWarpEnv(episodes, task=task, method="DT")
    rngs = [np.random.default_rng(seed) for seed in seeds]
    for env, seed in zip([*natives, *nudged], [*seeds, *seeds], strict=False):
        env.reset(seed=seed)
    for env in nudged:
        env.scene.model_and_data[1].qpos[0] += 1e-7
    if worlds is not None:
        worlds.reset(seed=seeds)
    rows = []
    for _ in range(min(steps, natives[0].task.max_steps - 1)):
        actions = np.stack(
            [
                np.clip(expert_action(env) + rng.normal(0, NOISE, len(env.task.axes)), -1, 1)
                for env, rng in zip(natives, rngs, strict=True)
            ]
        )
        told = [env.step(action)[0][PRIVILEGED][:3] for env, action in zip(natives, actions, strict=True)]
        readings = np.stack([env.reading for env in natives])
        if worlds is None:
            others = [env.step(action)[0][PRIVILEGED][:3] for env, action in zip(nudged, actions, strict=True)]
            found = np.stack([env.reading for env in nudged])
        else:
            observation = worlds.step(actions)[0]
            others = observation[PRIVILEGED][:, :3].cpu().numpy()
            found = observation["tactile"][:, -6:].reshape(readings.shape).cpu().numpy()
        for index in range(episodes):
            one, two = readings[index], found[index]
            sums = np.abs((one - two).sum(axis=(-2, -1))).max()
            apart = 1e3 * np.linalg.norm(told[index] - others[index])
            rows.append((np.abs(one - two).sum() / np.abs(one).sum(), apart, sums))
    return np.array(rows).T


def main() -> None:
    """Print a row per task."""
    parser = argparse.ArgumentParser(description="The tasks on MuJoCo Warp against the native engine.")
    parser.add_argument("--tasks", nargs="+", default=list(TASKS))
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--nudge", action="store_true")
    options = parser.parse_args()
    be_quiet()
    print("| task | taxels, L1: median | 95 % | peg (mm): median | 95 % | sum of a pad (N): median | 95 % |")
    print("|---|---|---|---|---|---|---|")
    for task in options.tasks:
        measured = differences(task, options.episodes, options.steps, options.nudge)
        cells = [f"{np.median(values):.2g} | {np.quantile(values, 0.95):.2g}" for values in measured]
        print(f"| {task} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
