"""Results: what an evaluation found, one JSON file each, in the package's folder ``results``."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import paxisim

RESULTS = Path(__file__).parent / "results"
IN_SIMULATION = "sim"
"""The name of the sensor that is none: what the method is trained with."""


@dataclass(frozen=True)
class Result:
    """One evaluation.

    Attributes:
        task: Name of the task.
        method: Name of the method.
        sensor: ``"sim"`` for what the method is trained with, else ``"surrogate NAME"``: no real sensor was involved.
        seed: Of the training run.
        trials: Episodes.
        success_rate: Share of them that succeeded.
        interval: 95 % Wilson interval of it.
        versions: Software of the evaluation.
        training: Steps, and whatever else tells the training's cost.
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

    def save(self, folder: Path = RESULTS) -> Path:
        """Write it under the name of task, method, sensor and seed, in place of an older one."""
        folder.mkdir(parents=True, exist_ok=True)
        name = f"{self.task}_{self.method}_{self.sensor}_{self.seed}.json"
        path = folder / name.replace(" ", "-").replace("/", "")
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
            return cls(**{**found, "interval": tuple(found["interval"])})
        except (ValueError, TypeError, KeyError) as error:
            raise paxisim.InvalidValueError(f"{path} is not a result: {error}") from error


def wilson(successes: int, trials: int, z: float = 1.96) -> tuple[float, float]:
    """The Wilson score interval of a share, by default of 95 %.

    Raises:
        InvalidValueError: There are no trials, or more successes than trials.
    """
    if not 0 <= successes <= trials or trials == 0:
        raise paxisim.InvalidValueError(f"expected 0 to {trials} successes of at least one trial, got {successes}")
    share = successes / trials
    middle = share + z * z / (2 * trials)
    half = z * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    scale = 1 + z * z / trials
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)
