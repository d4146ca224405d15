"""``python -m paxisim_lab.table``: the paper's Table II and ablation beside our results."""

from __future__ import annotations

import sys
from collections.abc import Collection
from pathlib import Path

from paxisim_insertion.results import Result
from paxisim_insertion.shell import command
from paxisim_insertion.tasks import TASKS

from .rates import (
    SIGNIFICANT,
    Rate,
    Table,
    agreement,
    by_kind,
    comparable,
    differences,
    forces,
    minutes_of,
    read_results,
    seed_tables,
    surrogate_tables,
    tables,
)


def table(results: Path | None = None) -> None:
    """Print the tables: the paper's success rate, a slash, and ours over all seeds with its 95 % Wilson interval.

    The interval covers chance in the episodes of the evaluation, not in training: see the tables of each seed.

    Args:
        results: Folder of the results. Default: the results that come with the package and those in ./results, which
            take precedence for the same task, method, sensor, seed and settings. A rate pools only trainings of the
            same steps, settings and software versions; the others are listed.
    """
    print_tables(read_results(results))


def print_tables(results: list[Result]) -> None:
    """Print the tables of results, see `table`, and name those that are not comparable."""
    found, left_out = comparable(results)
    for one in tables(found):
        _print(one)
    for title, rows in seed_tables(found).items():
        _print_seeds(title, rows)
    _print_kinds(by_kind(found))
    for one in surrogate_tables(found):
        _print(one)
    print(f"\nWhere ours differs from the paper's (Fisher's exact test, p < {SIGNIFICANT:g})\n")
    for one in differences(found):
        print(f"- {one.sensor}, {one.task} {one.method}: {_both(one.rate)}, p = {one.p:.2g}")
    _print_agreement(found)
    _print_forces(found)
    _print_cost(found)
    if left_out:
        print("\nLeft out, because a rate pools only one setting\n")
    for line in left_out:
        print(f"- {line}")


def _print_head(title: str, columns: Collection[str]) -> None:
    print(f"\n{title}\n\n| method | {' | '.join(columns)} |\n|{'---|' * (1 + len(columns))}")


def _print(one: Table) -> None:
    _print_head(one.title, [*TASKS, "mean"])
    for method, rates in one.rows.items():
        means = one.means(method)
        mean = " / ".join(map(_number, means)) if any(value is not None for value in means) else ""
        print(f"| {method} | {' | '.join(map(_both, rates))} | {mean} |")


def _print_seeds(title: str, rows: dict[str, list[list[float]]]) -> None:
    _print_head(title, [*TASKS, "mean"])
    for method, row in rows.items():
        print(f"| {method} | {' | '.join(', '.join(map(_number, rates)) for rates in row)} |")


def _print_kinds(rates: dict[str, dict[str, Rate]]) -> None:
    if not rates:
        return
    _print_head("Transfer, all tasks of a method, by kind of sensor", next(iter(rates.values())))
    for method, row in rates.items():
        print(f"| {method} | {' | '.join(map(_ours, row.values()))} |")


def _print_agreement(found: list[Result]) -> None:
    correlations = agreement(found)
    if correlations:
        print("\nRank correlation (Spearman) of our rates with the paper's on the real robot\n")
    for words, (value, cells) in correlations.items():
        print(f"- {words}: {value:.2f} over {cells} cells")


def _print_forces(found: list[Result]) -> None:
    for sensor, rows in forces(found).items():
        _print_head(f"Force between peg and base, {sensor} (N): mean while they touch / mean of the largest", TASKS)
        for method, row in rows.items():
            print(f"| {method} | {' | '.join(f'{one[0]:.1f} / {one[1]:.0f}' if one else '' for one in row)} |")


def _print_cost(found: list[Result]) -> None:
    _print_head("CPU minutes of a training", TASKS)
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
