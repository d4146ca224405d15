"""``python -m paxisim_insertion.evaluate --run runs/SX-2mm_GCS_0``: success rate of a policy, in robosuite."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray

import paxisim

from .env import InsertionEnv
from .policy import Trained
from .results import DRAWN, FIRST_SEED, IN_SIMULATION, OUT, TRANSFER, Result, interval_of, sensor_name, versions
from .run import Run
from .shell import command
from .transfer import magnetic_unit, own_surface, sensors


def evaluate(
    run: Path,
    *,
    trials: int = 50,
    sensor: str | Path | None = None,
    transfer: bool = False,
    uneven: bool = False,
    drawn: bool = False,
    engine: Literal["robosuite", "native", "warp"] = "robosuite",
    out: Path = OUT,
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
        uneven: Give the units of the magnetic pad, of --sensor reference:unit:N or --transfer, the uneven surfaces of
            those units. The published figures are without.
        drawn: Sample the actions from the policy, as in training, instead of taking the most likely ones.
        engine: Engine of the simulation: robosuite's, the reference; plain MuJoCo; or MuJoCo Warp, with all episodes at
            once.
        out: Output folder, which paxisim_lab.table reads as well; created if missing.
    """
    if trials < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial, got {trials}")
    if transfer + drawn + (sensor is not None) > 1:
        raise paxisim.InvalidValueError("expected one of --sensor, --transfer and --drawn")
    if engine == "warp" and (transfer or drawn or sensor is not None):
        raise paxisim.InvalidValueError("expected --engine warp without --sensor, --transfer and --drawn")
    if uneven and not (transfer or sensor is not None):
        raise paxisim.InvalidValueError("expected --uneven with --transfer or --sensor reference:unit:N")
    this = Run.open(run)
    chain = None if sensor is None else surrogate_of(str(sensor))
    alone = "native" if engine == "warp" else engine
    env = this.insertion_env(sensor=chain, gap=transfer, engine=alone, terminate_on_success=True)
    try:
        if uneven and env.sensor is not None:
            env.surface = own_surface(env.sensor)
        trained = this.policy(env)
        if engine == "warp":
            solved = {IN_SIMULATION: _solved_on_warp(this, trained, trials)}
        else:
            solved = _solved(env, partial(trained.act, deterministic=not drawn), trials, transfer, uneven)
    finally:
        env.close()
    name = TRANSFER if transfer else DRAWN if drawn else IN_SIMULATION
    if sensor is not None:
        name = sensor_name(sensor)
    if uneven:
        name = f"{name}, uneven"
    if engine != "robosuite":
        name = f"{name}, {engine}"
    successes = sum(sum(found) for found in solved.values())
    interval = interval_of(successes, trials)
    parts = {kind: (sum(found), len(found)) for kind, found in solved.items()} if transfer else {}
    training = _made(this, trained)
    rate = successes / trials
    result = Result(this.task, this.name, name, this.seed, trials, rate, interval, versions(), training, parts)
    path = result.save(out)
    print(f"{this.task} {this.name} {name}: {successes} of {trials}, {interval[0]:.2f} to {interval[1]:.2f}; {path}")


def _solved(
    env: InsertionEnv,
    act: Callable[[dict[str, NDArray[np.float32]]], NDArray[np.float32]],
    trials: int,
    transfer: bool,
    uneven: bool,
) -> dict[str, list[bool]]:
    """Return which episodes a policy solves, by kind of sensor; in a transfer the sensors take turns."""
    kinds: dict[str, list[bool]] = {}
    turns = sensors(env.layout, uneven=uneven) if transfer else []
    for trial in range(trials):
        kind = IN_SIMULATION
        if turns:
            stand_in = turns[trial % len(turns)]
            kind, env.sensor, env.surface = stand_in.kind, stand_in.chain, stand_in.surface
        kinds.setdefault(kind, []).append(succeeds(env, act, FIRST_SEED + trial))
    return kinds


def _solved_on_warp(run: Run, trained: Trained, trials: int) -> list[bool]:
    """Return which episodes a policy solves on MuJoCo Warp, one in each world."""
    from .warp_env import InsertionWarpEnv

    if run.ranges.parameters:
        raise paxisim.UnsupportedError("MuJoCo Warp's engine does not draw what a diagnosis found in the scene")
    worlds = InsertionWarpEnv(trials, task=run.task, method=run.method, gcs=run.gcs, parameters=run.parameters)
    return worlds.solved(trained.act_together, range(FIRST_SEED, FIRST_SEED + trials))


def _made(run: Run, trained: Trained) -> dict[str, Any]:
    """Return the steps, settings and cost of a training, for its results."""
    return {
        "steps": trained.steps,
        "updates": trained.updates,
        "cpu_seconds": round(trained.seconds),
        "envs": run.envs,
        "engine": "native",
        "batch": run.batch,
        "temperature": run.temperature,
        "reward_scale": run.reward_scale,
        "redraw": run.redraw,
        "parameters": asdict(run.parameters),
        "model": [] if run.diagnosis is None else list(run.diagnosis.model.names),
    }


def surrogate_of(sensor: str) -> paxisim.Chain | Callable[[paxisim.TaxelLayout], paxisim.Chain]:
    """Load a chain from a file, or return a factory for a unit of the magnetic pad, read in counts of 0.1 N.

    Raises:
        InvalidValueError: The file is not a chain, or the text does not name a unit.
    """
    if not sensor.startswith("reference:"):
        return paxisim.Chain.load(sensor)
    name = sensor.removeprefix("reference:")
    paxisim.reference_sensor(name)  # raises before an environment is built
    return partial(magnetic_unit, name)


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
