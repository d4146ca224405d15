"""``python -m paxisim_insertion.evaluate --run runs/SX-2mm_GCS_0``: how often a policy succeeds, in robosuite."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path

import torch

import paxisim

from .env import InsertionEnv
from .gap import Gap
from .results import DRAWN, IN_SIMULATION, OUT, TRANSFER, Result, interval_of
from .run import Run, versions
from .shell import command
from .surrogate import unit
from .trained import Trained
from .transfer import sensors

FIRST_SEED = 1_000_000
"""Of the evaluation's episodes, which no training run uses."""


def evaluate(
    run: Path,
    *,
    trials: int = 50,
    sensor: str | Path | None = None,
    transfer: bool = False,
    drawn: bool = False,
    out: Path = OUT,
    other_versions: bool = False,
) -> None:
    """Evaluate a run's newest policy on fixed episodes, and write the result.

    Args:
        run: Folder of the run.
        trials: Episodes.
        sensor: A surrogate of a real sensor: a chain that paxisim saved, or reference:unit:N for the N-th unit of
            paxisim's magnetic pad, with +memory for a gel that creeps and +neighbour for the other pad's magnets.
            Default: what the method is trained with.
        transfer: Spread the episodes over 25 sensors that no training has seen, on a robot whose p_t is noisy and whose
            controller and joints are off, see Gap.
        drawn: Draw the actions, as in training, instead of taking the most likely ones.
        out: Folder of the result; .table looks there, too.
        other_versions: Evaluate although the software's versions are not the run's.
    """
    if trials < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial, got {trials}")
    if transfer + drawn + (sensor is not None) > 1:
        raise paxisim.InvalidValueError("expected one of --sensor, --transfer and --drawn")
    this = Run.open(run, other_versions=other_versions)
    chain = None if sensor is None else surrogate_of(str(sensor))
    env = this.insertion_env(sensor=chain, gap=Gap() if transfer else None, terminate_on_success=True)
    kinds: dict[str, list[bool]] = {}
    try:
        trained = this.policy(env)
        turns = sensors(env.layout) if transfer else []
        for trial in range(trials):
            kind = IN_SIMULATION
            if turns:
                stand_in = turns[trial % len(turns)]
                kind, env.sensor, env.surface = stand_in.kind, stand_in.chain, stand_in.surface
            kinds.setdefault(kind, []).append(succeeds(env, trained, FIRST_SEED + trial, drawn=drawn))
    finally:
        env.close()
    successes = sum(sum(found) for found in kinds.values())
    name = TRANSFER if transfer else DRAWN if drawn else IN_SIMULATION
    if sensor is not None:
        name = f"surrogate {Path(str(sensor).replace(':', '-')).stem}"
    interval = interval_of(successes, trials)
    training = {
        "steps": trained.steps,
        "updates": trained.updates,
        "cpu_seconds": round(trained.seconds),
        "envs": this.envs,
        "engine": this.engine,
        "batch": this.batch,
        "temperature": this.temperature,
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
    """The chain of a file, or what makes that of a unit of the magnetic pad, read in counts of 0.1 N.

    Raises:
        InvalidValueError: The file is no chain, or the text names no unit.
    """
    if not sensor.startswith("reference:"):
        return paxisim.Chain.load(sensor)
    name = sensor.removeprefix("reference:")
    paxisim.reference_sensor(name)  # says what is wrong with it before there is an environment
    return partial(unit, name)


def succeeds(env: InsertionEnv, trained: Trained, seed: int, *, drawn: bool = False) -> bool:
    """Whether the policy's most likely actions, or drawn ones, solve the episode of this seed."""
    torch.manual_seed(seed)
    observation, info = env.reset(seed=seed)
    terminated = truncated = False
    while not (terminated or truncated):
        observation, _, terminated, truncated, info = env.step(trained.act(observation, deterministic=not drawn))
    return bool(info["is_success"])


if __name__ == "__main__":
    sys.exit(command(evaluate))
