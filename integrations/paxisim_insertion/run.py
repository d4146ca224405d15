"""Run: the folder of one training run: what it is, its newest model, and all it has seen."""

from __future__ import annotations

import json
import os
import platform
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import Env
from gymnasium.wrappers import TransformReward
from stable_baselines3 import SAC
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv

import paxisim

from .average import Average
from .env import InsertionEnv
from .methods import find_method
from .policy import AsymmetricPolicy
from .redraw import Redraw
from .replay import HistoryReplayBuffer
from .tasks import Parameters, find_task
from .trained import ACTOR, NOT_WEIGHTS, Trained, counts_of
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
            told = found.pop("diagnosis", None)
            found.setdefault("updates", 1 / found["envs"])  # of a run that is older than the choice
            diagnosis = None if told is None else paxisim.diagnose.Diagnosis.from_json(json.dumps(told))
            run = cls(folder, parameters=Parameters(**values), diagnosis=diagnosis, **found)
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
        return InsertionEnv(self.task, self.method, gcs=self.gcs, parameters=self.parameters, **options)

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

    def model(self, env: VecEnv, device: str = "auto") -> SAC:
        """The run's newest model, or its first; its replay buffer is in the folder, with all that was seen.

        Of ``model.zip`` the weights, the optimisers' states and the counts are read, and none of its pickles: what else
        a model is follows from the run.

        Raises:
            InvalidValueError: The model was made for other observations, as of another layout or k.
        """
        # a step of all environments is one for SAC, which counts whole updates
        due = self.updates * self.envs
        model = SAC(
            AsymmetricPolicy,
            env,
            train_freq=max(1, round(1 / due)),
            gradient_steps=max(1, round(due)),
            ent_coef=f"auto_{self.temperature}",
            policy_kwargs={"optimizer_kwargs": {"fused": True}},  # the same steps, in fewer passes over the weights
            buffer_size=self.buffer,
            batch_size=self.batch,
            replay_buffer_class=HistoryReplayBuffer,
            replay_buffer_kwargs={"history": env.get_attr("history")[0].k, "redraw": self._redraw(env)},
            seed=self.seed,
            device=device,
        )
        if self.model_path.exists():
            try:
                self._go_on(model)
            except NOT_WEIGHTS as error:
                raise paxisim.InvalidValueError(f"{self.model_path} does not fit the environment: {error}") from error
        buffer = model.replay_buffer
        assert isinstance(buffer, HistoryReplayBuffer)
        buffer.keep_in(self.folder / "replay")
        return model

    def average(self, model: SAC) -> Average:
        """The average of the actors that a training had so far, the newest of which is that of `model`."""
        average = Average(model.actor)
        path = self.folder / ACTOR
        if path.exists():
            try:
                average.actor.load_state_dict(torch.load(path, map_location=model.device, weights_only=True)["actor"])
            except NOT_WEIGHTS as error:
                raise paxisim.InvalidValueError(f"{path} does not fit the environment: {error}") from error
        return average

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

    def _go_on(self, model: SAC) -> None:
        """Give a model what the newest one had learned and counted."""
        model.set_parameters(str(self.model_path), device=model.device)
        _, _, tensors = load_from_zip_file(self.model_path, device=model.device, load_data=False)
        assert isinstance(model.log_ent_coef, torch.Tensor)
        with torch.no_grad():
            model.log_ent_coef.copy_((tensors or {})["log_ent_coef"])
        counts = counts_of(self.model_path)
        for name in ("num_timesteps", "_n_updates", "_episode_num"):
            setattr(model, name, counts[name])

    def _redraw(self, env: VecEnv) -> Redraw | None:
        gcs = self.gcs
        if not self.redraw or gcs is None:
            return None
        return Redraw(gcs, env.get_attr("history")[0].encoding, env.get_attr("layout")[0], self.seed)

    def _identity(self) -> dict[str, Any]:
        own = {name: getattr(self, name) for name in _FIELDS}
        found = None if self.diagnosis is None else json.loads(self.diagnosis.to_json())
        return {**own, "parameters": asdict(self.parameters), "diagnosis": found}


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def _replace(path: Path, text: str) -> None:
    new = path.with_suffix(".new")
    new.write_text(text, encoding="utf-8")
    os.replace(new, path)
