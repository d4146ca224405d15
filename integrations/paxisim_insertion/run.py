"""Run: the folder of a training run, with its settings, its newest model and its replay buffer."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import Env
from gymnasium.wrappers import TransformReward
from stable_baselines3 import SAC
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

import paxisim

from .env import InsertionEnv
from .methods import find_method
from .scenes import check_engine
from .tasks import PARAMETERS, Parameters, find_task
from .trained import ACTOR, Trained
from .vec_env import InsertionVecEnv
from .versions import differing
from .versions import versions as versions
from .whole import write_whole

if TYPE_CHECKING:
    from .warp_env import InsertionWarpEnv

BUFFER = 1_000_000
"""Capacity of the replay buffer in transitions, stable-baselines3's default."""

_FIELDS = (
    "task",
    "method",
    "seed",
    "envs",
    "buffer",
    "reward_scale",
    "redraw",
    "steps",
    "engine",
    "updates",
    "batch",
    "temperature",
)

REWARD_SCALE = 0.005
"""Factor of the reward in training.

With `TEMPERATURE` it sets how much SAC explores: only their ratio matters for the optimal policy. Unscaled, an inserted
peg earns 700 per step, and the critic has to learn values of 70,000.
"""

TEMPERATURE = 0.1
"""Initial temperature of SAC."""


