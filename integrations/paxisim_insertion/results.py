"""Results: what an evaluation found, one JSON file each."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

import paxisim

RESULTS = Path(__file__).parent / "results"
"""Those that come with the package."""

RUNS = Path("runs")
"""Where the folders of trainings go, in the working directory."""

OUT = Path("results")
"""Where one's own go, in the working directory."""

IN_SIMULATION = "sim"
"""The name of the sensor that is none: what the method is trained with."""

DRAWN = "sim, drawn actions"
"""The same, with actions as a training draws them."""

TRANSFER = "transfer"
"""The name of all that stands for a real robot together, see `paxisim_insertion.transfer` and `Gap`."""


def folder_of(task: str, method: str, seed: int) -> str:
    """The name of a training's folder."""
    return _plain(f"{task}_{method}_{seed}")


def file_of(task: str, method: str, sensor: str, seed: int) -> str:
    """The name of a result's file."""
    return _plain(f"{task}_{method}_{sensor}_{seed}.json")


def _plain(name: str) -> str:
    return name.replace(" ", "-").replace("/", "").replace(",", "")


def interval_of(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a success rate."""
    low, high = binomtest(successes, trials).proportion_ci(method="wilson")
    return float(low), float(high)


@dataclass(frozen=True)
class Result:
    """One evaluation.

    Attributes:
        task: Name of the task.
        method: Name of the method.
        sensor: ``"sim"`` for what the method is trained with, ``"transfer"`` for what stands for the real robot, else
            ``"surrogate NAME"``: no real sensor was involved.
        seed: Of the training run.
        trials: Episodes.
        success_rate: Share of them that succeeded.
        interval: 95 % Wilson interval of it.
        versions: Software of the evaluation.
        training: Steps, and whatever else tells the training's cost.
        parts: Successes and episodes of each kind of sensor, where there are several.
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

    def save(self, folder: Path = OUT) -> Path:
        """Write it under the name of task, method, sensor and seed, in place of an older one."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / file_of(self.task, self.method, self.sensor, self.seed)
        path.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")
        return path

    @classmethod
    def load(cls, path: Path) -> Result:
        """Read one.

        Raises:
            InvalidValueError: The file is not a result.
        """
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
            parts = {kind: tuple(counts) for kind, counts in found.get("parts", {}).items()}
            return cls(**{**found, "interval": tuple(found["interval"]), "parts": parts})
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise paxisim.InvalidValueError(f"{path} is not a result: {error}") from error
