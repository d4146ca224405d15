"""``python -m paxisim_insertion.engines``: compare the native engine with robosuite's on the same seeds."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import paxisim

from .arm import find_arm
from .env import PRIVILEGED, InsertionEnv
from .evaluate import FIRST_SEED, succeeds
from .expert import expert_action
from .results import interval_of
from .run import Run
from .scenes import ENGINES
from .shell import command
from .tasks import PARAMETERS, TASKS, Parameters

NOISE = 0.3
"""Standard deviation of the noise added to the expert's actions, which makes pegs also miss and slip."""


def engines(
    *,
    policies: Path | None = None,
    trials: int = 50,
    episodes: int = 5,
    parameters: Parameters = PARAMETERS,
    other_versions: bool = False,
) -> None:
    """Print two tables: differences on the same actions, and success of the same policies in both engines.

    Args:
        policies: Folder of runs or exported actors. Default: no second table.
        trials: Episodes per policy and engine.
        episodes: Episodes per task in which both engines get the same actions, those of a noisy expert.
        parameters: Values that the paper does not specify, for the first table; a policy has its own.
        other_versions: Accept runs made with other software versions.
    """
    if trials < 1 or episodes < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial and episode, got {trials} and {episodes}")
    folders = [] if policies is None else sorted(path.parent for path in policies.glob("*/run.json"))
    if policies is not None and not folders:
        raise paxisim.InvalidValueError(f"{policies} has no folders of runs or exported actors")
    print(f"{pushes(parameters)}\n")
    print("| task | taxels, L1: median | 95 % | peg (mm): median | 95 % | sum of a pad (N): median | 95 % |")
    print("|---|---|---|---|---|---|---|")
    for task in TASKS:
        measured = [differences(task, FIRST_SEED + seed, parameters) for seed in range(episodes)]
        cells = [
            f"{np.median(values):.{digits}f} | {np.quantile(values, 0.95):.{digits}f}"
            for values, digits in zip(np.hstack(measured), (3, 2, 2), strict=True)
        ]
        print(f"| {task} | {' | '.join(cells)} |", flush=True)
    if not folders:
        return
    print(f"\n| policy | {' | '.join(f'{name}, {trials} trials' for name in ENGINES)} |\n|---|{'---|' * len(ENGINES)}")
    for folder in folders:
        run = Run.open(folder, other_versions=other_versions)
        cells = []
        for engine in ENGINES:
            env = run.insertion_env(engine=engine, terminate_on_success=True)
            trained = run.policy(env)
            solved = sum(succeeds(env, trained.act, FIRST_SEED + trial) for trial in range(trials))
            env.close()
            low, high = interval_of(solved, trials)
            cells.append(f"{solved} ({low:.2f} to {high:.2f})")
        print(f"| {run.task} {run.name}, seed {run.seed} | {' | '.join(cells)} |", flush=True)


def pushes(parameters: Parameters) -> str:
    """Describe how the arm pushes when an obstacle blocks a full action of 1 cm straight down."""
    arm = find_arm(parameters)
    x, z, coupled = arm.inertia[0, 0], arm.inertia[2, 2], arm.inertia[0, 2]
    stiffness = parameters.kp * arm.impedance[:3, :3]
    down, along = 0.01 * stiffness[2, 2], -0.01 * stiffness[0, 2]
    free = 0.01 / np.linalg.inv(stiffness)[2, 2]
    return (
        f"robosuite's arm at its fingertip: {x:.1f} kg along x, {z:.1f} along z, {coupled:.1f} between them. A full "
        f"action straight down pushes with {down:.0f} N down and {along:.0f} N along x, and with {free:.0f} N down "
        "once it has slid"
    )


def differences(task: str, seed: int, parameters: Parameters) -> NDArray[np.floating]:
    """Compare the engines over an episode of the same actions, with readings that are not randomised.

    Returns:
        ``(3, steps)``: L1 norm of the taxels' difference relative to that of the reference; distance (mm) between the
        pegs; largest difference (N) between the sums over a pad.
    """
    reference, native = (InsertionEnv(task, "DT", parameters=parameters, engine=name) for name in ENGINES)
    rng = np.random.default_rng(seed)
    rows = []
    before = [env.reset(seed=seed)[0] for env in (reference, native)]
    truncated = False
    while not truncated:
        noise = rng.normal(0, NOISE, len(reference.task.axes))
        action = np.clip(expert_action(reference) + noise, -1, 1)
        before, _, _, stopped, _ = zip(*(env.step(action) for env in (reference, native)), strict=True)
        truncated = stopped[0]
        first, second = reference.reading, native.reading
        apart = np.linalg.norm(before[0][PRIVILEGED][:3] - before[1][PRIVILEGED][:3])
        sums = np.abs((first - second).sum(axis=(-2, -1))).max()
        total = max(np.abs(first).sum(), np.finfo(float).tiny)  # a peg that was lost reads 0
        rows.append((np.abs(first - second).sum() / total, 1e3 * apart, sums))
    return np.array(rows).T


if __name__ == "__main__":
    sys.exit(command(engines))
