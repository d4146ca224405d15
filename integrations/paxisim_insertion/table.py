"""``python -m paxisim_insertion.table``: the paper's Table II and ablation beside our results."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import fisher_exact

from .results import DRAWN, IN_SIMULATION, OUT, RESULTS, TRANSFER, Result, interval_of
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
"""The paper's success rates on the real robot. Ours use surrogates and are only comparable with each other."""

ABLATION_REAL = {
    "GCS": (None, None, 0.9, None, 0.9, 0.7),
    "GCS w/o G": (None, None, 0.9, None, 0.4, 0.0),
    "GCS w/o S": (None, None, 0.8, None, 0.3, 0.6),
    "GCS w/o C": (None, None, 0.6, None, 0.3, 0.2),
}
"""The paper's ablation on the real robot."""

PAPER_TRIALS = {IN_SIMULATION: 50, TRANSFER: 10}
"""Episodes per success rate in the paper."""

SIGNIFICANT = 0.05
"""Significance level of Fisher's exact test, below which rates are listed as different."""


def table(results: Path | None = None) -> None:
    """Print the tables: the paper's success rate, a slash, and ours over all seeds with its 95 % interval.

    Args:
        results: Folder of the results. Default: the results that come with the package and those in ./results, which
            take precedence for the same task, method, sensor and seed.
    """
    found = read_results(results)
    more = {r.method: (None,) * len(TASKS) for r in found if r.method not in {**TABLE_2_SIM, **ABLATION_REAL}}
    ablated = {method: (None,) * len(TASKS) for method in ABLATION_REAL if method not in TABLE_2_SIM}
    _print("Simulation (paper / ours)", {**TABLE_2_SIM, **ablated, **more}, found, IN_SIMULATION)
    if any(result.sensor == DRAWN for result in found):
        _print("Simulation, actions drawn (paper / ours)", {"NT": TABLE_2_SIM["NT"]}, found, DRAWN)
    _print("Paper's real robot / our transfer to surrogates", {**TABLE_2_REAL, **more}, found, TRANSFER)
    _print("Ablation: paper's real robot / our transfer", ABLATION_REAL, found, TRANSFER)
    _print_kinds(found)
    for sensor in sorted({result.sensor for result in found} - {IN_SIMULATION, DRAWN, TRANSFER}):
        tried = {result.method for result in found if result.sensor == sensor}
        paper = {method: rates for method, rates in {**TABLE_2_REAL, **ablated, **more}.items() if method in tried}
        _print(f"Paper's real robot / our {sensor}", paper, found, sensor)
    _print_differences(found)
    _print_cost(found)


def read_results(folder: Path | None) -> list[Result]:
    """Read the results of a folder, or those of the package and of ./results, see `table`."""
    folders = (RESULTS, OUT) if folder is None else (folder,)
    paths = {path.name: path for folder in folders for path in sorted(folder.glob("*.json"))}
    return [Result.load(path) for _, path in sorted(paths.items())]


def pooled(found: list[Result], task: str, method: str, sensor: str) -> tuple[int, int]:
    """Return the successes and episodes of all seeds together."""
    these = [r for r in found if (r.task, r.method, r.sensor) == (task, method, sensor)]
    return sum(round(r.success_rate * r.trials) for r in these), sum(r.trials for r in these)


def _print(title: str, paper: Mapping[str, tuple[float | None, ...]], found: list[Result], sensor: str) -> None:
    print(f"\n{title}\n\n| method | {' | '.join(TASKS)} | mean |\n|{'---|' * (2 + len(TASKS))}")
    for method, rates in paper.items():
        ours = [pooled(found, task, method, sensor) for task in TASKS]
        if not any(trials for _, trials in ours) and not any(rate is not None for rate in rates):
            continue
        cells = [
            f"{_number(rate)} / {_rate(*counts)}".rstrip() if rate is not None or counts[1] else ""
            for rate, counts in zip(rates, ours, strict=True)
        ]
        both = (_mean(list(rates)), _mean([good / trials if trials else None for good, trials in ours]))
        mean = " / ".join(map(_number, both)).rstrip() if any(value is not None for value in both) else ""
        print(f"| {method} | {' | '.join(cells)} | {mean} |")


def _print_kinds(found: list[Result]) -> None:
    """Print the transfer results per kind of sensor, with all tasks of a method together."""
    these = [result for result in found if result.sensor == TRANSFER]
    kinds = list(dict.fromkeys(kind for result in these for kind in result.parts))
    if not kinds:
        return
    print(f"\nTransfer, all tasks, by kind of sensor\n\n| method | {' | '.join(kinds)} |\n|{'---|' * (1 + len(kinds))}")
    for method in dict.fromkeys(result.method for result in these):
        counts = np.array([[r.parts.get(kind, (0, 0)) for kind in kinds] for r in these if r.method == method])
        print(f"| {method} | {' | '.join(_rate(*total) for total in counts.sum(axis=0).tolist())} |")


def _print_differences(found: list[Result]) -> None:
    print(f"\nWhere ours differs from the paper's (Fisher's exact test, p < {SIGNIFICANT:g})\n")
    papers = ((IN_SIMULATION, TABLE_2_SIM), (TRANSFER, {**ABLATION_REAL, **TABLE_2_REAL}))
    for sensor, paper in papers:
        for method, rates in paper.items():
            for task, rate in zip(TASKS, rates, strict=True):
                good, trials = pooled(found, task, method, sensor)
                if rate is None or not trials:
                    continue
                count = PAPER_TRIALS[sensor]
                theirs = round(rate * count)
                test: Any = fisher_exact([[good, trials - good], [theirs, count - theirs]])
                p = float(test[1])
                if p < SIGNIFICANT:
                    print(f"- {sensor}, {task} {method}: {rate:.2f} / {_rate(good, trials)}, p = {p:.2g}")


def _print_cost(found: list[Result]) -> None:
    """Print the CPU time of a training, averaged over seeds."""
    print(f"\nCPU minutes of a training\n\n| method | {' | '.join(TASKS)} |\n|{'---|' * (1 + len(TASKS))}")
    trained = [r for r in found if r.sensor == IN_SIMULATION and r.training.get("cpu_seconds")]
    for method in dict.fromkeys(result.method for result in trained):
        cells = []
        for task in TASKS:
            minutes = [r.training["cpu_seconds"] / 60 for r in trained if (r.task, r.method) == (task, method)]
            cells.append(f"{np.mean(minutes):.0f}" if minutes else "")
        print(f"| {method} | {' | '.join(cells)} |")


def _mean(rates: list[float | None]) -> float | None:
    """Return the mean, or None unless every task has a rate."""
    values = [rate for rate in rates if rate is not None]
    return float(np.mean(values)) if len(values) == len(rates) else None


def _number(rate: float | None) -> str:
    return "" if rate is None else f"{rate:.2f}"


def _rate(good: int, trials: int) -> str:
    if not trials:
        return ""
    low, high = interval_of(good, trials)
    return f"{good / trials:.2f} ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    sys.exit(command(table))
