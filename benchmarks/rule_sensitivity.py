"""How much the rates depend on each constant that decides what is named.

    python benchmarks/rule_sensitivity.py --singles 38 --pairs 24 --nulls 12 --jobs 2

Each constant of `paxisim.diagnose.rules.Rules` is halved and doubled, a share up to the bounds that it has; so are all
causes' misfits and all their prices. Every time the same cases of `tests/hidden/practice` are diagnosed. A row says how
many singles and pairs are named exactly and how many nulls have a false name, with the 90 % Wilson interval of each
rate, and which rate has left the interval that it has with the constants as they are.

The black box, which names nothing, is left out. All rows with 74 cases take some ten hours of processor time; ``--only
material consistency`` makes a few of them, ``--list`` names them.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: one thread for each job
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from hidden_table.solve import made, recording
from hidden_table.tasks import Task, practice
from scipy.stats import binomtest

from paxisim.diagnose import vocabulary
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.run import diagnosis_of

KINDS = {"single": "exact singles", "pair": "exact pairs", "null": "false names in nulls"}
BASELINE = "as they are"
OF_CAUSES = ("misfit", "price")
SHARES = frozenset({"consistency", "explains", "lone", "near_miss", "promise", "tie"})
"""Rules that are shares: at 1 they would ask for all there is, or for more."""
MOST_SHARE = 0.99
LEAST = {"folds": 2, "few_episodes": 2, "contest": 1, "pairs": 0, "most": 1}
LEVEL = 0.9  # of the intervals


@dataclass(frozen=True)
class Change:
    """What is decided otherwise.

    Attributes:
        name: Of the row.
        rules: The rules.
        factors: By attribute of the causes, what it is multiplied by in all of them.
    """

    name: str
    rules: Rules = field(default_factory=Rules)
    factors: tuple[tuple[str, float], ...] = ()


@dataclass(frozen=True)
class Rate:
    """How often something was so among cases of a kind."""

    hits: int
    cases: int

    @property
    def value(self) -> float:
        """The share."""
        return self.hits / self.cases

    @property
    def interval(self) -> tuple[float, float]:
        """By Wilson."""
        found = binomtest(self.hits, self.cases).proportion_ci(LEVEL, method="wilson")
        return float(found.low), float(found.high)

    def shown(self) -> str:
        """As a cell of the table."""
        low, high = self.interval
        return f"{self.hits:3d}/{self.cases:<3d} {self.value:4.0%} ({low:3.0%} to {high:4.0%})"


def changes() -> list[Change]:
    """The rows: the constants as they are, and each halved and doubled."""
    rows = [Change(BASELINE)]
    for about in fields(Rules):
        value = getattr(Rules(), about.name)
        for factor in (0.5, 2.0):
            other = scaled(about.name, value, factor)
            if other != value:
                rows.append(Change(f"{about.name} {value:g} -> {other:g}", replace(Rules(), **{about.name: other})))
    for name in OF_CAUSES:
        rows += [Change(f"all causes' {name} x {factor:g}", factors=((name, factor),)) for factor in (0.5, 2.0)]
    return rows


def scaled(name: str, value: float, factor: float) -> float:
    """A rule times a factor, as far as it may go."""
    if isinstance(value, int):
        return max(round(value * factor), LEAST.get(name, 1))
    return min(value * factor, MOST_SHARE) if name in SHARES else value * factor


def named(change: Change, task: Task) -> tuple[str, ...]:
    """The causes that are named in a case."""
    known = vocabulary.CAUSES
    vocabulary.CAUSES = tuple(
        replace(item, **{name: factor * getattr(item, name) for name, factor in change.factors}) for item in known
    )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = diagnosis_of(recording(made(task)), None, 0, 1, lambda text: None, change.rules)
    finally:
        vocabulary.CAUSES = known
    return tuple(item.name for item in found.causes)


def without_black_box() -> None:
    """In each process: the black box takes most of the time and names nothing."""
    sys.modules.update({"sklearn": None, "sklearn.ensemble": None})  # type: ignore[dict-item]


def rates(tasks: Sequence[Task], answers: Sequence[tuple[str, ...]]) -> dict[str, Rate]:
    """By kind of case: exact ones of singles and pairs, those with a false name of nulls."""
    out = {}
    for kind in KINDS:
        own = [(t, a) for t, a in zip(tasks, answers, strict=True) if t.kind == kind]
        if own:
            hits = sum(bool(a) if kind == "null" else set(a) == set(t.true) for t, a in own)
            out[kind] = Rate(hits, len(own))
    return out


def left(now: Mapping[str, Rate], before: Mapping[str, Rate]) -> list[str]:
    """The rates that are not within the interval that they had."""
    return [KINDS[k] for k in now if not before[k].interval[0] <= now[k].value <= before[k].interval[1]]


def main() -> None:
    """Parse the arguments, diagnose and print a row for each constant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--singles", type=int, default=38, help="cases with one effect")
    parser.add_argument("--pairs", type=int, default=24, help="cases with two")
    parser.add_argument("--nulls", type=int, default=12, help="cases with none")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--only", nargs="+", metavar="WORD", help="rows whose names begin with one of these words")
    parser.add_argument("--list", action="store_true", help="print the names of the rows")
    arguments = parser.parse_args()
    rows = [row for row in changes() if row.name == BASELINE or row.name.startswith(tuple(arguments.only or ("",)))]
    if arguments.list:
        print("\n".join(row.name for row in rows))
        return
    counts = {"single": arguments.singles, "pair": arguments.pairs, "null": arguments.nulls}
    tasks = practice(counts, arguments.seed, "both")
    if not tasks:
        parser.error("nothing to do: give --singles, --pairs or --nulls")
    kinds = [kind for kind in KINDS if counts[kind]]
    width = max(len(row.name) for row in rows)
    print(" | ".join([f"{'constant':<{width}}", *(f"{KINDS[kind]:<24}" for kind in kinds), "leaves the interval"]))
    before: dict[str, Rate] = {}
    with ProcessPoolExecutor(arguments.jobs, initializer=without_black_box) as pool:
        work = {row.name: [pool.submit(named, row, task) for task in tasks] for row in rows}
        for row in rows:
            now = rates(tasks, [job.result() for job in work[row.name]])
            before = before or now
            print(
                " | ".join(
                    [f"{row.name:<{width}}", *(f"{now[k].shown():<24}" for k in kinds), ", ".join(left(now, before))]
                ),
                flush=True,
            )


if __name__ == "__main__":
    main()
