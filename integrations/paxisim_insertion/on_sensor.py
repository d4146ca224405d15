"""A trained policy on a sensor at serial ports, at 20 Hz: ``python -m paxisim_insertion.on_sensor --run RUN``.

The robot is simulated; each pad is an emulated control box on a pseudo-terminal that reads the simulated forces,
rounded to its counts. The policy sees what `paxisim.open_sensor` reads, pooled to the taxels that it was trained on,
and never the simulator's forces. On a robot, `SensedPolicy` stays as it is: the ports replace the emulators, and the
robot's own loop the environment.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray

import paxisim

from .env import CONTROL_DT, RAW, InsertionEnv
from .evaluate import FIRST_SEED
from .policy import Trained
from .run import Run
from .shell import command

PROFILE = "gen2-box-120"
POOLED = (2, 2)  # 12x10 taxels to the 6x5 of the tasks


class SensedPolicy:
    """A policy whose tactile input comes from a sensor.

    Attributes:
        force: ``(pads, 3, rows, cols)`` the newest reading (N), pooled.
        seconds: Duration of each step: waiting for the reading, encoding it, and the network, ``(steps, 3)``.
    """

    def __init__(self, trained: Trained, env: InsertionEnv, sensor: paxisim.TactileSensor) -> None:
        """Store the policy and the sensor, and create the history that the policy was trained with."""
        self._trained, self._sensor, self._layout = trained, sensor, sensor.layout
        self._history = env.method.history(env.task, env.layout)
        self.force = np.zeros_like(env.raw)
        self.seconds: list[tuple[float, float, float]] = []

    def begin(self) -> None:
        """Begin an episode: the next reading fills the history."""
        self._history.reset()

    def act(self, observation: dict[str, NDArray[np.float32]]) -> NDArray[np.float32]:
        """Return the action for the newest reading.

        Args:
            observation: As of the environment. The policy uses its pose ``"p"``; every reading in it is replaced.
        """
        times = [time.perf_counter()]
        self.force = self._layout.pool_force(self._sensor.latest().force, *POOLED).astype(np.float32)
        times.append(time.perf_counter())
        self._history.append(self.force)
        read = {"tactile": self._history.read(), RAW: self.force}
        seen = observation | {name: value for name, value in read.items() if name in observation}
        times.append(time.perf_counter())
        action = self._trained.act(seen)
        times.append(time.perf_counter())
        self.seconds.append((times[1] - times[0], times[2] - times[1], times[3] - times[2]))
        return action


def on_sensor(run: Path, *, trials: int = 5, engine: Literal["robosuite", "native"] = "native") -> None:
    """Run a policy on emulated sensors in real time, and print its successes and what a step takes.

    Args:
        run: Folder of the run.
        trials: Number of episodes, with the seeds of an evaluation.
        engine: Engine of the simulated robot.
    """
    if trials < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial, got {trials}")
    this = Run.open(run)
    env = this.insertion_env(engine=engine, terminate_on_success=True)
    with closing(env), on_ports(env) as sensor, _one_thread():
        policy = SensedPolicy(this.policy(env), env, sensor)
        solved = late = 0
        for trial in range(trials):
            success, over = _episode(env, policy, seed=FIRST_SEED + trial)
            solved, late = solved + success, late + over
    milliseconds = 1e3 * np.array(policy.seconds)
    print(f"{this.task} {this.name} on {len(env.raw)} ports: {solved} of {trials} succeeded")
    for name, own in zip(("wait for a reading", "pool and encode", "network"), milliseconds.T, strict=True):
        print(f"{name:<20} median {np.median(own):5.1f} ms, 99 % within {np.quantile(own, 0.99):5.1f} ms")
    print(f"{late} of {len(milliseconds)} steps took longer than {1e3 * CONTROL_DT:.0f} ms")


@contextmanager
def _one_thread() -> Iterator[None]:
    """Run torch on one thread: so small a network only waits for the others, for 50 ms where two cores are busy."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


@contextmanager
def on_ports(env: InsertionEnv) -> Iterator[paxisim.TactileSensor]:
    """Emulate a control box for each pad of an environment, and open them as one sensor."""
    with ExitStack() as opened, warnings.catch_warnings():
        warnings.simplefilter("ignore", paxisim.UnverifiedProfileWarning)  # no one has tried this profile on a device
        pads = range(len(env.raw))
        boards = [opened.enter_context(paxisim.Emulator(PROFILE, partial(_felt, env, pad))) for pad in pads]
        yield opened.enter_context(paxisim.open_sensor([board.port for board in boards], PROFILE))


def _felt(env: InsertionEnv, pad: int, now: float) -> NDArray[np.float64]:
    """Return the force on the finer taxels of a pad, ``(1, 3, 12, 10)`` newtons: each has its share of a coarse one."""
    fine = env.raw[pad].repeat(POOLED[0], axis=-2).repeat(POOLED[1], axis=-1)
    return fine[None].astype(float) / (POOLED[0] * POOLED[1])


def _episode(env: InsertionEnv, policy: SensedPolicy, seed: int) -> tuple[bool, int]:
    """Run an episode in real time, and return whether it succeeded and how many steps took too long."""
    observation, info = env.reset(seed=seed)
    policy.begin()
    time.sleep(CONTROL_DT)  # the boards read the closed fingers
    late, ended = 0, False
    due = time.perf_counter()
    while not ended:
        action = policy.act(observation)
        observation, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
        now, due = time.perf_counter(), due + CONTROL_DT
        late += now > due
        time.sleep(max(due - now, 0.0))
        due = max(due, now)  # a late step does not shorten the next ones
    return bool(info["is_success"]), late


if __name__ == "__main__":
    sys.exit(command(on_sensor))
