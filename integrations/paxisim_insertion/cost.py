"""``python -m paxisim_insertion.cost integrations/matrix.toml --seeds 100``: what a matrix would cost."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import paxisim

from .cells import Cell, read_cells
from .rates import TABLE_2_SIM, read_results, with_cost
from .results import Result
from .shell import command
from .tasks import TASKS


@dataclass(frozen=True)
class Cost:
    """Time of a matrix on a number of cores.

    Attributes:
        cores: Number of cores, each with one cell at a time.
        hours: Time until the last cell is done.
        used: Fraction of the cores' time in which they train.
    """

    cores: int
    hours: float
    used: float


def cost(
    file: Path,
    /,
    *,
    seeds: int = 100,
    cores: tuple[int, ...] = (2, 64, 1024),
    results: Path | None = None,
) -> None:
    """Print what the paper's table, all tasks by its six methods, would cost with many seeds; trainings alone.

    The CPU seconds per training step are those of the results: the mean of a task and method, or else of the method,
    or else of all. The steps are those of the matrix.

    Args:
        file: TOML file of a matrix, for the steps of each task.
        seeds: Number of seeds of each task and method.
        cores: Numbers of cores.
        results: Folder of the results. Default: the results that come with the package and those in ./results.
    """
    if seeds < 1 or any(number < 1 for number in cores):
        raise paxisim.InvalidValueError(f"seeds and cores must be at least 1, got {seeds} and {cores}")
    steps = {cell.task: cell.steps for cell in read_cells(file)}
    cells = [Cell(t, m, seed, steps[t]) for seed in range(seeds) for m in TABLE_2_SIM for t in TASKS if t in steps]
    found = with_cost(read_results(results))
    if not found:
        raise paxisim.InvalidValueError("no result has CPU seconds of a training: train and evaluate a cell first")
    seconds = [seconds_of(cell, found) for cell in cells]
    measured = {(r.task, r.method) for r in found} & {(cell.task, cell.method) for cell in cells}
    each = len({(cell.task, cell.method) for cell in cells})
    print(
        f"{len(cells)} cells, {sum(seconds) / 3600:,.0f} core hours; measured: {len(measured)} of {each} combinations"
    )
    print(f"longest cell {max(seconds) / 60:.0f} min, shortest {min(seconds) / 60:.0f} min\n")
    print("| cores | time | cores in use |\n|---|---|---|")
    for number in cores:
        told = schedule(seconds, number)
        time = f"{told.hours / 24:.1f} days" if told.hours >= 48 else f"{told.hours:.1f} h"
        print(f"| {told.cores} | {time} | {told.used:.0%} |")


def seconds_of(cell: Cell, found: list[Result]) -> float:
    """Return the estimated CPU seconds of a training, from results that have theirs."""
    same = [r for r in found if (r.task, r.method) == (cell.task, cell.method)]
    like = [r for r in found if r.method == cell.method]
    per_step = [r.training["cpu_seconds"] / r.training["steps"] for r in same or like or found]
    return float(np.mean(per_step)) * cell.steps


def schedule(seconds: Iterable[float], cores: int) -> Cost:
    """Return the cost when each core that is free takes the next cell, in the given order."""
    free, total = [0.0] * cores, 0.0
    for one in seconds:
        first = free.index(min(free))
        free[first] += one
        total += one
    return Cost(cores, max(free) / 3600, total / (cores * max(free)))


if __name__ == "__main__":
    sys.exit(command(cost))
