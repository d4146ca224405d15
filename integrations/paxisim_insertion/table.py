"""``python -m paxisim_insertion.table``: the paper's Table II and ablation beside our results."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from .rates import (
    SIGNIFICANT,
    Rate,
    Table,
    by_kind,
    differences,
    each_seed,
    in_order,
    read_results,
    surrogate_tables,
    tables,
    with_cost,
)
from .results import IN_SIMULATION, TRANSFER, Result
from .shell import command
from .tasks import TASKS


def table(results: Path | None = None) -> None:
    """Print the tables: the paper's success rate, a slash, and ours over all seeds with its 95 % Wilson interval.

    The interval covers chance in the episodes of the evaluation, not in training: see the tables of each seed.

    Args:
        results: Folder of the results. Default: the results that come with the package and those in ./results, which
            take precedence for the same task, method, sensor and seed.
    """
    found = read_results(results)
    for one in tables(found):
        _print(one)
    _print_seeds("Simulation, each seed", each_seed(found, IN_SIMULATION))
    _print_seeds("Transfer, each seed", each_seed(found, TRANSFER))
    _print_kinds(by_kind(found))
    for one in surrogate_tables(found):
        _print(one)
    print(f"\nWhere ours differs from the paper's (Fisher's exact test, p < {SIGNIFICANT:g})\n")
    for one in differences(found):
        print(f"- {one.sensor}, {one.task} {one.method}: {_both(one.rate)}, p = {one.p:.2g}")
    _print_cost(found)


def minutes_of(found: list[Result]) -> dict[str, dict[str, float]]:
    """Return the CPU minutes of a training, averaged over seeds, by method and task."""
    trained = with_cost(found)
    minutes: dict[str, dict[str, float]] = {}
    for method in in_order(result.method for result in trained):
        for task in TASKS:
            seconds = [r.training["cpu_seconds"] for r in trained if (r.task, r.method) == (task, method)]
            if seconds:
                minutes.setdefault(method, {})[task] = float(np.mean(seconds)) / 60
    return minutes


def _print(one: Table) -> None:
    print(f"\n{one.title}\n\n| method | {' | '.join(TASKS)} | mean |\n|{'---|' * (2 + len(TASKS))}")
    for method, rates in one.rows.items():
        means = one.means(method)
        mean = " / ".join(map(_number, means)) if any(value is not None for value in means) else ""
        print(f"| {method} | {' | '.join(map(_both, rates))} | {mean} |")


def _print_seeds(title: str, rows: dict[str, list[list[float]]]) -> None:
    if not rows:
        return
    print(f"\n{title}\n\n| method | {' | '.join(TASKS)} | mean |\n|{'---|' * (2 + len(TASKS))}")
    for method, row in rows.items():
        print(f"| {method} | {' | '.join(', '.join(map(_number, rates)) for rates in row)} |")


def _print_kinds(rates: dict[str, dict[str, Rate]]) -> None:
    if not rates:
        return
    kinds = next(iter(rates.values()))
    print("\nTransfer, all tasks of a method, by kind of sensor\n")
    print(f"| method | {' | '.join(kinds)} |\n|{'---|' * (1 + len(kinds))}")
    for method, row in rates.items():
        print(f"| {method} | {' | '.join(map(_ours, row.values()))} |")


def _print_cost(found: list[Result]) -> None:
    print(f"\nCPU minutes of a training\n\n| method | {' | '.join(TASKS)} |\n|{'---|' * (1 + len(TASKS))}")
    for method, minutes in minutes_of(found).items():
        print(f"| {method} | {' | '.join(f'{minutes[task]:.0f}' if task in minutes else '' for task in TASKS)} |")


def _both(rate: Rate) -> str:
    if rate.paper is None and not rate.trials:
        return ""
    return f"{_number(rate.paper)} / {_ours(rate)}"


def _ours(rate: Rate) -> str:
    if not rate.trials:
        return "-"
    low, high = rate.interval
    return f"{rate.successes / rate.trials:.2f} ({low:.2f} to {high:.2f})"


def _number(rate: float | None) -> str:
    return "-" if rate is None else f"{rate:.2f}"


if __name__ == "__main__":
    sys.exit(command(table))
