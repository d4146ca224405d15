"""``python -m paxisim_insertion.evaluate --run runs/SX-2mm_GCS_0``: how often a policy succeeds, in robosuite."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from scipy.stats import binomtest

import paxisim

from .env import InsertionEnv
from .results import IN_SIMULATION, OUT, Result
from .run import Run, versions
from .shell import command
from .surrogate import OPEN
from .trained import Trained

FIRST_SEED = 1_000_000
"""Of the evaluation's episodes, which no training run uses."""


def evaluate(
    run: Path,
    *,
    trials: int = 50,
    sensor: str | Path | None = None,
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
        out: Folder of the result; .table looks there, too.
        other_versions: Evaluate although the software's versions are not the run's.
    """
    if trials < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial, got {trials}")
    this = Run.open(run, other_versions=other_versions)
    chain = None if sensor is None else surrogate_of(str(sensor))
    env = this.insertion_env(sensor=chain, terminate_on_success=True)
    try:
        trained = this.policy(env)
        successes = sum(succeeds(env, trained, FIRST_SEED + trial) for trial in range(trials))
    finally:
        env.close()
    name = IN_SIMULATION if sensor is None else f"surrogate {Path(str(sensor).replace(':', '-')).stem}"
    interval = interval_of(successes, trials)
    training = {
        "steps": trained.steps,
        "updates": trained.updates,
        "envs": this.envs,
        "engine": this.engine,
        "batch": this.batch,
        "temperature": this.temperature,
        "redraw": this.redraw,
        "parameters": asdict(this.parameters),
        "model": [] if this.diagnosis is None else list(this.diagnosis.model.names),
    }
    result = Result(this.task, this.name, name, this.seed, trials, successes / trials, interval, versions(), training)
    path = result.save(out)
    print(f"{this.task} {this.name} {name}: {successes} of {trials}, {interval[0]:.2f} to {interval[1]:.2f}; {path}")


def surrogate_of(sensor: str) -> paxisim.Chain | Callable[[paxisim.TaxelLayout], paxisim.Chain]:
    """The chain of a file, or what makes that of a unit of the magnetic pad, read in counts of 0.1 N.

    Raises:
        InvalidValueError: The file is no chain, or the text names no unit.
    """
    if not sensor.startswith("reference:"):
        return paxisim.Chain.load(sensor)
    make = paxisim.reference_sensor(sensor.removeprefix("reference:"))

    def unit(layout: paxisim.TaxelLayout) -> paxisim.Chain:
        return paxisim.Chain([make(layout, zeroed_at=OPEN), paxisim.augment.Firmware()])

    return unit


def interval_of(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a success rate."""
    low, high = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(low), float(high)


def succeeds(env: InsertionEnv, trained: Trained, seed: int) -> bool:
    """Whether the policy's most likely actions solve the episode of this seed."""
    observation, info = env.reset(seed=seed)
    terminated = truncated = False
    while not (terminated or truncated):
        observation, _, terminated, truncated, info = env.step(trained.act(observation))
    return bool(info["is_success"])


if __name__ == "__main__":
    sys.exit(command(evaluate))
