"""``python -m paxisim_lab.loads``: how unevenly the taxels are loaded, in training and on the sensors of a transfer."""

from __future__ import annotations

import sys

import numpy as np
from paxisim_insertion.env import InsertionEnv
from paxisim_insertion.results import FIRST_SEED
from paxisim_insertion.shell import command
from paxisim_insertion.tasks import PARAMETERS, Parameters
from paxisim_insertion.transfer import KINDS, StandIn, sensors

import paxisim

UNLOADED = 0.02
"""Largest normal force (N) of a taxel that counts as unloaded: a fiftieth of its share of the grip."""


def loads(
    task: str = "SX-2mm",
    *,
    methods: tuple[str, ...] = ("GCS", "GCS w/o G"),
    episodes: int = 50,
    parameters: Parameters = PARAMETERS,
) -> None:
    """Print the loads of the taxels when the fingers have closed on the peg.

    For each pad and episode: the standard deviation of the normal forces over their mean; the share of the taxels that
    carry no load; and the share that read nothing, because S dropped them or because the load is too small.

    Args:
        task: Name of the task.
        methods: Methods whose training is shown.
        episodes: Number of episodes.
        parameters: Values that the paper does not specify, for the trainings: the gel above all.
    """
    if episodes < 1:
        raise paxisim.InvalidValueError(f"expected at least one episode, got {episodes}")
    print(f"| {task} | std / mean of the loads | 5 to 95 % | unloaded taxels | silent taxels |\n|---|---|---|---|---|")
    for method in methods:
        env = InsertionEnv(task, method, engine="native", parameters=parameters)
        print(f"| training, {method} | {_row(env, [None] * episodes)} |", flush=True)
    for kind in KINDS:
        env = InsertionEnv(task, "DT", engine="native", parameters=parameters)
        turns = sensors(kind, env.layout, episodes)
        print(f"| transfer {kind} | {_row(env, [turns[i % len(turns)] for i in range(episodes)])} |", flush=True)


def _row(env: InsertionEnv, turns: list[StandIn] | list[None]) -> str:
    """Return a row of the table, of one episode with each of these sensors."""
    spread, unloaded, silent = [], [], []
    for number, stand_in in enumerate(turns):
        env.stand_in = stand_in
        env.reset(seed=FIRST_SEED + number)
        for force, reading in zip(env.raw, env.reading, strict=True):
            spread.append(force[2].std() / force[2].mean())
            unloaded.append(np.mean(force[2] < UNLOADED))
            silent.append(np.mean(np.all(reading == 0, axis=0)))
    env.close()
    low, high = np.quantile(spread, (0.05, 0.95))
    return f"{np.mean(spread):.2f} | {low:.2f} to {high:.2f} | {np.mean(unloaded):.0%} | {np.mean(silent):.0%}"


if __name__ == "__main__":
    sys.exit(command(loads))
