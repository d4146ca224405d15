"""Results: what an evaluation found, one JSON file each."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import paxisim

RESULTS = Path(__file__).parent / "results"
"""Those that come with the package."""

OUT = Path("results")
"""Where one's own go, in the working directory."""

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

    def save(self, folder: Path = OUT) -> Path:
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
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise paxisim.InvalidValueError(f"{path} is not a result: {error}") from error
