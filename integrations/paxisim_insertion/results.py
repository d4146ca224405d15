"""Results of evaluations, one JSON file each, and the software versions that made them."""

from __future__ import annotations

import contextlib
import json
import os
import platform
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

import paxisim

RUNS = Path("runs")
"""Default folder of training runs, in the working directory."""

OUT = Path("results")
"""Default folder of new results, in the working directory."""

FIRST_SEED = 1_000_000
"""First seed of the evaluation's episodes; no training run uses them."""

IN_SIMULATION = "sim"
"""Sensor name for the simulated sensor that the method is trained with."""

DRAWN = "sim, drawn actions"
"""Sensor name for the same, with actions sampled as in training."""

SURROGATE = "surrogate "
"""Beginning of the sensor names of surrogates."""

TRANSFER = "transfer"
"""Beginning of the sensor names of stand-ins for a real robot, see `paxisim_insertion.transfer`."""

PADS, SURROGATES = f"{TRANSFER} pads", f"{TRANSFER} surrogates"
"""Sensor names for magnetic pads and for surrogates."""

PACKAGES = ("mujoco", "robosuite", "stable-baselines3", "torch", "gymnasium", "numpy", "mujoco-warp", "warp-lang")
"""Packages whose versions a result depends on."""


def folder_of(task: str, method: str, seed: int) -> str:
    """Return the folder name of a training run."""
    return _plain(f"{task}_{method}_{seed}")


def file_of(task: str, method: str, sensor: str, seed: int) -> str:
    """Return the file name of a result."""
    return _plain(f"{task}_{method}_{sensor}_{seed}.json")


def _plain(name: str) -> str:
    return name.replace(" ", "-").replace("/", "").replace(",", "")


def sensor_name(sensor: str | Path) -> str:
    """Return the name of a surrogate, given as for ``.evaluate --sensor``, in results."""
    return f"{SURROGATE}{Path(str(sensor).replace(':', '-')).stem}"


def interval_of(successes: int, trials: int) -> tuple[float, float]:
    """Return the 95 % Wilson interval of a success rate."""
    low, high = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(low), float(high)


def versions() -> dict[str, str]:
    """Return the software versions that a result depends on, of the packages that are installed."""
    found: dict[str, str] = {}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return {"paxisim": paxisim.__version__, "python": platform.python_version(), **found}


def differing(made_with: dict[str, str]) -> dict[str, str]:
    """Return the versions of `made_with` that differ from those here; 2.13.0+cpu and 2.13.0 are the same version."""
    here = versions()
    return {n: made for n, made in made_with.items() if plain(here.get(n, "")) != plain(made)}


def plain(version: str) -> str:
    """Return a version without its build, such as +cpu."""
    return version.split("+")[0]


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path beside `path`, which replaces it at the end. An error leaves no part of it, and names `path`."""
    new = path.with_name(f"{path.stem}.new{path.suffix}")
    try:
        yield new
        os.replace(new, path)
    except BaseException as error:
        new.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno is not None and error.filename in (None, str(new)):
            error.filename = str(path)  # as for a full disk
        raise


def write_whole(path: Path, text: str) -> None:
    """Write a text file atomically, in place of an older one."""
    with whole_file(path) as new:
        new.write_text(text, encoding="utf-8")


@dataclass(frozen=True)
class Result:
    """One evaluation.

    Attributes:
        task: Name of the task.
        method: Name of the method.
        sensor: ``"sim"`` for the sensor that the method is trained with, with ``", drawn actions"`` appended if actions
            were sampled; ``"transfer pads"`` and ``"transfer surrogates"`` for the stand-ins of the real robot;
            otherwise ``"surrogate NAME"``. For an engine other than robosuite's, its name is appended. No real sensor
            was involved.
        seed: Seed of the training run.
        trials: Number of episodes.
        success_rate: Fraction of episodes that succeeded.
        interval: 95 % Wilson interval of the success rate.
        versions: Software versions of the evaluation.
        training: Steps, settings and cost of the training.
        parts: Successes and episodes per kind of sensor, if there are several.
        mean_force: Mean force (N) between peg and base while they touch, at 20 Hz; None if unknown.
        peak_force: Mean of the episodes' largest forces (N) between peg and base; None if unknown.
    """

    task: str
    method: str
    sensor: str
    seed: int
    trials: int
    success_rate: float
    interval: tuple[float, float]
    versions: dict[str, str]
    training: dict[str, Any]
    parts: dict[str, tuple[int, int]] = field(default_factory=dict)
    mean_force: float | None = None
    peak_force: float | None = None

    @property
    def has_ended(self) -> bool:
        """Whether the training ended at the success rate that it was to reach, before all of its steps."""
        until = self.training.get("until")
        return until is not None and self.training["success"] >= until

    def save(self, folder: Path = OUT) -> Path:
        """Write the result atomically to a file named after task, method, sensor and seed, over an older one."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / file_of(self.task, self.method, self.sensor, self.seed)
        write_whole(path, json.dumps(asdict(self), indent=1) + "\n")
        return path

    @classmethod
    def load(cls, path: Path) -> Result:
        """Read a result.

        Raises:
            InvalidValueError: The file is not a result.
        """
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            parts = {kind: tuple(counts) for kind, counts in found.get("parts", {}).items()}
            return cls(**{**found, "interval": tuple(found["interval"]), "parts": parts})
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise paxisim.InvalidValueError(f"{path} is not a result: {error}") from error
