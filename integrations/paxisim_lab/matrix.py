"""``python -m paxisim_lab.matrix integrations/matrix.toml``: train and evaluate tasks x methods x seeds."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import tyro
from paxisim_insertion.results import OUT, RUNS
from paxisim_insertion.shell import command

import paxisim

from .cells import Cell, read_cells
from .rates import results_in
from .report import check_report, write_report
from .table import print_tables
from .work import Done, Here, OnRay, say


def matrix(
    file: Path,
    /,
    *,
    jobs: int = 1,
    ray: Annotated[tuple[str, ...] | None, tyro.conf.arg(metavar="[ADDRESS]")] = None,
    runs: Path = RUNS,
    out: Path = OUT,
    report: Path | None = None,
) -> None:
    """Train and evaluate every cell of a file and print the tables. A restarted command continues where it stopped.

    Args:
        file: TOML file with the steps of each task and lists of tasks, methods and seeds.
        jobs: Number of cells at a time, each in its own process; each process needs one core.
        ray: Work on a Ray cluster instead, on as many cells at a time as it has cores: HOST:PORT of its head; without
            an address, the cluster that this machine belongs to. All nodes must see the folders of --runs and --out.
        runs: Folder of the runs and their logs.
        out: Folder of the results. A cell that has all its results is skipped.
        report: HTML file for the tables and the learning curves; an existing one is replaced.
    """
    cells = read_cells(file)
    if report is not None:
        check_report(report)
    runner = _runner(jobs, ray)
    left = [cell for cell in cells if not cell.is_finished(out)]
    print(f"{len(cells)} cells, {len(cells) - len(left)} of them finished", flush=True)
    runs.mkdir(parents=True, exist_ok=True)
    failed = _run(left, runner, runs, out)
    if found := results_in(out):
        print_tables(found)
    if report is not None:
        print(f"\n{write_report(report, cells, failed, runs, out)}")
    if failed:
        names = ", ".join(str(done.cell) for done in failed)
        raise paxisim.PaxisimError(f"{len(failed)} of {len(left)} cells failed: {names}")


def _runner(jobs: int, ray: tuple[str, ...] | None) -> Here | OnRay:
    if ray is None:
        return Here(jobs)
    if jobs != 1:
        raise paxisim.InvalidValueError("expected one of --jobs and --ray: on Ray, each core of the cluster has a cell")
    if len(ray) > 1:
        raise paxisim.InvalidValueError(f"expected one address after --ray, got {' '.join(ray)}")
    runner = OnRay(*ray)
    print(f"Ray cluster with {runner.at_once} cores", flush=True)
    return runner


def _run(cells: list[Cell], runner: Here | OnRay, runs: Path, out: Path) -> list[Done]:
    """Work on cells, print the progress and return those that failed."""
    failed: list[Done] = []
    number, done, steps = len(cells), 0, sum(cell.steps for cell in cells)
    trained, seconds = 0, 0.0  # of the cells that did not fail, for the estimate
    for one in runner.run(cells, runs, out):
        number, done = number - 1, done + one.cell.steps
        if one.wrong is None:
            trained, seconds = trained + one.cell.steps, seconds + one.seconds
        else:
            failed.append(one)
        hours = seconds / max(trained, 1) * (steps - done) / max(1, min(runner.at_once, number)) / 3600
        remaining = f"{hours:.1f} h left" if trained or not number else "time left unknown"
        say(f"{one.cell}: {one.wrong or 'finished'}; {done} of {steps} steps, {remaining}")
    return failed


if __name__ == "__main__":
    sys.exit(command(matrix))
