"""A fixture that times several functions alternately, and the table of ratios at the end of the run."""

import platform
import time
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
import pytest

ROWS = pytest.StashKey[list]()


@dataclass
class Row:
    """A row of the table; `target` is the upper bound for `value`, if any."""

    what: str
    value: float
    target: float | None = None
    unit: str = ""

    def __str__(self) -> str:
        """Return the row as text."""
        value = f"{self.value:.3g}{self.unit}"
        if self.target is None:
            return f"{self.what:<70} {value:>9}"
        met = "met" if self.value <= self.target else "NOT MET"
        return f"{self.what:<70} {value:>9}   target {self.target:g}{self.unit}: {met}"


@dataclass
class Comparison:
    """Times functions alternately, so that a busy machine slows all of them equally."""

    benchmark: object
    rows: list[Row]

    def time(self, main: Callable, others: dict[str, Callable], rounds: int) -> dict[str, np.ndarray]:
        """Return the seconds of each round by name.

        Args:
            main: Function that pytest-benchmark reports; its times are under "main".
            others: Functions by name, which run before `main` in every round.
            rounds: Number of rounds.
        """
        seconds = {name: [] for name in others}

        def run_others():
            for name, other in others.items():
                start = time.perf_counter()
                other()
                seconds[name].append(time.perf_counter() - start)

        self.benchmark.pedantic(main, setup=run_others, rounds=rounds, warmup_rounds=2)
        if self.benchmark.stats is None:
            pytest.skip("pytest-benchmark is disabled, e.g. by xdist: run with -n0")
        seconds["main"] = self.benchmark.stats.stats.data
        return {name: np.array(values[-rounds:]) for name, values in seconds.items()}

    def report(self, what: str, value: float, target: float | None = None, unit: str = "") -> None:
        """Add a row to the table. A missed target is shown but raises no error, since timings depend on the machine."""
        self.rows.append(Row(what, float(value), target, unit))
        self.benchmark.extra_info[what] = float(value)


def pytest_configure(config):
    config.stash[ROWS] = []


@pytest.fixture
def compare(benchmark, request):
    return Comparison(benchmark, request.config.stash[ROWS])


def pytest_terminal_summary(terminalreporter, config):
    rows = config.stash[ROWS]
    if rows:
        terminalreporter.section("ratios")
        for row in rows:
            terminalreporter.write_line(str(row))
        terminalreporter.write_line(
            f"MuJoCo {mujoco.__version__}, numpy {np.__version__}, Python {platform.python_version()}, "
            f"{platform.machine()}"
        )
