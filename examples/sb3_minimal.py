"""Train with Stable-Baselines3 on tactile observations with GCS, in ten seconds on one core.

PPO learns to hold a peg with 7 N by touch, in the environment of `gcs_in_gymnasium.py`. Needs the extra train:

    python examples/sb3_minimal.py
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

sys.path.insert(0, str(Path(__file__).parent))

from gcs_in_gymnasium import make_env


def main(steps: int = 3000) -> tuple[float, float]:
    """Train, and evaluate before and after.

    Args:
        steps: Number of environment steps.

    Returns:
        Mean return of an episode before and after training; 0 is perfect.
    """
    torch.set_num_threads(1)
    env = Monitor(gymnasium.wrappers.FlattenObservation(make_env()))
    model = PPO("MlpPolicy", env, n_steps=100, batch_size=50, learning_rate=3e-3, gamma=0.5, seed=0)
    before, _ = evaluate_policy(model, env, n_eval_episodes=10)
    model.learn(steps)
    after, _ = evaluate_policy(model, env, n_eval_episodes=10)
    print(f"mean return of an episode: {before:.2f} before, {after:.2f} after {steps} steps")
    assert np.isfinite(after)
    return float(before), float(after)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=3000)
    main(parser.parse_args().steps)
