"""Report: the tables and the learning curves of a matrix as one HTML file that needs no other file."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

from paxisim_insertion.results import write_whole
from paxisim_insertion.tasks import TASKS

import paxisim

from .cells import Cell
from .curves import draw_svg, method_colours, read_curves
from .rates import (
    PAPER_TRIALS,
    SIGNIFICANT,
    by_kind,
    comparable,
    differences,
    minutes_of,
    results_in,
    seed_tables,
    surrogate_tables,
    tables,
    with_cost,
)
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
    template = files("paxisim_lab").joinpath("report.html.j2").read_text(encoding="utf-8")
    text = environment.from_string(template).render(_context(cells, failed, runs, out))
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, text)
    return path


def _context(cells: list[Cell], failed: list[Done], runs: Path, out: Path) -> dict[str, Any]:
    found, left_out = comparable(results_in(out))
    used = dict.fromkeys([result.method for result in found] + [cell.method for cell in cells])
    colours = method_colours(used)
    curves = read_curves((cell.task, cell.method, runs / cell.folder) for cell in cells)
    made = (*tables(found), *surrogate_tables(found))
    return {
        "version": paxisim.__version__,
        "tasks": list(TASKS),
        "cells": len(cells),
        "finished": sum(cell.is_finished(out) for cell in cells),
        "failed": failed,
        "seeds": len({cell.seed for cell in cells}),
        "methods": len({cell.method for cell in cells}),
        "episodes": sum(result.trials for result in found),
        "tables": [one for one in made if any(rate.trials for rates in one.rows.values() for rate in rates)],
        "seed_tables": seed_tables(found),
        "by_kind": by_kind(found),
        "differences": differences(found),
        "left_out": left_out,
        "significant": SIGNIFICANT,
        "paper_trials": PAPER_TRIALS,
        "minutes": minutes_of(found),
        "hours": sum(result.training["cpu_seconds"] for result in with_cost(found)) / 3600,
        "curves": {task: draw_svg(by_method, colours) for task, by_method in curves.items()},
        "colours": colours,
    }
