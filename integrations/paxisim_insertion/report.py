"""Report: the tables and the learning curves of a matrix as one HTML file that needs no other file."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

import paxisim

from .cells import Cell
from .curve_figure import curve_svgs, method_colours
from .rates import (
    PAPER_TRIALS,
    SIGNIFICANT,
    Rate,
    by_kind,
    comparable,
    differences,
    results_in,
    seed_tables,
    surrogate_tables,
    tables,
    with_cost,
)
from .table import minutes_of
from .tasks import TASKS
from .whole import write_whole
from .work import Done


def check_report(path: Path) -> None:
    """Check that a report can be made, before the hours that its results take.

    Raises:
        MissingExtraError: matplotlib or jinja2 is not installed.
        InvalidValueError: The path is a folder, or does not end in .html.
    """
    for module in ("matplotlib", "jinja2"):
        try:
            __import__(module)
        except ImportError as error:
            raise paxisim.MissingExtraError(module, "diagnose", "--report") from error
    if path.is_dir() or path.suffix.lower() not in (".html", ".htm"):
        raise paxisim.InvalidValueError(f"expected an HTML file such as report.html for the report, got {path}")


def write_report(path: Path, cells: list[Cell], failed: list[Done], runs: Path, out: Path) -> Path:
    """Write the report of a matrix, in place of an older one.

    Args:
        path: HTML file; its folder is created if missing.
        cells: The cells of the matrix, for the learning curves and the count.
        failed: Cells that failed.
        runs: Folder of the runs.
        out: Folder of the results.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)
    environment.filters["number"] = lambda value: "" if value is None else f"{value:.2f}"
    template = files("paxisim_insertion").joinpath("report.html.j2").read_text(encoding="utf-8")
    text = environment.from_string(template).render(_context(cells, failed, runs, out))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text)
    return path


def _context(cells: list[Cell], failed: list[Done], runs: Path, out: Path) -> dict[str, Any]:
    found, left_out = comparable(results_in(out))
    minutes = minutes_of(found)
    kinds = by_kind(found)
    used = dict.fromkeys([result.method for result in found] + [cell.method for cell in cells])
    colours = method_colours(used)
    return {
        "version": paxisim.__version__,
        "tasks": list(TASKS),
        "cells": len(cells),
        "finished": sum(cell.is_finished(out) for cell in cells),
        "failed": failed,
        "seeds": len({cell.seed for cell in cells}),
        "methods": len({cell.method for cell in cells}),
        "episodes": sum(result.trials for result in found),
        "tables": [
            {
                "title": one.title,
                "rows": [
                    {"method": method, "rates": [_shown(rate) for rate in rates], "means": one.means(method)}
                    for method, rates in one.rows.items()
                ],
            }
            for one in (*tables(found), *surrogate_tables(found))
            if any(rate.trials for rates in one.rows.values() for rate in rates)
        ],
        "seed_tables": seed_tables(found),
        "kinds": list(next(iter(kinds.values()), {})),
        "by_kind": {method: [_shown(rate) for rate in row.values()] for method, row in kinds.items()},
        "differences": differences(found),
        "left_out": left_out,
        "significant": SIGNIFICANT,
        "paper_trials": PAPER_TRIALS,
        "minutes": {method: [row.get(task) for task in TASKS] for method, row in minutes.items()},
        "hours": sum(result.training["cpu_seconds"] for result in with_cost(found)) / 3600,
        "curves": curve_svgs(cells, runs, colours),
        "colours": colours,
    }


def _shown(rate: Rate) -> dict[str, Any]:
    return {"paper": rate.paper, "ours": rate.ours, "interval": rate.interval if rate.trials else None}
