"""Run: the folder of one training run: what it is, its newest model, and all it has seen."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.wrappers import TransformReward
from stable_baselines3 import SAC
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

import paxisim

from .env import ENGINES, InsertionEnv
from .methods import find_method
from .tasks import Parameters, find_task
from .trained import ACTOR, Trained
from .vec_env import InsertionVecEnv

PACKAGES = ("mujoco", "robosuite", "stable-baselines3", "torch", "gymnasium", "numpy")
BUFFER = 1_000_000
"""Transitions in the replay buffer, stable-baselines3's default."""

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

REWARD_SCALE = 0.05
"""What the reward is multiplied by in training. It does not change which policy is best. But SAC's temperature begins
at 1, and with rewards of several hundred a step it takes most of a training to grow to what they need; until then the
policy hardly explores."""


def versions() -> dict[str, str]:
    """The versions that a result depends on."""
    found = {name: version(name) for name in PACKAGES}
    return {"paxisim": paxisim.__version__, "python": platform.python_version(), **found}


@dataclass(frozen=True)
class Run:
    """One training run in a folder: ``run.json``, ``model.zip``, ``replay/`` and ``progress.csv``.

    Attributes:
        folder: The folder.
        task: Name of the task.
        method: Name of the method.
        seed: Seed of the run.
        envs: Environments that collect at the same time.
        buffer: Transitions in the replay buffer, all environments together.
        reward_scale: What the reward is multiplied by, see `REWARD_SCALE`.
        redraw: Draw GCS anew for each sample of the replay buffer too, see `Redraw`; the paper draws once an episode.
        steps: Environment steps that it is to have in all.
        engine: What moves the hand while it trains, see `InsertionEnv`.
        updates: Updates for each environment step.
        batch: Transitions of an update.
        temperature: SAC's temperature at the start of the training.
        parameters: What the paper leaves open.
        diagnosis: What was found of a sensor, whose model is drawn within its intervals for each episode, in place of
            what the method draws.
        ranges: What it found in the scene, drawn for each episode, too.

    Raises:
        InvalidValueError: A number that is not positive.
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
    temperature: float = 1.0
    parameters: Parameters = Parameters()  # noqa: RUF009 - frozen
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
        if self.engine not in ENGINES:
            raise paxisim.UnknownNameError("engine", self.engine, ENGINES)

    @property
    def gcs(self) -> paxisim.GCS | None:
        """What is drawn for each episode."""
        if self.diagnosis is None:
            return find_method(self.method).gcs
        return paxisim.GCS.around(self.diagnosis.model, self.diagnosis.intervals)

    @property
    def name(self) -> str:
        """The method's name, and whether a fitted model takes the place of what it draws."""
        return self.method if self.diagnosis is None else f"{self.method} fitted"

    @property
    def model_path(self) -> Path:
        """The newest model."""
        return self.folder / "model.zip"

    def create(self) -> None:
        """Write what the run is.

        Raises:
            OutputExistsError: The folder has a run already.
        """
        path = self.folder / "run.json"
        if path.exists():
            raise paxisim.OutputExistsError(f"{self.folder} has a run already: go on with --resume, or name another")
        find_task(self.task)
        find_method(self.method)
        self.folder.mkdir(parents=True, exist_ok=True)
        _replace(path, json.dumps({**self._identity(), "versions": versions()}, indent=1) + "\n")

    @classmethod
    def open(cls, folder: Path, *, other_versions: bool = False) -> Run:
        """A run that is there.

        Args:
            folder: Its folder.
            other_versions: Accept a run of other software versions.

        Raises:
            InvalidValueError: There is no run, or it is of other versions, or not readable.
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
            found.setdefault("updates", 1 / found["envs"])  # of a run that is older than the choice
            diagnosis = None if told is None else paxisim.diagnose.Diagnosis.from_json(json.dumps(told))
            run = cls(folder, parameters=Parameters(**values), diagnosis=diagnosis, ranges=_ranges(**drawn), **found)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise paxisim.InvalidValueError(f"{path} is not a run of this version: {error}") from error
        here = versions()
        # 2.13.0+cpu and 2.13.0 are one version
        differ = {n: made for n, made in made_with.items() if here.get(n, "").split("+")[0] != made.split("+")[0]}
        if differ and not other_versions:
            told = ", ".join(f"{name} {made} (here {here.get(name)})" for name, made in differ.items())
            raise paxisim.InvalidValueError(f"{folder} was made with {told}: use those, or pass --other-versions")
        return run

    def seed_after(self, steps: int) -> int:
        """The seed of all that is drawn from here on by a run that begins, at 0 steps, or is resumed.

        The environments count on from it, so those of runs and resumptions are to be far apart.
        """
        return int(np.random.SeedSequence([self.seed, steps]).generate_state(1)[0])

    def insertion_env(self, **options: Any) -> InsertionEnv:
        """The run's environment as it is, with more options of `InsertionEnv`."""
        return InsertionEnv(
            self.task, self.method, gcs=self.gcs, ranges=self.ranges, parameters=self.parameters, **options
        )

    def make_env(self, index: int = 0) -> Env:
        """One of the run's environments, seeded; what it logs is not scaled."""
        env = self.insertion_env()
        env.reset(seed=self.seed * 1000 + index)
        return TransformReward(
            Monitor(env, info_keywords=("is_success",)), lambda reward: self.reward_scale * float(reward)
        )

    def make_envs(self, threads: int = 1) -> VecEnv:
        """All of the run's environments; those of robosuite in processes of their own, if there are several.

        Args:
            threads: In which the native engine steps them.
        """
        if self.engine == "native":
            envs = [self.insertion_env(engine="native") for _ in range(self.envs)]
            made = InsertionVecEnv(envs, reward_scale=self.reward_scale, threads=threads)
            made.seed(self.seed * 1000)
            return made
        makers: list[Any] = [lambda index=index: self.make_env(index) for index in range(self.envs)]
        return SubprocVecEnv(makers, start_method="forkserver") if self.envs > 1 else DummyVecEnv(makers)

    def policy(self, env: InsertionEnv) -> Trained:
        """The newest policy, to act in `env`: the average of the actors, where the run has one.

        Raises:
            InvalidValueError: There is none yet, or it was trained on other observations.
        """
        if (self.folder / ACTOR).exists():
            return Trained.load(self.folder, env)
        if not self.model_path.exists():
            raise paxisim.InvalidValueError(f"{self.folder} has no model yet: train it first")
        return Trained.of_model(self.model_path, env)

    def save(self, model: SAC) -> None:
        """Replace the newest model by this one; at no moment is there none."""
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


def _replace(path: Path, text: str) -> None:
    new = path.with_suffix(".new")
    new.write_text(text, encoding="utf-8")
    os.replace(new, path)
