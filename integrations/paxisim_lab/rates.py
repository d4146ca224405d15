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
    SURROGATE,
    TRANSFER,
    Result,
    file_of,
    interval_of,
    plain,
)
from paxisim_insertion.tasks import PARAMETERS, TASKS
from scipy.stats import fisher_exact

import paxisim

RESULTS = Path(__file__).with_name("results")
"""Folder of the results that come with the package."""

TABLE_2_SIM = {
    "NT": (0.94, 0.82, 0.6, 0.56, 0.42, 0.2),
    "TF": (1.0, 0.98, 0.8, 0.0, 1.0, 0.74),
    "TB": (1.0, 0.82, 0.62, 0.36, 0.84, 0.1),
    "TD": (1.0, 0.86, 0.9, 0.88, 0.88, 0.80),
    "DT": (1.0, 0.96, 0.84, 0.94, 0.96, 0.84),
    "GCS": (1.0, 0.9, 0.84, 0.98, 0.98, 0.76),
}
"""The paper's success rates in simulation, in the order of the tasks."""

TABLE_2_REAL = {
    "NT": (0.4, 0.4, 0.0, 0.1, 0.0, 0.0),
    "TF": (0.4, 0.3, 0.3, 0.0, 0.4, 0.1),
    "TB": (0.5, 0.3, 0.4, 0.1, 0.5, 0.2),
    "TD": (0.1, 0.4, 0.0, 0.2, 0.2, 0.2),
    "DT": (0.6, 0.2, 0.1, 0.3, 0.4, 0.1),
    "GCS": (0.9, 0.8, 0.9, 0.6, 0.9, 0.7),
}
"""The paper's success rates on the real robot. Ours use surrogates and are only comparable with each other."""

ABLATION_REAL = {
    "GCS": (None, None, 0.9, None, 0.9, 0.7),
    "GCS w/o G": (None, None, 0.9, None, 0.4, 0.0),
    "GCS w/o S": (None, None, 0.8, None, 0.3, 0.6),
    "GCS w/o C": (None, None, 0.6, None, 0.3, 0.2),
}
"""The paper's ablation on the real robot."""

REAL = {**ABLATION_REAL, **TABLE_2_REAL}
"""The paper's success rates on the real robot, of all methods."""

UNKNOWN = (None,) * len(TASKS)
"""Success rates of a method that the paper does not have."""

PAPER_TRIALS = {IN_SIMULATION: 50, TRANSFER: 10}
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
    """Return the settings and versions that made a result; a parameter that is not stated has its default."""
    settings = {n: value for n, value in result.training.items() if n not in ("updates", "cpu_seconds", "parameters")}
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
    """Return the tables of the paper: simulation, transfer and ablation."""
    more = {r.method: UNKNOWN for r in found if r.method not in REAL}
    ablated = {method: UNKNOWN for method in ABLATION_REAL if method not in TABLE_2_SIM}
    made = [_table("Simulation (paper / ours)", {**TABLE_2_SIM, **ablated, **more}, found, IN_SIMULATION)]
    if any(result.sensor == DRAWN for result in found):
        made.append(_table("Simulation, actions drawn (paper / ours)", {"NT": TABLE_2_SIM["NT"]}, found, DRAWN))
    made.append(_table("Paper's real robot / our transfer to surrogates", {**TABLE_2_REAL, **more}, found, TRANSFER))
    made.append(_table("Ablation: paper's real robot / our transfer", ABLATION_REAL, found, TRANSFER))
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
    """Return by title the tables of `each_seed` that have rows: simulation and transfer."""
    sensors = {"Simulation, each seed": IN_SIMULATION, "Transfer, each seed": TRANSFER}
    return {title: rows for title, sensor in sensors.items() if (rows := each_seed(found, sensor))}


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
    these = [result for result in found if result.sensor == TRANSFER]
    kinds = list(dict.fromkeys(kind for result in these for kind in result.parts))
    if not kinds:
        return {}
    by_method: dict[str, dict[str, Rate]] = {}
    for method in in_order(result.method for result in these):
        counts = np.array([[r.parts.get(kind, (0, 0)) for kind in kinds] for r in these if r.method == method])
        totals = counts.sum(axis=0).tolist()
        by_method[method] = {kind: Rate(None, *total) for kind, total in zip(kinds, totals, strict=True)}
    return by_method


def differences(found: list[Result]) -> list[Difference]:
    """Return where our rates differ from the paper's by Fisher's exact test, with p below `SIGNIFICANT`."""
    differ: list[Difference] = []
    papers = ((IN_SIMULATION, TABLE_2_SIM), (TRANSFER, REAL))
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
