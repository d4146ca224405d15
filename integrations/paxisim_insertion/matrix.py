"""``python -m paxisim_insertion.matrix integrations/matrix.toml``: train and evaluate tasks x methods x seeds."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import paxisim

from .methods import find_method
from .results import DRAWN, IN_SIMULATION, OUT, RUNS, TRANSFER, Result, file_of, folder_of
from .shell import command
from .table import table
from .tasks import find_task

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]

EVALUATIONS = {IN_SIMULATION: [], TRANSFER: ["--transfer"]}
"""Evaluations of a cell, with their command-line options."""

BLIND = {**EVALUATIONS, DRAWN: ["--drawn"]}
"""Evaluations for a method without touch, whose most likely action may never change."""


@dataclass(frozen=True)
class Cell:
    """One training run and its evaluations.

    Attributes:
        task: Name of the task.
        method: Name of the method.
        seed: Random seed of the training.
        steps: Environment steps of the training.
    """

    task: str
    method: str
    seed: int
    steps: int

    @property
    def evaluations(self) -> dict[str, list[str]]:
        """Evaluations of this cell, with their command-line options."""
        return BLIND if find_method(self.method).encoding == "NT" else EVALUATIONS

    def has(self, sensor: str, out: Path) -> bool:
        """Return whether the complete training was evaluated with this sensor."""
        path = out / file_of(self.task, self.method, sensor, self.seed)
        return path.exists() and Result.load(path).training["steps"] >= self.steps

    def is_finished(self, out: Path) -> bool:
        """Return whether all results of the cell exist."""
        return all(self.has(sensor, out) for sensor in self.evaluations)

    def commands(self, runs: Path, out: Path) -> Iterator[list[str]]:
        """Yield the remaining commands; each continues where it stopped."""
        folder = runs / folder_of(self.task, self.method, self.seed)
        train = ["train", "--out", str(folder), "--steps", str(self.steps)]
        if (folder / "run.json").exists():
            yield [*train, "--resume"]
        else:
            yield [*train, "--task", self.task, "--method", self.method, "--seed", str(self.seed)]
        for sensor, options in self.evaluations.items():
            if not self.has(sensor, out):
                yield ["evaluate", "--run", str(folder), "--out", str(out), *options]

    def __str__(self) -> str:
        """Return the name of the cell in messages."""
        return f"{self.task} {self.method} seed {self.seed}"


def read_cells(file: Path) -> list[Cell]:
    """Read the cells of a TOML file, in its order and without duplicates.

    ``steps`` is a table of training steps by task. Each ``[[cells]]`` has the lists ``tasks``, ``methods`` and
    ``seeds``; every combination is a cell, with tasks varying fastest.

    Raises:
        InvalidValueError: The file is not a matrix.
        UnknownNameError: There is no such task or method.
    """
    try:
        found = tomllib.loads(file.read_text(encoding="utf-8"))
        unknown = set(found) - {"steps", "cells"}
        if unknown:
            raise ValueError(f"unknown key {sorted(unknown)[0]!r}")
        steps = {find_task(task).name: _whole(number, 1) for task, number in found["steps"].items()}
        cells = [cell for group in found["cells"] for cell in _combined(steps, **group)]
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise paxisim.InvalidValueError(
            f"{file} is not a matrix: expected [steps] and [[cells]] with tasks, methods and seeds: {error!r}"
        ) from error
    return list(dict.fromkeys(cells))


def _combined(steps: dict[str, int], *, tasks: list[str], methods: list[str], seeds: list[int]) -> Iterator[Cell]:
    for seed in seeds:
        for method in methods:
            for task in tasks:
                yield Cell(find_task(task).name, find_method(method).name, _whole(seed, 0), steps[task])


def _whole(value: Any, least: int) -> int:
    if type(value) is not int or value < least:
        raise ValueError(f"expected an integer of at least {least}, got {value!r}")
    return value


class Matrix:
    """The unfinished cells, their progress and the estimated remaining time."""

    def __init__(self, cells: list[Cell], runs: Path, out: Path, jobs: int) -> None:
        """Take the unfinished cells; logs and runs go to `runs`, results to `out`."""
        self._cells, self._runs, self._out, self._jobs = cells, runs, out, jobs
        self._steps, self._done, self._seconds = sum(cell.steps for cell in cells), 0, 0.0
        self._lock = Lock()

    def run(self) -> list[Cell]:
        """Train and evaluate all cells, several at a time.

        Returns:
            The cells that failed.
        """
        with ThreadPoolExecutor(self._jobs) as pool:
            succeeded = list(pool.map(self._work, self._cells))
        return [cell for cell, did in zip(self._cells, succeeded, strict=True) if not did]

    def _work(self, cell: Cell) -> bool:
        log = self._runs / f"{folder_of(cell.task, cell.method, cell.seed)}.log"
        began = time.monotonic()
        print(f"{cell}: started, log in {log}", flush=True)
        try:
            wrong = self._do(cell, log)
        except (paxisim.PaxisimError, OSError) as error:
            wrong = f"failed: {error}"
        with self._lock:
            self._done += cell.steps
            self._seconds += time.monotonic() - began
            hours = self._seconds / self._done * (self._steps - self._done) / self._jobs / 3600
            outcome = wrong or "finished"
            print(f"{cell}: {outcome}; {self._done} of {self._steps} steps, {hours:.1f} h left", flush=True)
        return wrong is None

    def _do(self, cell: Cell, log: Path) -> str | None:
        """Run the remaining commands of a cell; return an error message or None."""
        for words in cell.commands(self._runs, self._out):
            arguments = [sys.executable, "-m", f"paxisim_insertion.{words[0]}", *words[1:]]
            with log.open("a", encoding="utf-8") as told:
                if subprocess.call(arguments, stdout=told, stderr=subprocess.STDOUT):
                    return f"{words[0]} failed, see {log}"
        return None


def matrix(
    file: Path,
    /,
    *,
    jobs: int = 1,
    runs: Path = RUNS,
    out: Path = OUT,
) -> None:
    """Train and evaluate every cell of a file and print the tables. A restarted command continues where it stopped.

    Args:
        file: TOML file with the steps of each task and lists of tasks, methods and seeds.
        jobs: Number of cells at a time, each in its own process; each process needs one core.
        runs: Folder of the runs and their logs.
        out: Folder of the results. A cell that has all its results is skipped.
    """
    if jobs < 1:
        raise paxisim.InvalidValueError(f"jobs must be at least 1, got {jobs}")
    cells = read_cells(file)
    left = [cell for cell in cells if not cell.is_finished(out)]
    print(f"{len(cells)} cells, {len(cells) - len(left)} of them finished", flush=True)
    runs.mkdir(parents=True, exist_ok=True)
    failed = Matrix(left, runs, out, jobs).run()
    table(out)
    if failed:
        raise paxisim.PaxisimError(f"{len(failed)} of {len(left)} cells failed: {', '.join(map(str, failed))}")


if __name__ == "__main__":
    sys.exit(command(matrix))
