"""Work: the remaining commands of a cell, and the runners, which work on cells on this machine or on a Ray cluster."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import paxisim

from .cells import Cell


def say(line: str) -> None:
    """Print a line in one write, so that threads that print at the same time do not mix theirs."""
    print(f"{line}\n", end="", flush=True)


@dataclass(frozen=True)
class Done:
    """A cell that was worked on.

    Attributes:
        cell: The cell.
        wrong: What went wrong; None if the cell has all its results.
        seconds: Time that it took.
    """

    cell: Cell
    wrong: str | None
    seconds: float


def log_of(cell: Cell, runs: Path) -> Path:
    """Return the path of the log of a cell's commands."""
    return runs / f"{cell.folder}.log"


def work(cell: Cell, runs: Path, out: Path) -> Done:
    """Run the remaining commands of a cell, on one core.

    Args:
        cell: The cell.
        runs: Existing folder of the runs and their logs.
        out: Folder of the results.
    """
    began, wrong = time.monotonic(), None
    try:
        for words in cell.commands(runs, out):
            if status := _status(words, log_of(cell, runs)):
                wrong = f"{words[0]} {_how(status)}, see {log_of(cell, runs)}"
                break
    except (paxisim.PaxisimError, OSError) as error:
        wrong = f"failed: {error}"
    return Done(cell, wrong, time.monotonic() - began)


def _how(status: int) -> str:
    """Say how a command failed, from its exit status."""
    if status >= 0:
        return "failed"
    name = signal.Signals(-status).name
    # a replay buffer lies in files that are mapped into memory
    return f"was killed by {name}" + (" (the disk of --runs is full)" if name == "SIGBUS" else "")


def _status(words: list[str], log: Path) -> int:
    arguments = [sys.executable, "-m", "paxisim_lab.tied", *words]
    # with one thread the numbers do not depend on the machine's number of cores
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with (
        log.open("a", encoding="utf-8") as output,
        subprocess.Popen(
            arguments, stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT, env=environment
        ) as process,
    ):
        return process.wait()


class Here:
    """The runner that works on cells on this machine, each in its own process.

    Attributes:
        at_once: Number of cells at a time.
    """

    def __init__(self, jobs: int) -> None:
        """Work on `jobs` cells at a time.

        Raises:
            InvalidValueError: `jobs` is less than 1.
        """
        if jobs < 1:
            raise paxisim.InvalidValueError(f"jobs must be at least 1, got {jobs}")
        self.at_once = jobs

    def run(self, cells: list[Cell], runs: Path, out: Path) -> Iterator[Done]:
        """Work on cells, in their order as far as possible, and yield each when it is done or has failed."""

        def begin(cell: Cell) -> Done:
            say(f"{cell}: started, log in {log_of(cell, runs)}")
            return work(cell, runs, out)

        pool = ThreadPoolExecutor(self.at_once)
        try:
            for future in as_completed([pool.submit(begin, cell) for cell in cells]):
                yield future.result()
        finally:
            pool.shutdown(cancel_futures=True)


class OnRay:
    """The runner that works on cells on a Ray cluster, each on one core of any node.

    Runs and results lie in folders that all nodes share. A cell whose worker or node dies is started again on another
    one and resumes the training there from its newest checkpoint.
    """

    def __init__(self, address: str = "auto") -> None:
        """Connect to a running cluster, see `paxisim.RayCluster`."""
        self._cluster = paxisim.RayCluster(address)

    @property
    def at_once(self) -> int:
        """Number of cells at a time: the number of cores that the cluster has now."""
        return self._cluster.cores

    def run(self, cells: list[Cell], runs: Path, out: Path) -> Iterator[Done]:
        """Work on cells as `Here.run` does. Then leave the cluster."""
        runs, out = runs.resolve(), out.resolve()
        out.mkdir(parents=True, exist_ok=True)
        for cell, done in self._cluster.run(partial(work, runs=runs, out=out), cells, [runs, out]):
            yield Done(cell, str(done), 0.0) if isinstance(done, paxisim.PaxisimError) else done
