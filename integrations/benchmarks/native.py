"""Speed of the native engine: steps per CPU second relative to robosuite's, including resets, in one run.

``python integrations/benchmarks/native.py``. Each round runs whole episodes with two 6x5 pads, GCS and its history, on
random actions: as many native ones as in a training, in one vectorised environment, then one in robosuite. The last
line shows the cost of a training step.
"""

import logging
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from paxisim_insertion import TASKS, InsertionEnv
from paxisim_insertion.learner import make_model
from paxisim_insertion.run import Run
from paxisim_insertion.vec_env import InsertionVecEnv
from stable_baselines3.common.logger import configure

ROUNDS, ENVS = 5, 20
DOWN = 0.2  # fraction of the largest action, so that pegs land on their bases


def actions(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Draw random actions with a downward drift."""
    drawn = rng.normal(0, 0.3, shape)
    drawn[..., -1] -= DOWN
    return np.clip(drawn, -1, 1)


def robosuite_seconds(env: InsertionEnv, seed: int) -> float:
    """Return the CPU seconds per step of an episode."""
    rng, start = np.random.default_rng(seed), time.process_time()
    env.reset(seed=seed)
    for _ in range(env.task.max_steps):
        env.step(actions(rng, env.action_space.shape))
    return (time.process_time() - start) / env.task.max_steps


def native_seconds(env: InsertionVecEnv, seed: int) -> float:
    """Return the CPU seconds per step of one environment, including the ends and starts of episodes."""
    rng, start = np.random.default_rng(seed), time.process_time()
    for _ in range(env.envs[0].task.max_steps):
        env.step(actions(rng, (env.num_envs, *env.action_space.shape)))
    return (time.process_time() - start) / (env.num_envs * env.envs[0].task.max_steps)


def share_of_physics(env: InsertionVecEnv, seed: int) -> float:
    """Return MuJoCo's share of the CPU time of a step, without resets."""
    rng, inside = np.random.default_rng(seed), 0.0
    env.reset()

    def timed(advance):  # type: ignore[no-untyped-def]
        def run() -> None:
            nonlocal inside
            start = time.thread_time()
            advance()
            inside += time.thread_time() - start

        return run

    for member in env.envs:
        member.scene.advance = timed(member.scene.advance)
    start = time.process_time()
    for _ in range(env.envs[0].task.max_steps - 1):
        env.step(actions(rng, (env.num_envs, *env.action_space.shape)))
    total = time.process_time() - start
    for member in env.envs:
        del member.scene.advance
    return inside / total


def training() -> None:
    """Print the cost of a training step, once learning has started."""
    torch.set_num_threads(1)
    with TemporaryDirectory() as folder:
        run = Run(Path(folder), "SX-2mm", "GCS", envs=ENVS, batch=128, buffer=20_000)
        env = run.make_envs()
        model = make_model(run, env, "cpu")
        model.set_logger(configure(None, []))
        model.learn(2400)
        seconds, observed = {}, env.reset()
        for name, count, work in (
            ("environment", 10 * ENVS, lambda: [env.step(np.zeros((ENVS, 2))) for _ in range(10)]),
            ("acting", 10 * ENVS, lambda: [model.predict(observed, deterministic=False) for _ in range(10)]),
            ("update of 128", 20, lambda: model.train(20, 128)),
            ("update of 256", 20, lambda: model.train(20, 256)),
        ):
            start = time.process_time()
            work()
            seconds[name] = (time.process_time() - start) / count
        env.close()
    summary = ", ".join(f"{name} {1e3 * value:.2f} ms" for name, value in seconds.items())
    print(f"\nSX-2mm, GCS, CPU time of a training: a step's {summary}")


def main() -> None:
    """Print the table."""
    logging.getLogger("robosuite_logs").setLevel(logging.ERROR)
    print(
        "| task | robosuite, ms a step | native | steps per CPU second, robosuite = 1 (least and most of a round) ",
        end="",
    )
    print("| MuJoCo's share of native |\n|---|---|---|---|---|")
    for task in TASKS:
        reference = InsertionEnv(task, "GCS")
        native = InsertionVecEnv([InsertionEnv(task, "GCS", engine="native") for _ in range(ENVS)])
        native.reset()
        rounds = [(robosuite_seconds(reference, seed), native_seconds(native, seed)) for seed in range(ROUNDS)]
        slow, fast = np.array(rounds).T
        gains = slow / fast
        print(
            f"| {task} | {1e3 * np.median(slow):.2f} | {1e3 * np.median(fast):.2f} | {np.median(gains):.1f} "
            f"({gains.min():.1f} to {gains.max():.1f}) | {share_of_physics(native, 0):.2f} |",
            flush=True,
        )
        reference.close()
        native.close()
    training()


if __name__ == "__main__":
    main()
