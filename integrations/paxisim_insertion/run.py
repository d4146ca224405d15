"""Run: the folder of a training run, with its settings, its newest model and its replay buffer."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import SAC

import paxisim

from .env import InsertionEnv
from .methods import find_method
from .policy import Trained
from .results import differing, versions, whole_file, write_whole
from .tasks import PARAMETERS, Parameters, find_task
from .vec_env import InsertionVecEnv

BUFFER = 1_000_000
"""Capacity of the replay buffer in transitions, stable-baselines3's default."""

REWARD_SCALE = 0.005
"""Factor of the reward in training.

With `TEMPERATURE` it sets how much SAC explores: only their ratio matters for the optimal policy. Unscaled, an inserted
peg earns 700 per step, and the critic has to learn values of 70,000.
"""

TEMPERATURE = 0.1
"""Initial temperature of SAC."""

_FIELDS = ("task", "method", "seed", "steps", "envs", "buffer", "redraw")
_FIELDS += ("reward_scale", "temperature", "updates", "batch")
_LATER = ("until", "actor_every")  # fields that runs of earlier versions lack


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
        updates: Updates per environment step.
        batch: Transitions per update.
        temperature: Initial temperature of SAC.
        until: Success rate of the last 100 training episodes at which the training ends; None to make all steps.
        actor_every: Updates of the critics for one of the actor.
        parameters: Values that the paper does not specify.
        diagnosis: Diagnosis of a sensor. Its model, drawn within its intervals for each episode, replaces the
            randomisation of the method.
        ranges: Ranges of what the diagnosis found in the scene, also drawn for each episode.

    Raises:
        InvalidValueError: A number is not positive.
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
    updates: float = 0.25
    batch: int = 256
    temperature: float = TEMPERATURE
    until: float | None = None
    actor_every: int = 1
    parameters: Parameters = PARAMETERS
    diagnosis: paxisim.diagnose.Diagnosis | None = None
    ranges: paxisim.SceneRanges = paxisim.SceneRanges()  # noqa: RUF009 - frozen

    def __post_init__(self) -> None:
        """Check the values."""
        for name in ("envs", "buffer", "batch", "actor_every"):
            if getattr(self, name) < 1:
                raise paxisim.InvalidValueError(f"{name} must be at least 1, got {getattr(self, name)!r}")
        for name in ("updates", "temperature", "reward_scale"):
            if not 0 < getattr(self, name) < float("inf"):
                raise paxisim.InvalidValueError(f"{name} must be positive and finite, got {getattr(self, name)!r}")
        if self.until is not None and not 0 < self.until <= 1:
            raise paxisim.InvalidValueError(f"until must be a success rate above 0 and at most 1, got {self.until!r}")

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
    def open(cls, folder: Path, *, resume: bool = False) -> Run:
        """Open an existing run. If it was made with other software versions, a line on stderr says so.

        Args:
            folder: Folder of the run.
            resume: Open it to continue its training, which must keep to its versions.

        Raises:
            InvalidValueError: There is no run, it cannot be read, or it cannot be resumed with the versions here.
        """
        path = folder / "run.json"
        if not path.exists():
            raise paxisim.InvalidValueError(f"{folder} has no run: make one with python -m paxisim_insertion.train")
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            differ = differing(found["versions"])
            parameters = Parameters(**{key: _tuples(value) for key, value in found["parameters"].items()})
            stored = found["diagnosis"]
            diagnosis = None if stored is None else paxisim.diagnose.Diagnosis.from_json(json.dumps(stored))
            settings = {name: found[name] for name in (*_FIELDS, *(late for late in _LATER if late in found))}
            ranges = _ranges(**found["ranges"])
            run = cls(folder, **settings, parameters=parameters, diagnosis=diagnosis, ranges=ranges)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise paxisim.InvalidValueError(f"{path} is not a run of this version: {error}") from error
        if differ:
            here = versions()
            made_with = ", ".join(f"{name} {made} (here {here.get(name)})" for name, made in differ.items())
            if resume:
                raise paxisim.InvalidValueError(f"{folder} was made with {made_with}: resume it with those")
            print(f"note: {folder} was made with {made_with}", file=sys.stderr)
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

    def make_envs(self) -> InsertionVecEnv:
        """Build all of the run's environments, seeded. Their rewards are scaled, their logged returns are not."""
        envs = [self.insertion_env(engine="native") for _ in range(self.envs)]
        made = InsertionVecEnv(envs, reward_scale=self.reward_scale)
        made.seed(self.seed * 1000)
        return made

    def policy(self, env: InsertionEnv) -> Trained:
        """Load the newest policy for `env`, the average of the training's actors.

        Raises:
            InvalidValueError: There is no policy yet, or it was trained on other observations.
        """
        return Trained.load(self.folder, env)

    def save(self, model: SAC) -> None:
        """Save a model in place of the previous one, atomically."""
        with whole_file(self.model_path) as new:
            model.save(new)

    def _identity(self) -> dict[str, Any]:
        own = {name: getattr(self, name) for name in (*_FIELDS, *_LATER)}
        found = None if self.diagnosis is None else json.loads(self.diagnosis.to_json())
        return {**own, "parameters": asdict(self.parameters), "diagnosis": found, "ranges": asdict(self.ranges)}


def _ranges(
    parameters: Sequence[dict[str, Any]] = (), intervals: Sequence[Any] = (), pads: Sequence[str] = ()
) -> paxisim.SceneRanges:
    known = tuple(paxisim.SceneParameter(**item) for item in parameters)
    return paxisim.SceneRanges(known, _tuples(list(intervals)), tuple(pads))


def _tuples(value: Any) -> Any:
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value
