"""Cells: what a matrix trains and evaluates, read from a TOML file."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from paxisim_insertion.methods import find_method
from paxisim_insertion.results import (
    DRAWN,
    IN_SIMULATION,
    PADS,
    SURROGATES,
    Result,
    differing,
    file_of,
    folder_of,
    sensor_name,
)
from paxisim_insertion.tasks import find_task

import paxisim

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]

SENSORS = (IN_SIMULATION, PADS, SURROGATES)
"""Default sensors of a cell's evaluations."""

TRIALS = 50
"""Default number of episodes of an evaluation."""

_OPTIONS = {
    IN_SIMULATION: [],
    PADS: ["--transfer", "pads"],
    SURROGATES: ["--transfer", "surrogates"],
    DRAWN: ["--drawn"],
}


@dataclass(frozen=True)
class Cell:
    """One training run and its evaluations.

    Attributes:
        task: Name of the task.
        method: Name of the method.
        seed: Random seed of the training.
        steps: Environment steps of the training.
        sensors: Sensors of the evaluations: ``"sim"``, ``"transfer pads"``, ``"transfer surrogates"``, or what
            ``.evaluate --sensor`` takes.
        trials: Episodes of each evaluation.
    """

    task: str
    method: str
    seed: int
    steps: int
    sensors: tuple[str, ...] = SENSORS
    trials: int = TRIALS

    @property
    def evaluations(self) -> dict[str, list[str]]:
        """Evaluations of this cell, by the sensor's name in the results, with their command-line options.

        A method without touch is also evaluated with drawn actions, because its most likely action may never change.
        """
        blind = IN_SIMULATION in self.sensors and find_method(self.method).encoding == "NT"
        sensors = (*self.sensors, DRAWN) if blind else self.sensors
        known = {name: _OPTIONS[name] for name in sensors if name in _OPTIONS}
        return known | {sensor_name(name): ["--sensor", name] for name in sensors if name not in _OPTIONS}

    @property
    def folder(self) -> str:
        """Name of the folder of the training run."""
        return folder_of(self.task, self.method, self.seed)

    def has(self, sensor: str, out: Path) -> bool:
        """Return whether the complete training was evaluated with this sensor, by the software of this machine."""
        path = out / file_of(self.task, self.method, sensor, self.seed)
        if not path.exists():
            return False
        found = Result.load(path)
        is_complete = found.has_ended or found.training["steps"] >= self.steps
        return is_complete and found.trials >= self.trials and not differing(found.versions)

    def is_finished(self, out: Path) -> bool:
        """Return whether all results of the cell exist."""
        return all(self.has(sensor, out) for sensor in self.evaluations)

    def commands(self, runs: Path, out: Path) -> Iterator[list[str]]:
        """Yield the remaining commands; each continues where it stopped."""
        folder = runs / self.folder
        train = ["train", "--out", str(folder), "--steps", str(self.steps)]
        if (folder / "run.json").exists():
            yield [*train, "--resume"]
        else:
            yield [*train, "--task", self.task, "--method", self.method, "--seed", str(self.seed)]
        for sensor, options in self.evaluations.items():
            if not self.has(sensor, out):
                yield ["evaluate", "--run", str(folder), "--out", str(out), "--trials", str(self.trials), *options]

    def __str__(self) -> str:
        """Return the name of the cell in messages."""
        return f"{self.task} {self.method} seed {self.seed}"


def read_cells(file: Path) -> list[Cell]:
    """Read the cells of a TOML file, in its order.

    ``steps`` is a table of training steps by task; ``trials``, the episodes of each evaluation, is optional. Each
    ``[[cells]]`` has the lists ``tasks``, ``methods`` and ``seeds``, and optionally ``sensors``; every combination is a
    cell, with tasks varying fastest. A cell that is named twice is evaluated with the sensors of both.

    Raises:
        InvalidValueError: The file is not a matrix.
        UnknownNameError: There is no such task or method.
    """
    try:
        found = tomllib.loads(file.read_text(encoding="utf-8"))
        unknown = set(found) - {"steps", "trials", "cells"}
        if unknown:
            raise ValueError(f"unknown key {sorted(unknown)[0]!r}")
        steps = {find_task(task).name: _whole(number, 1) for task, number in found["steps"].items()}
        trials = _whole(found.get("trials", TRIALS), 1)
        cells = [cell for group in found["cells"] for cell in _combined(steps, trials, **group)]
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise paxisim.InvalidValueError(
            f"{file} is not a matrix: expected [steps] and [[cells]] with tasks, methods and seeds: {error!r}"
        ) from error
    once: dict[str, Cell] = {}
    for cell in cells:
        before = once.get(cell.folder, cell)  # two trainings in one folder would spoil each other
        once[cell.folder] = cell = replace(before, sensors=tuple(dict.fromkeys((*before.sensors, *cell.sensors))))
        names: dict[str, str] = {}
        for sensor in cell.sensors:
            if names.setdefault(sensor_name(sensor), sensor) != sensor:
                raise paxisim.InvalidValueError(
                    f"{file}: {names[sensor_name(sensor)]} and {sensor} would have one name in the results, "
                    f"{sensor_name(sensor)!r}: rename one of the files"
                )
    return list(once.values())


def _combined(
    steps: dict[str, int],
    trials: int,
    *,
    tasks: list[str],
    methods: list[str],
    seeds: list[int],
    sensors: list[str] | tuple[str, ...] = SENSORS,
) -> Iterator[Cell]:
    known = tuple(map(_sensor, sensors))
    for seed in seeds:
        for method in methods:
            for task in tasks:
                name, length = find_task(task).name, steps[task]
                yield Cell(name, find_method(method).name, _whole(seed, 0), length, known, trials)


def _sensor(name: Any) -> str:
    """Check the name of a sensor; that of a file becomes absolute, because another machine may read it."""
    if not isinstance(name, str):
        raise ValueError(f"expected the name of a sensor, got {name!r}")
    if name in SENSORS:
        return name
    if name.startswith("reference:"):
        paxisim.reference_sensor(name.removeprefix("reference:"))
        return name
    paxisim.Chain.load(name)
    return str(Path(name).resolve())


def _whole(value: Any, least: int) -> int:
    if type(value) is not int or value < least:
        raise ValueError(f"expected an integer of at least {least}, got {value!r}")
    return value
