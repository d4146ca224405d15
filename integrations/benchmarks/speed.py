"""Cost of the pads in robosuite, as ratios of steps per second measured in alternation in one run.

``python integrations/benchmarks/speed.py``. Each round times every environment once, so that a busy machine slows all
of them equally; the ratio is the median over the rounds. "robosuite" uses robosuite's own gripper and controller,
"fast" uses `fast_controller`, and "pads" adds the paper's pads: their forces, GCS and the history of 20 frames.
"""

import logging
import os
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import robosuite
from paxisim_insertion import TASKS, InsertionEnv, InsertionScene
from paxisim_insertion.run import Run
from paxisim_robosuite import TactileWrapper, fast_controller
from robosuite.controllers import load_composite_controller_config

ROUNDS, STEPS = 40, 4
SCALING_STEPS = 40
QUIET = {"has_renderer": False, "has_offscreen_renderer": False, "use_camera_obs": False, "control_freq": 20}


def measured(steps: dict[str, Callable[[], object]]) -> dict[str, np.ndarray]:
    """Return the seconds per step of each round, by name."""
    seconds: dict[str, list[float]] = {name: [] for name in steps}
    for _ in range(ROUNDS):
        for name, step in steps.items():
            start = time.perf_counter()
            for _ in range(STEPS):
                step()
            seconds[name].append((time.perf_counter() - start) / STEPS)
    return {name: np.array(values) for name, values in seconds.items()}


def lift() -> dict[str, Callable[[], object]]:
    """Return the steps of Lift, with the gripper in the air."""

    def made(gripper: str, **more: object) -> object:
        options = {"robots": "Panda", "gripper_types": gripper, "hard_reset": False, "ignore_done": True, **QUIET}
        return robosuite.make("Lift", **options, **more)

    envs = {
        "robosuite": made("PandaGripper"),
        "fast": made("PandaGripper", controller_configs=fast_controller()),
        "pads": TactileWrapper(made("PaxiPandaGripper", controller_configs=fast_controller())),
        "pads, robosuite's controller": TactileWrapper(made("PaxiPandaGripper")),
    }
    for env in envs.values():
        env.reset()
    return {name: lambda env=env: env.step(np.zeros(7)) for name, env in envs.items()}


def insertion(task: str) -> dict[str, Callable[[], object]]:
    """Return the steps of a task, with the peg held above its base."""
    plain = load_composite_controller_config(robot="Panda")
    for part in plain["body_parts"].values():
        part.update(input_type="absolute", input_ref_frame="world")
    scenes = {
        "robosuite": InsertionScene(TASKS[task], tactile=False, controller=plain),
        "fast": InsertionScene(TASKS[task], tactile=False),
    }
    # the scene drives the arm itself; this restores robosuite's method
    robot = scenes["robosuite"].robots[0]
    scenes["robosuite"]._pre_action = lambda action, policy_step=False: robot.control(action, policy_step)
    for scene in scenes.values():
        scene.place(np.array([0.005, 0.005, 0.01]))
    env = InsertionEnv(task, "GCS")
    env.reset(seed=0)
    steps = {name: lambda scene=scene: scene.step(scene.goal(scene.fingertip[0])) for name, scene in scenes.items()}
    return {**steps, "pads": lambda: env.step(np.zeros(len(env.task.axes)))}


def scaling(task: str = "SX-2mm") -> None:
    """Print steps per second of environments in separate processes relative to one process; best of five."""
    cores = os.cpu_count() or 1
    best: dict[int, float] = {}
    with TemporaryDirectory() as folder:
        for count in (1, cores, 2 * cores):
            envs = Run(Path(folder), task, "GCS", envs=count).make_envs()
            envs.reset()
            for _ in range(5):
                start = time.perf_counter()
                for _ in range(SCALING_STEPS):
                    envs.step(np.zeros((count, *envs.action_space.shape)))
                rate = count * SCALING_STEPS / (time.perf_counter() - start)
                best[count] = max(best.get(count, 0.0), rate)
            envs.close()
    print(f"\n{cores} cores; {task}, GCS: " + ", ".join(f"{n} processes {r / best[1]:.2f}" for n, r in best.items()))


def main() -> None:
    """Print the table."""
    logging.getLogger("robosuite_logs").setLevel(logging.ERROR)
    print("| task | environment | ms a step | steps per second, robosuite = 1 |")
    print("|---|---|---|---|")
    for name, steps in {"Lift": lift(), **{task: insertion(task) for task in ("SX-2mm", "RU-2mm", "RY-2mm")}}.items():
        seconds = measured(steps)
        for which, values in seconds.items():
            ratio = np.median(seconds["robosuite"] / values)
            print(f"| {name} | {which} | {1e3 * np.median(values):.1f} | {ratio:.2f} |", flush=True)
    scaling()


if __name__ == "__main__":
    main()