@dataclass(frozen=True)
class Run:
    """One training run in a folder: ``run.json``, ``model.zip``, ``replay/`` and ``progress.csv``.

    Attributes:
        folder: The folder.
        task: Name of the task.
        method: Name of the method.
        seed: Seed of the run.
        envs: Number of environments that collect transitions in parallel.
        buffer: Capacity of the replay buffer in transitions, over all environments.
        reward_scale: Factor of the reward, see `REWARD_SCALE`.
        redraw: Also redraw GCS for each sample of the replay buffer, see `Redraw`; the paper draws once per episode.
        steps: Total number of environment steps.
        engine: Engine that moves the hand during training, see `InsertionEnv`.
        updates: Updates per environment step.
        batch: Transitions per update.
        temperature: Initial temperature of SAC.
        parameters: Values that the paper does not specify.
        diagnosis: Diagnosis of a sensor. Its model, drawn within its intervals for each episode, replaces the
            randomisation of the method.
        ranges: Ranges of what the diagnosis found in the scene, also drawn for each episode.

    Raises:
        InvalidValueError: A number is not positive.
        UnknownNameError: There is no such engine.
    """

    folder: Path
    task: str
    method: str
    seed: int = 0
    envs: int = 1
    buffer: int = BUFFER
    reward_scale: float = REWARD_SCALE
    redraw: bool = True
    steps: int = 300_000
    engine: str = "robosuite"
    updates: float = 0.25
    batch: int = 256
    temperature: float = TEMPERATURE
    parameters: Parameters = PARAMETERS
    diagnosis: paxisim.diagnose.Diagnosis | None = None
    ranges: paxisim.SceneRanges = paxisim.SceneRanges()  # noqa: RUF009 - frozen

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("envs", "buffer", "batch"):
            if getattr(self, name) < 1:
                raise paxisim.InvalidValueError(f"{name} must be at least 1, got {getattr(self, name)!r}")
        for name in ("updates", "temperature", "reward_scale"):
            if not 0 < getattr(self, name) < float("inf"):
                raise paxisim.InvalidValueError(f"{name} must be positive and finite, got {getattr(self, name)!r}")
        check_engine(self.engine)

    @property
    def gcs(self) -> paxisim.GCS | None:
        """Randomisation drawn for each episode, or None."""
        if self.diagnosis is None:
            return find_method(self.method).gcs
        return paxisim.GCS.around(self.diagnosis.model, self.diagnosis.intervals)

    @property
    def name(self) -> str:
        """The method's name, with ``" fitted"`` appended if a fitted model replaces its randomisation."""
        return self.method if self.diagnosis is None else f"{self.method} fitted"

    @property
    def model_path(self) -> Path:
        """Path of the newest model."""
        return self.folder / "model.zip"

    def create(self) -> None:
        """Write the settings of the run.

        Raises:
            OutputExistsError: The folder has a run already.
        """
        path = self.folder / "run.json"
        if path.exists():
            raise paxisim.OutputExistsError(f"{self.folder} has a run already: pass --resume, or choose another folder")
        find_task(self.task)
        find_method(self.method)
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps({**self._identity(), "versions": versions()}, indent=1) + "\n")

    @classmethod
    def open(cls, folder: Path, *, other_versions: bool = False) -> Run:
        """Open an existing run.

        Args:
            folder: Folder of the run.
            other_versions: Accept a run made with other software versions.

        Raises:
            InvalidValueError: There is no run, it was made with other versions, or it cannot be read.
        """
        path = folder / "run.json"
        if not path.exists():
            raise paxisim.InvalidValueError(f"{folder} has no run: make one with python -m paxisim_insertion.train")
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            made_with = found.pop("versions")
            values = found.pop("parameters")
            values = {key: _tuples(value) for key, value in values.items()}
            told, drawn = found.pop("diagnosis", None), found.pop("ranges", {})
            found.setdefault("updates", 1 / found["envs"])  # for runs from before `updates` was an option
            diagnosis = None if told is None else paxisim.diagnose.Diagnosis.from_json(json.dumps(told))
            run = cls(folder, parameters=Parameters(**values), diagnosis=diagnosis, ranges=_ranges(**drawn), **found)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise paxisim.InvalidValueError(f"{path} is not a run of this version: {error}") from error
        differ = differing(made_with)
        if differ and not other_versions:
            here = versions()
            told = ", ".join(f"{name} {made} (here {here.get(name)})" for name, made in differ.items())
            raise paxisim.InvalidValueError(f"{folder} was made with {told}: use those, or pass --other-versions")
        return run

    def seed_after(self, steps: int) -> int:
        """Return the random seed for a run that begins, at 0 steps, or is resumed after a number of steps.

        The environments use consecutive seeds from this one, so the seeds of runs and resumptions must be far apart.
        """
        return int(np.random.SeedSequence([self.seed, steps]).generate_state(1)[0])

    def insertion_env(self, **options: Any) -> InsertionEnv:
        """Build the run's unwrapped environment, with further options of `InsertionEnv`."""
        return InsertionEnv(
            self.task, self.method, gcs=self.gcs, ranges=self.ranges, parameters=self.parameters, **options
        )

    def warp_env(self, worlds: int) -> InsertionWarpEnv:
        """Build as many worlds of the run's environment on MuJoCo Warp.

        Raises:
            UnsupportedError: The run draws friction, stiffness, mounts or surfaces of the pads found in a scene.
            MissingExtraError: MuJoCo Warp is not installed.
        """
        from .warp_env import InsertionWarpEnv

        if self.ranges.parameters:
            raise paxisim.UnsupportedError("MuJoCo Warp's engine does not draw what a diagnosis found in the scene")
        return InsertionWarpEnv(worlds, task=self.task, method=self.method, gcs=self.gcs, parameters=self.parameters)

    def make_env(self, index: int = 0) -> Env:
        """Build one of the run's environments, seeded. Its rewards are scaled, its logged returns are not."""
        env = self.insertion_env()
        env.reset(seed=self.seed * 1000 + index)
        return TransformReward(
            Monitor(env, info_keywords=("is_success",)), lambda reward: self.reward_scale * float(reward)
        )

    def make_envs(self, threads: int = 1) -> VecEnv:
        """Build all of the run's environments; several robosuite environments run in separate processes.

        Args:
            threads: Number of threads in which the native engine steps the environments.
        """
        if self.engine == "native":
            envs = [self.insertion_env(engine="native") for _ in range(self.envs)]
            made = InsertionVecEnv(envs, reward_scale=self.reward_scale, threads=threads)
            made.seed(self.seed * 1000)
            return made
        makers: list[Any] = [lambda index=index: self.make_env(index) for index in range(self.envs)]
        return SubprocVecEnv(makers, start_method="forkserver") if self.envs > 1 else DummyVecEnv(makers)

    def policy(self, env: InsertionEnv) -> Trained:
        """Load the newest policy for `env`: the average of the actors if the run has one.

        Raises:
            InvalidValueError: There is no policy yet, or it was trained on other observations.
        """
        if (self.folder / ACTOR).exists():
            return Trained.load(self.folder, env)
        if not self.model_path.exists():
            raise paxisim.InvalidValueError(f"{self.folder} has no model yet: train it first")
        return Trained.of_model(self.model_path, env)

    def save(self, model: SAC) -> None:
        """Save a model in place of the previous one, atomically."""
        new = self.folder / "model.new.zip"
        model.save(new)
        os.replace(new, self.model_path)

    def _identity(self) -> dict[str, Any]:
        own = {name: getattr(self, name) for name in _FIELDS}
        found = None if self.diagnosis is None else json.loads(self.diagnosis.to_json())
        return {**own, "parameters": asdict(self.parameters), "diagnosis": found, "ranges": asdict(self.ranges)}


def _ranges(
    parameters: Sequence[dict[str, Any]] = (), intervals: Sequence[Any] = (), pads: Sequence[str] = ()
) -> paxisim.SceneRanges:
    known = tuple(paxisim.SceneParameter(**item) for item in parameters)
    return paxisim.SceneRanges(known, _tuples(list(intervals)), tuple(pads))


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
