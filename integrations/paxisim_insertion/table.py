"""``python -m paxisim_insertion.table``: the paper's Table II and its ablation, its figures beside ours."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .results import IN_SIMULATION, OUT, RESULTS, Result
from .shell import command
from .tasks import TASKS

TABLE_2_SIM = {
    "NT": (0.94, 0.82, 0.6, 0.56, 0.42, 0.2),
    "TF": (1.0, 0.98, 0.8, 0.0, 1.0, 0.74),
    "TB": (1.0, 0.82, 0.62, 0.36, 0.84, 0.1),
    "TD": (1.0, 0.86, 0.9, 0.88, 0.88, 0.80),
    "DT": (1.0, 0.96, 0.84, 0.94, 0.96, 0.84),
    "GCS": (1.0, 0.9, 0.84, 0.98, 0.98, 0.76),
}
"""The paper's success rates in simulation, in the order of the tasks."""

TABLE_2_REAL = {
    "NT": (0.4, 0.4, 0.0, 0.1, 0.0, 0.0),
    "TF": (0.4, 0.3, 0.3, 0.0, 0.4, 0.1),
    "TB": (0.5, 0.3, 0.4, 0.1, 0.5, 0.2),
    "TD": (0.1, 0.4, 0.0, 0.2, 0.2, 0.2),
    "DT": (0.6, 0.2, 0.1, 0.3, 0.4, 0.1),
    "GCS": (0.9, 0.8, 0.9, 0.6, 0.9, 0.7),
}
"""The paper's success rates on the real robot. Ours on a surrogate are to be compared among each other only."""

ABLATION_REAL = {
    "GCS": (None, None, 0.9, None, 0.9, 0.7),
    "GCS w/o G": (None, None, 0.9, None, 0.4, 0.0),
    "GCS w/o S": (None, None, 0.8, None, 0.3, 0.6),
    "GCS w/o C": (None, None, 0.6, None, 0.3, 0.2),
}
"""The paper's ablation, on the real robot."""


def table(results: Path | None = None) -> None:
    """Print the tables: the paper's figure, a stroke, ours, the mean over seeds; nothing where there is none.

    Args:
        results: Folder of the results. Default: those that come with the package, and those in ./results, of which one
            of the same task, method, sensor and seed takes the other's place.
    """
    folders = (RESULTS, OUT) if results is None else (results,)
    paths = {path.name: path for folder in folders for path in sorted(folder.glob("*.json"))}
    found = [Result.load(path) for _, path in sorted(paths.items())]
    surrogates = sorted({result.sensor for result in found} - {IN_SIMULATION})
    more = {r.method: (None,) * len(TASKS) for r in found if r.method not in TABLE_2_SIM}
    _print("Simulation (paper / ours)", {**TABLE_2_SIM, **more}, found, IN_SIMULATION)
    for sensor in surrogates or ["surrogate"]:
        _print(f"Paper's real robot / our {sensor}", {**TABLE_2_REAL, **more}, found, sensor)
        _print(f"Ablation: paper's real robot / our {sensor}", ABLATION_REAL, found, sensor)


def _print(title: str, paper: Mapping[str, tuple[float | None, ...]], found: list[Result], sensor: str) -> None:
    print(f"\n{title}\n\n| method | {' | '.join(TASKS)} |\n|{'---|' * (1 + len(TASKS))}")
    for method, rates in paper.items():
        cells = []
        for task, rate in zip(TASKS, rates, strict=True):
            ours = [r.success_rate for r in found if (r.task, r.method, r.sensor) == (task, method, sensor)]
            cells.append(f"{'' if rate is None else f'{rate:.2f}'} / {f'{np.mean(ours):.2f}' if ours else ''}")
        print(f"| {method} | {' | '.join(cells)} |")


if __name__ == "__main__":
    sys.exit(command(table))
