"""``python -m paxisim_insertion.evaluate --run runs/SX-2mm_GCS_0``: success rate of a policy, in robosuite."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray

import paxisim

from .env import InsertionEnv
from .gap import Gap
from .results import DRAWN, IN_SIMULATION, OUT, TRANSFER, Result, interval_of, sensor_name
from .results import FIRST_SEED as FIRST_SEED
from .run import Run, versions
from .shell import command
from .surrogate import unit
from .transfer import sensors


def evaluate(
    run: Path,
    *,
    trials: int = 50,
    sensor: str | Path | None = None,
    transfer: bool = False,
    drawn: bool = False,
    engine: Literal["robosuite", "native", "warp"] = "robosuite",
    out: Path = OUT,
    other_versions: bool = False,
) -> None:
    """Evaluate a run's newest policy on fixed episodes and write the result.

    Args:
        run: Folder of the run.
        trials: Number of episodes.
        sensor: A surrogate of a real sensor: a chain saved by paxisim, or reference:unit:N for the N-th unit of
            paxisim's magnetic pad, with +memory for a gel that creeps and +neighbour for the other pad's magnets.
            Default: the sensor that the method is trained with.
        transfer: Spread the episodes over 25 sensors that no training has seen, on a robot with a noisy p_t and a
            miscalibrated controller and joints, see Gap.
        drawn: Sample the actions from the policy, as in training, instead of taking the most likely ones.
        engine: Engine of the simulation: robosuite's, the reference; plain MuJoCo; or MuJoCo Warp, with all episodes at
            once.
        out: Output folder, which .table reads as well; created if missing.
        other_versions: Accept a run made with other software versions.
    """
    if trials < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial, got {trials}")
    if transfer + drawn + (sensor is not None) > 1:
        raise paxisim.InvalidValueError("expected one of --sensor, --transfer and --drawn")
    if engine == "warp" and (transfer or drawn or sensor is not None):
        raise paxisim.InvalidValueError("expected --engine warp without --sensor, --transfer and --drawn")
    this = Run.open(run, other_versions=other_versions)
    chain = None if sensor is None else surrogate_of(str(sensor))
    gap = Gap() if transfer else None
    alone = "native" if engine == "warp" else engine
    env = this.insertion_env(sensor=chain, gap=gap, engine=alone, terminate_on_success=True)
    kinds: dict[str, list[bool]] = {}
    try:
        trained = this.policy(env)
        if engine == "warp":
            from .warp_scene import be_quiet

            be_quiet()
            seeds = range(FIRST_SEED, FIRST_SEED + trials)
            kinds[IN_SIMULATION] = this.warp_env(trials).solved(trained.act_together, seeds)
        else:
            turns = sensors(env.layout) if transfer else []
            act = partial(trained.act, deterministic=not drawn)
            for trial in range(trials):
                kind = IN_SIMULATION
                if turns:
                    stand_in = turns[trial % len(turns)]
                    kind, env.sensor, env.surface = stand_in.kind, stand_in.chain, stand_in.surface
                kinds.setdefault(kind, []).append(succeeds(env, act, FIRST_SEED + trial))
    finally:
        env.close()
    successes = sum(sum(found) for found in kinds.values())
    name = TRANSFER if transfer else DRAWN if drawn else IN_SIMULATION
    if sensor is not None:
        name = sensor_name(sensor)
    if engine != "robosuite":
        name = f"{name}, {engine}"
    interval = interval_of(successes, trials)
    training = {
        "steps": trained.steps,
        "updates": trained.updates,
        "cpu_seconds": round(trained.seconds),
        "envs": this.envs,
        "engine": this.engine,
        "batch": this.batch,
        "temperature": this.temperature,
        "reward_scale": this.reward_scale,
        "redraw": this.redraw,
        "parameters": asdict(this.parameters),
        "model": [] if this.diagnosis is None else list(this.diagnosis.model.names),
    }
    parts = {kind: (sum(found), len(found)) for kind, found in kinds.items()} if transfer else {}
    rate = successes / trials
    result = Result(this.task, this.name, name, this.seed, trials, rate, interval, versions(), training, parts)
    path = result.save(out)
    print(f"{this.task} {this.name} {name}: {successes} of {trials}, {interval[0]:.2f} to {interval[1]:.2f}; {path}")


def surrogate_of(sensor: str) -> paxisim.Chain | Callable[[paxisim.TaxelLayout], paxisim.Chain]:
    """Load a chain from a file, or return a factory for a unit of the magnetic pad, read in counts of 0.1 N.

    Raises:
        InvalidValueError: The file is not a chain, or the text does not name a unit.
    """
    if not sensor.startswith("reference:"):
        return paxisim.Chain.load(sensor)
    name = sensor.removeprefix("reference:")
    paxisim.reference_sensor(name)  # raises before an environment is built
    return partial(unit, name)


def succeeds(
    env: InsertionEnv, act: Callable[[dict[str, NDArray[np.float32]]], NDArray[np.float32]], seed: int
) -> bool:
    """Return whether a policy, a function from observations to actions, solves the episode of this seed."""
    torch.manual_seed(seed)
    observation, info = env.reset(seed=seed)
    terminated = truncated = False
    while not (terminated or truncated):
        observation, _, terminated, truncated, info = env.step(act(observation))
    return bool(info["is_success"])


if __name__ == "__main__":
    sys.exit(command(evaluate))
