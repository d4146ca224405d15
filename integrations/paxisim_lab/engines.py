"""``python -m paxisim_lab.engines``: compare two engines on the same seeds, by default the native one with robosuite's.

``--other warp`` compares MuJoCo Warp with the native engine. ``--other nudged`` compares the native engine with itself
after the fingertip was moved by 1e-7 m, which shows what any rounding error grows to.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from paxisim_insertion.engines import ENGINES
from paxisim_insertion.engines.arm import find_arm
from paxisim_insertion.env import PRIVILEGED, InsertionEnv
from paxisim_insertion.evaluate import play_episode
from paxisim_insertion.expert import expert_action
from paxisim_insertion.results import FIRST_SEED, interval_of
from paxisim_insertion.run import Run
from paxisim_insertion.shell import command
from paxisim_insertion.tasks import PARAMETERS, TASKS, Parameters

import paxisim

NOISE = 0.3
"""Standard deviation of the noise added to the expert's actions, which makes pegs also miss and slip."""

NUDGE = 1e-7
"""Distance (m) along x by which a nudged fingertip is moved."""


def engines(
    *,
    other: Literal["native", "warp", "nudged"] = "native",
    tasks: tuple[str, ...] = tuple(TASKS),
    policies: Path | None = None,
    trials: int = 50,
    episodes: int = 5,
    parameters: Parameters = PARAMETERS,
) -> None:
    """Print differences on the same actions, and success of the same policies in robosuite and the native engine.

    Args:
        other: What is compared: the native engine with robosuite's, MuJoCo Warp with the native engine, or the native
            engine with itself after a nudge.
        tasks: Names of the tasks of the first table.
        policies: Folder of runs or policies. Default: no second table.
        trials: Episodes per policy and engine.
        episodes: Episodes per task in which both engines get the same actions, those of a noisy expert.
        parameters: Values that the paper does not specify, for the first table; a policy has its own.
    """
    if trials < 1 or episodes < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial and episode, got {trials} and {episodes}")
    folders = [] if policies is None else sorted(path.parent for path in policies.glob("*/run.json"))
    if policies is not None and not folders:
        raise paxisim.InvalidValueError(f"{policies} has no folders of runs or policies")
    print(f"{pushes(parameters)}. {moves(parameters)}\n")
    print("| task | taxels, L1: median | 95 % | peg (mm): median | 95 % | sum of a pad (N): median | 95 % |")
    print("|---|---|---|---|---|---|---|")
    formats = (".3f", ".2f", ".2f") if other == "native" else (".2g", ".2g", ".2g")
    for task in tasks:
        measured = differences(task, other, range(FIRST_SEED, FIRST_SEED + episodes), parameters)
        cells = [
            f"{np.median(values):{form}} | {np.quantile(values, 0.95):{form}}"
            for values, form in zip(measured, formats, strict=True)
        ]
        print(f"| {task} | {' | '.join(cells)} |", flush=True)
    if folders:
        print(f"\n| policy | {' | '.join(f'{name}, {trials} trials' for name in ENGINES)} |\n|---|---|---|")
    for folder in folders:
        run = Run.open(folder)
        cells = [_success(run, engine, trials) for engine in ENGINES]
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


def moves(parameters: Parameters) -> str:
    """Describe how far full actions move the fingertip in the native engine, and how hard the fingers hold the peg."""
    env = InsertionEnv("SQ-2mm", "DT", parameters=parameters, engine="native")
    ways: list[NDArray[np.floating]] = []
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1)):
        env.reset(seed=FIRST_SEED)
        path = [env.scene.fingertip[0][axis]]
        for _ in range(6):
            env.step(sign * np.eye(3)[axis])
            path.append(env.scene.fingertip[0][axis])
        ways.append(1e3 * np.abs(np.diff(path)))
    first, aside, up = [way[0] for way in ways], np.concatenate([way[1:] for way in ways[:4]]), ways[4][1:]
    grip = env.raw[:, 2].sum(axis=(1, 2)).mean()
    return (
        f"A full action moves the fingertip by {min(first):.1f} to {max(first):.1f} mm in the first step, and by "
        f"{aside.min():.1f} to {aside.max():.1f} mm sideways or {up.min():.1f} to {up.max():.1f} mm up in each of the "
        f"next five. {grip:.1f} N arrive at each pad"
    )


def differences(task: str, other: str, seeds: range, parameters: Parameters = PARAMETERS) -> NDArray[np.floating]:
    """Compare engines over episodes of the same actions, with readings that are not randomised.

    Returns:
        ``(3, steps)``: L1 norm of the taxels' difference relative to that of the reference; distance (mm) between the
        pegs; largest difference (N) between the sums over a pad.
    """
    reference = InsertionEnv(task, "DT", parameters=parameters, engine="robosuite" if other == "native" else "native")
    second: Any = (
        _OneWorld(task, parameters)
        if other == "warp"
        else InsertionEnv(task, "DT", parameters=parameters, engine="native")
    )
    rows = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        for env in (reference, second):
            env.reset(seed=seed)
        if other == "nudged":
            second.scene.model_and_data[1].qpos[0] += NUDGE
        truncated = False
        while not truncated:
            noise = rng.normal(0, NOISE, len(reference.task.axes))
            action = np.clip(expert_action(reference) + noise, -1, 1)
            expected, _, _, truncated, _ = reference.step(action)
            apart = 1e3 * np.linalg.norm(expected[PRIVILEGED][:3] - second.step(action)[0][PRIVILEGED][:3])
            change = reference.reading - second.reading
            total = max(float(np.abs(reference.reading).sum()), 1e-6)  # a peg that was lost reads 0
            rows.append((np.abs(change).sum() / total, apart, np.abs(change.sum(axis=(-2, -1))).max()))
    return np.array(rows).T


class _OneWorld:
    """A single world of MuJoCo Warp with the method DT, as `InsertionEnv` has it."""

    def __init__(self, task: str, parameters: Parameters) -> None:
        from paxisim_insertion.warp_env import InsertionWarpEnv

        self._env = InsertionWarpEnv(1, task=task, method="DT", parameters=parameters)
        self.reading = np.zeros(self._env.scene.pads.shape)

    def reset(self, seed: int) -> None:
        self._env.reset(seed=[seed])

    def step(self, action: NDArray[np.floating]) -> tuple[dict[str, NDArray[np.floating]]]:
        observation, _, _, _, infos = self._env.step(action[None])
        found = {name: value[0].cpu().numpy() for name, value in infos.get("final_obs", observation).items()}
        pads, axes, rows, cols = self.reading.shape
        self.reading = found["tactile"][-pads * axes :].reshape(pads, axes, rows, cols)
        return (found,)


def _success(run: Run, engine: str, trials: int) -> str:
    """Return in how many episodes a run's policy succeeds in an engine."""
    env = run.insertion_env(engine=engine, terminate_on_success=True)
    trained = run.policy(env)
    solved = sum(play_episode(env, trained.act, FIRST_SEED + trial).success for trial in range(trials))
    env.close()
    low, high = interval_of(solved, trials)
    return f"{solved} ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    sys.exit(command(engines))
