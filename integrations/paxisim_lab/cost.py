"""``python -m paxisim_lab.cost integrations/matrix.toml --seeds 100``: what a matrix would cost."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from paxisim_insertion.results import Result
from paxisim_insertion.shell import command
from paxisim_insertion.tasks import TASKS

import paxisim

from .cells import Cell, read_cells
from .rates import TABLE_2_SIM, read_results, with_cost


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
    total, longest, shortest = sum(seconds), max(seconds), min(seconds)
    wanted = {(cell.task, cell.method) for cell in cells}
    measured = wanted & {(result.task, result.method) for result in found}
    print(
        f"{len(cells)} cells, {total / 3600:,.0f} core hours; measured: {len(measured)} of {len(wanted)} combinations"
    )
    print(f"longest cell {longest / 60:.0f} min, shortest {shortest / 60:.0f} min\n")
    print("| cores | time | cores in use |\n|---|---|---|")
    for number in cores:
        time = schedule(seconds, number)
        duration = f"{time / 86400:.1f} days" if time >= 48 * 3600 else f"{time / 3600:.1f} h"
        print(f"| {number} | {duration} | {total / (number * time):.0%} |")


def seconds_of(cell: Cell, found: list[Result]) -> float:
    """Return the estimated CPU seconds of a training, from results that have theirs."""
    same = [r for r in found if (r.task, r.method) == (cell.task, cell.method)]
    like = [r for r in found if r.method == cell.method]
    per_step = [r.training["cpu_seconds"] / r.training["steps"] for r in same or like or found]
    return float(np.mean(per_step)) * cell.steps


def schedule(seconds: Iterable[float], cores: int) -> float:
    """Return the time (s) of all cells when each core that is free takes the next cell, in the given order."""
    free = [0.0] * cores
    for one in seconds:
        free[free.index(min(free))] += one
    return max(free)


if __name__ == "__main__":
    sys.exit(command(cost))
