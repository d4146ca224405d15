"""Rates: the paper's success rates beside ours, as tables that `paxisim_lab.table` and a report show."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from paxisim_insertion.results import (
    DRAWN,
    IN_SIMULATION,
    OUT,
    PADS,
    SURROGATE,
    SURROGATES,
    Result,
    file_of,
    interval_of,
    plain,
)
from paxisim_insertion.tasks import PARAMETERS, TASKS
from scipy.stats import fisher_exact, spearmanr

import paxisim

from .paper import ABLATION_REAL, REAL, TABLE_2_REAL, TABLE_2_SIM, UNKNOWN

RESULTS = Path(__file__).with_name("results")
"""Folder of the results that come with the package."""

TRANSFERS = {PADS: "magnetic pads", SURROGATES: "surrogates"}
"""The stand-ins for a real robot, in words."""

PAPER_TRIALS = {IN_SIMULATION: 50, **dict.fromkeys(TRANSFERS, 10)}
"""Episodes per success rate in the paper."""

SIGNIFICANT = 0.05
"""Significance level of Fisher's exact test, below which rates are listed as different."""


@dataclass(frozen=True)
class Rate:
    """A success rate of the paper and ours.

    Attributes:
        paper: The paper's rate, or None.
        successes: Our successes, over all seeds.
        trials: Our episodes, over all seeds; 0 if there are none.
    """

    paper: float | None
    successes: int
    trials: int

    @property
    def ours(self) -> float | None:
        """Our rate, or None."""
        return self.successes / self.trials if self.trials else None

    @property
    def interval(self) -> tuple[float, float]:
        """95 % Wilson interval of our rate; there must be trials."""
        return interval_of(self.successes, self.trials)


@dataclass(frozen=True)
class Table:
    """Success rates by method and task.

    Attributes:
        title: What the paper's and our rates are.
        rows: The rates of each method, in the order of the tasks.
    """

    title: str
    rows: dict[str, list[Rate]]

    def means(self, method: str) -> tuple[float | None, float | None]:
        """Return the paper's and our mean over the tasks, or None unless every task has a rate."""
        rates = self.rows[method]
        return _mean([rate.paper for rate in rates]), _mean([rate.ours for rate in rates])


@dataclass(frozen=True)
class Difference:
    """A task and method where our rate differs from the paper's.

    Attributes:
        sensor: Sensor of our evaluations.
        task: Name of the task.
        method: Name of the method.
        rate: Both rates.
        p: p-value of Fisher's exact test.
    """

    sensor: str
    task: str
    method: str
    rate: Rate
    p: float


def read_results(folder: Path | None) -> list[Result]:
    """Read the results of a folder, or those of the package and of ./results, see `table`; see also `comparable`.

    Raises:
        InvalidValueError: There are no results, or a file is not a result.
    """
    folders = (RESULTS, OUT) if folder is None else (folder,)
    found = results_in(*folders)
    if not found:
        raise paxisim.InvalidValueError(
            f"{' or '.join(map(str, folders))} has no results: train and evaluate a cell first, with .matrix or .train "
            "and .evaluate"
        )
    return found


def results_in(*folders: Path) -> list[Result]:
    """Read the results of folders, one after the other."""
    return [Result.load(path) for folder in folders for path in sorted(folder.glob("*.json"))]


def comparable(found: list[Result]) -> tuple[list[Result], list[str]]:
    """Return results of which each task, method and sensor has one setting, and a line about each one left out.

    A rate pools only trainings of the same steps, settings and software. Of several kinds, that with the most seeds is
    kept, then that with the most steps, then the last. Of several results of one seed the last is kept.
    """
    kinds: dict[tuple[str, str, str], dict[str, dict[int, Result]]] = {}
    for one in found:
        kind = json.dumps(_made(one), sort_keys=True)
        kinds.setdefault((one.task, one.method, one.sensor), {}).setdefault(kind, {})[one.seed] = one
    kept, lines = [], []
    for (task, method, sensor), own in kinds.items():
        *others, best = sorted(own.values(), key=lambda k: (len(k), next(iter(k.values())).training.get("steps", 0)))
        kept += best.values()
        usual = _made(next(iter(best.values())))
        for one in (one for other in others for one in other.values()):
            differ = [f"{n} {v}" for n, v in _made(one).items() if usual.get(n) != v]
            lines.append(
                f"{task} {method}, {sensor}, seed {one.seed}: {', '.join(differ) or 'fewer settings are known'}"
            )
    return sorted(kept, key=lambda r: file_of(r.task, r.method, r.sensor, r.seed)), lines


