"""``python -m paxisim_insertion.evaluate --run runs/SX-2mm_GCS_0``: success rate of a policy, in robosuite."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
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
from .surrogates import OPEN
from .transfer import StandIn, of_unit, sensors

TOUCHES = 0.1
"""Smallest force (N) between peg and base that counts as a touch."""


def evaluate(
    run: Path,
    *,
    trials: int = 50,
    sensor: str | Path | None = None,
    transfer: Literal["pads", "surrogates"] | None = None,
    drawn: bool = False,
    engine: Literal["robosuite", "native", "warp"] = "robosuite",
    out: Path = OUT,
) -> None:
    """Evaluate a run's newest policy on fixed episodes and write the result.

    Args:
        run: Folder of the run.
        trials: Number of episodes.
        sensor: A stand-in for a real sensor: a chain saved by paxisim, or reference:unit:N for the N-th unit of
            paxisim's magnetic pad, with +memory for a gel that creeps and +neighbour for the other pad's magnets.
            Default: the sensor that the method is trained with.
        transfer: Spread the episodes over 25 sensors that no training has seen, magnetic pads or surrogates, on a robot
            with a noisy p_t and a miscalibrated controller and joints, see Gap.
        drawn: Sample the actions from the policy, as in training, instead of taking the most likely ones.
        engine: Engine of the simulation: robosuite's, the reference; plain MuJoCo; or MuJoCo Warp, with all episodes at
            once.
        out: Output folder, which paxisim_lab.table reads as well; created if missing.
    """
    if trials < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial, got {trials}")
    others = (transfer is not None) + drawn + (sensor is not None)
    if others > 1:
        raise paxisim.InvalidValueError("expected one of --sensor, --transfer and --drawn")
    if engine == "warp" and others:
        raise paxisim.InvalidValueError("expected --engine warp without --sensor, --transfer and --drawn")
    this = Run.open(run)
    stand_in = None if sensor is None else stand_in_of(str(sensor))
    alone = "native" if engine == "warp" else engine
    env = this.insertion_env(sensor=stand_in, gap=transfer is not None, engine=alone, terminate_on_success=True)
    try:
        trained = this.policy(env)
        if engine == "warp":
            solved = _solved_on_warp(this, trained, trials)
            episodes = [Episode("", success, np.zeros(0)) for success in solved]
        else:
            act = partial(trained.act, deterministic=not drawn)
            turns = sensors(transfer, env.layout, trials) if transfer else [env.stand_in]
            episodes = []
            for trial in range(trials):
                env.stand_in = turns[trial % len(turns)]
                episodes.append(play_episode(env, act, FIRST_SEED + trial))
    finally:
        env.close()
    name = DRAWN if drawn else IN_SIMULATION
    if sensor is not None:
        name = sensor_name(sensor)
    if transfer:
        name = f"{TRANSFER} {transfer}"
    if engine != "robosuite":
        name = f"{name}, {engine}"
    kinds = dict.fromkeys(one.kind for one in episodes) if transfer else ()
    each = {kind: [one.success for one in episodes if one.kind == kind] for kind in kinds}
    successes = sum(one.success for one in episodes)
    result = Result(
        this.task,
        this.name,
        name,
        this.seed,
        trials,
        successes / trials,
        interval_of(successes, trials),
        versions(),
        _made(this, trained),
        {kind: (sum(found), len(found)) for kind, found in each.items()},
        *_forces(episodes),
    )
    path = result.save(out)
    low, high = result.interval
    print(f"{this.task} {this.name} {name}: {successes} of {trials}, {low:.2f} to {high:.2f}; {path}")


@dataclass(frozen=True, eq=False)
class Episode:
    """An episode of an evaluation.

    Attributes:
        kind: Kind of the sensor.
        success: Whether the policy inserted the peg.
        force: ``(steps,)`` force between peg and base at the end of each step (N).
    """

    kind: str
    success: bool
    force: NDArray[np.floating]


def play_episode(
    env: InsertionEnv, act: Callable[[dict[str, NDArray[np.float32]]], NDArray[np.float32]], seed: int
) -> Episode:
    """Play the episode of this seed with a policy, a function from observations to actions."""
    torch.manual_seed(seed)
    observation, info = env.reset(seed=seed)
    force, terminated, truncated = [], False, False
    while not (terminated or truncated):
        observation, _, terminated, truncated, info = env.step(act(observation))
        force.append(env.scene.contact_force)
    return Episode(env.stand_in.kind if env.stand_in else "", bool(info["is_success"]), np.array(force))


def _forces(episodes: list[Episode]) -> tuple[float | None, float | None]:
    """Return the mean force while the peg touches its base, and the mean of the episodes' largest forces (N)."""
    touching = np.concatenate([one.force[one.force > TOUCHES] for one in episodes])
    if not len(touching):
        return None, None
    return float(touching.mean()), float(np.mean([one.force.max() for one in episodes]))


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
        "until": run.until,
        "actor_every": run.actor_every,
        "success": trained.success,
        "reward_scale": run.reward_scale,
        "redraw": run.redraw,
        "parameters": asdict(run.parameters),
        "model": [] if run.diagnosis is None else list(run.diagnosis.model.names),
    }


def stand_in_of(sensor: str) -> paxisim.Chain | Callable[[paxisim.TaxelLayout], StandIn]:
    """Load a chain from a file, or return a function that makes a unit of the magnetic pad, zeroed while open.

    Raises:
        InvalidValueError: The file is not a chain, or the text does not name a unit.
    """
    if not sensor.startswith("reference:"):
        return paxisim.Chain.load(sensor)
    make = paxisim.reference_sensor(sensor.removeprefix("reference:"))
    return lambda layout: of_unit(make(layout, zeroed_at=OPEN))


if __name__ == "__main__":
    sys.exit(command(evaluate))