def _made(result: Result) -> dict[str, Any]:
    """Return the settings and versions that made a result; what is not stated has its default."""
    outcomes = ("updates", "cpu_seconds", "success", "parameters", *(("steps",) if result.has_ended else ()))
    settings = {"until": None, "actor_every": 1, **result.training}
    settings = {name: value for name, value in settings.items() if name not in outcomes}
    stated = {**asdict(PARAMETERS), **result.training.get("parameters", {})}
    stated = {name: json.loads(json.dumps(value)) for name, value in stated.items()}  # tuples as lists
    return {**settings, **stated, **{name: plain(version) for name, version in result.versions.items()}}


def with_cost(found: list[Result]) -> list[Result]:
    """Return the results that have the CPU seconds of their training, one for each training."""
    return [result for result in found if result.sensor == IN_SIMULATION and result.training.get("cpu_seconds")]


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


def in_order(methods: Iterable[str]) -> list[str]:
    """Return each method once: those of the paper in its order, then the others."""
    own = dict.fromkeys(methods)
    return [method for method in dict.fromkeys([*TABLE_2_SIM, *ABLATION_REAL, *own]) if method in own]


def pooled(found: list[Result], task: str, method: str, sensor: str) -> tuple[int, int]:
    """Return the successes and episodes of all seeds together."""
    these = [r for r in found if (r.task, r.method, r.sensor) == (task, method, sensor)]
    return sum(round(r.success_rate * r.trials) for r in these), sum(r.trials for r in these)


def tables(found: list[Result]) -> list[Table]:
    """Return the tables of the paper: simulation, and for each stand-in with results, transfer and ablation."""
    more = {r.method: UNKNOWN for r in found if r.method not in REAL}
    ablated = {method: UNKNOWN for method in ABLATION_REAL if method not in TABLE_2_SIM}
    made = [_table("Simulation (paper / ours)", {**TABLE_2_SIM, **ablated, **more}, found, IN_SIMULATION)]
    if any(result.sensor == DRAWN for result in found):
        made.append(_table("Simulation, actions drawn (paper / ours)", {"NT": TABLE_2_SIM["NT"]}, found, DRAWN))
    for sensor, words in TRANSFERS.items():
        if any(result.sensor == sensor for result in found):
            made.append(_table(f"Paper's real robot / our {words}", {**TABLE_2_REAL, **more}, found, sensor))
            made.append(_table(f"Ablation: paper's real robot / our {words}", ABLATION_REAL, found, sensor))
    return made


def each_seed(found: list[Result], sensor: str) -> dict[str, list[list[float]]]:
    """Return the success rates of single seeds, for the methods that have several seeds of a task.

    Returns:
        By method, the rates of each task in the order of the seeds, and at the end their means over the tasks, of the
        seeds that every task has.
    """
    rows: dict[str, list[list[float]]] = {}
    for method in in_order(result.method for result in found):
        these = [result for result in found if (result.method, result.sensor) == (method, sensor)]
        by_task = [{r.seed: r.success_rate for r in these if r.task == task} for task in TASKS]
        if any(len(rates) > 1 for rates in by_task):
            means = {seed: _mean([rates.get(seed) for rates in by_task]) for seed in {r.seed for r in these}}
            by_task.append({seed: mean for seed, mean in means.items() if mean is not None})
            rows[method] = [[rates[seed] for seed in sorted(rates)] for rates in by_task]
    return rows


def seed_tables(found: list[Result]) -> dict[str, dict[str, list[list[float]]]]:
    """Return by title the tables of `each_seed` that have rows."""
    sensors = {IN_SIMULATION: "Simulation", **{s: f"Transfer to {words}" for s, words in TRANSFERS.items()}}
    return {f"{title}, each seed": rows for s, title in sensors.items() if (rows := each_seed(found, s))}


def surrogate_tables(found: list[Result]) -> list[Table]:
    """Return a table for each surrogate of a sensor that methods were evaluated with."""
    made: list[Table] = []
    for sensor in sorted({result.sensor for result in found if result.sensor.startswith(SURROGATE)}):
        tried = in_order(result.method for result in found if result.sensor == sensor)
        paper = {method: REAL.get(method, UNKNOWN) for method in tried}
        made.append(_table(f"Paper's real robot / our {sensor}", paper, found, sensor))
    return made


def by_kind(found: list[Result]) -> dict[str, dict[str, Rate]]:
    """Return the transfer results by method and kind of sensor, with all tasks of a method together."""
    these = [result for result in found if result.sensor in TRANSFERS]
    kinds = {f"{TRANSFERS[r.sensor]}, {kind}": (r.sensor, kind) for r in these for kind in r.parts}
    if not kinds:
        return {}
    by_method: dict[str, dict[str, Rate]] = {}
    for method in in_order(result.method for result in these):
        for words, (sensor, kind) in kinds.items():
            counts = [r.parts.get(kind, (0, 0)) for r in these if (r.method, r.sensor) == (method, sensor)]
            total = np.sum([(0, 0), *counts], axis=0).tolist()
            by_method.setdefault(method, {})[words] = Rate(None, *total)
    return by_method


def agreement(found: list[Result]) -> dict[str, tuple[float, int]]:
    """Return by stand-in the rank correlation (Spearman) of our rates with the paper's on the real robot.

    Returns:
        For each stand-in in words, the correlation over the cells that both have, and their number.
    """
    correlations = {}
    for sensor, words in TRANSFERS.items():
        theirs, ours = [], []
        for method, rates in REAL.items():
            for task, rate in zip(TASKS, rates, strict=True):
                good, trials = pooled(found, task, method, sensor)
                if rate is not None and trials:
                    theirs.append(rate)
                    ours.append(good / trials)
        if len(set(ours)) > 1:  # equal rates have no order
            test: Any = spearmanr(theirs, ours)
            correlations[words] = float(test[0]), len(ours)
    return correlations


def forces(found: list[Result]) -> dict[str, dict[str, list[tuple[float, float] | None]]]:
    """Return mean and peak contact force (N), by sensor and method, for each task; None where it is unknown."""
    tables: dict[str, dict[str, list[tuple[float, float] | None]]] = {}
    for sensor in (IN_SIMULATION, *TRANSFERS):
        for method in in_order(r.method for r in found):
            row: list[tuple[float, float] | None] = []
            for task in TASKS:
                own = [
                    (r.mean_force, r.peak_force)
                    for r in found
                    if (r.task, r.method, r.sensor) == (task, method, sensor) and r.mean_force is not None
                ]
                row.append(tuple(np.mean(own, axis=0).tolist()) if own else None)  # type: ignore[arg-type]
            if any(row):
                tables.setdefault(sensor, {})[method] = row
    return tables


def differences(found: list[Result]) -> list[Difference]:
    """Return where our rates differ from the paper's by Fisher's exact test, with p below `SIGNIFICANT`."""
    differ: list[Difference] = []
    papers = ((IN_SIMULATION, TABLE_2_SIM), *((sensor, REAL) for sensor in TRANSFERS))
    for sensor, paper in papers:
        for method, rates in paper.items():
            for task, theirs in zip(TASKS, rates, strict=True):
                rate = Rate(theirs, *pooled(found, task, method, sensor))
                if rate.paper is None or not rate.trials:
                    continue
                count = PAPER_TRIALS[sensor]
                good = round(rate.paper * count)
                ours = [rate.successes, rate.trials - rate.successes]
                test: Any = fisher_exact([ours, [good, count - good]])
                if float(test[1]) < SIGNIFICANT:
                    differ.append(Difference(sensor, task, method, rate, float(test[1])))
    return differ


def _table(title: str, paper: Mapping[str, tuple[float | None, ...]], found: list[Result], sensor: str) -> Table:
    rows = {
        method: [Rate(theirs, *pooled(found, task, method, sensor)) for task, theirs in zip(TASKS, rates, strict=True)]
        for method, rates in paper.items()
    }
    return Table(title, {m: r for m, r in rows.items() if any(x.trials or x.paper is not None for x in r)})


def _mean(rates: list[float | None]) -> float | None:
    values = [rate for rate in rates if rate is not None]
    return float(np.mean(values)) if len(values) == len(rates) else None
