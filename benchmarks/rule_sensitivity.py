"""Sensitivity of the rates to each constant that decides which causes are named.

    python benchmarks/rule_sensitivity.py --singles 38 --pairs 24 --nulls 20 --jobs 2

Each constant of `paxisim.diagnose.rules.Rules` is halved and doubled, within its bounds if it is a share. The misfits
of all causes and the prices of all causes are varied likewise. The same cases of `tests/hidden` are diagnosed every
time, with pads of 4x3 taxels and eight episodes of 6 s at 20 Hz. A row shows how many singles and pairs are named
exactly and how many nulls have a false name, each with the 90 % Wilson interval of its rate. It also shows which rates
leave the interval that they have with the unchanged constants.

The rows of a case share their fits, except for rows whose constants decide what is held out. A row therefore shows how
the decision changes, but not where the fits of a different search would end. ``--only material consistency`` computes
only some rows.
"""

from __future__ import annotations

import argparse
import copy
import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial

from harness import here, wilson
from hidden_table.cases import Task, recording, tasks

from paxisim.diagnose.causes.detected import read_off
from paxisim.diagnose.data.prepare import prepare
from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.scorer.scorer import Scorer
from paxisim.diagnose.search import search
from paxisim.diagnose.stages import Ready, confirm, scorer_of, wanted_of

KINDS = {"single": "exact singles", "pair": "exact pairs", "null": "false names in nulls"}
BASELINE = "as they are"
OF_SCORER = ("folds", "few_episodes", "lone", "gap", "half", "in_sample", "single_starts", "gauge_step", "gauge_tie")
"""Rules for which the fits and rankings of another row are of no use."""
OF_CAUSES = ("misfit", "price")
SHARES = frozenset({"explains", "half", "in_sample", "lone", "near_miss", "promise", "tie"})
"""Rules that are shares; at 1 or more they would require the whole or more."""
MOST_SHARE = 0.99
LEAST = {"folds": 2, "few_episodes": 2, "contest": 1, "pairs": 0, "most": 1}
LEVEL = 0.9  # confidence level of the intervals
SMALL = {"rows": 4, "cols": 3, "duration": 6.0, "rate": 20}


@dataclass(frozen=True)
class Change:
    """A row of the table: a change of the constants.

    Attributes:
        name: Name of the row.
        rules: The rules with the change.
        factors: Pairs of a cause attribute and the factor that multiplies it in all causes.
    """

    name: str
    rules: Rules = field(default_factory=Rules)
    factors: tuple[tuple[str, float], ...] = ()


def changes() -> list[Change]:
    """Return the rows: the unchanged constants, and each constant halved and doubled."""
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
    """Return a rule times a factor, limited to its bounds."""
    if isinstance(value, int):
        return max(round(value * factor), LEAST.get(name, 1))
    return min(value * factor, MOST_SHARE) if name in SHARES else value * factor


def named(rows: Sequence[Change], task: Task) -> list[tuple[str, ...]]:
    """Return the causes named in a case, by row."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        recorded, _ = prepare(recording(task.made()))
        raw = problem_of(recorded)
        wanted, _ = wanted_of(raw, None, {})
        ready = Ready(recorded, (), (), tuple(wanted), {}, raw, read_off(raw, wanted))
        scorers: dict[tuple[float, ...], Scorer] = {}
        answers = []
        for row in rows:
            folds = tuple(getattr(row.rules, name) for name in OF_SCORER)
            if folds not in scorers:
                scorers[folds] = scorer_of(ready, 1, silently, row.rules)
            scorer = copy.copy(scorers[folds])  # keeps the fits of the previous rows
            causes = [
                replace(item, **{name: factor * getattr(item, name) for name, factor in row.factors})
                for item in scorers[folds].causes.values()
            ]
            scorer.rules, scorer.causes = row.rules, {item.name: item for item in causes}
            found = confirm(ready, scorer, search(scorer), 0, 1, silently).found
            answers.append(tuple(item.name for item in found.named))
    return answers


def silently(stage: str, share: float) -> None:
    """Ignore reports of progress."""


def cell(hits: int, cases: int) -> str:
    """Return a rate with its interval as a cell of the table."""
    low, high = wilson(hits, cases, LEVEL)
    return f"{hits:3d}/{cases:<3d} {hits / cases:4.0%} ({low:3.0%} to {high:4.0%})"


def main() -> None:
    """Parse the arguments, diagnose the cases, and print a row for each change of a constant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--singles", type=int, default=38, help="number of cases with one effect")
    parser.add_argument("--pairs", type=int, default=24, help="number of cases with two effects")
    parser.add_argument("--nulls", type=int, default=12, help="number of cases without an effect")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument(
        "--only", nargs="+", metavar="WORD", help="compute only rows whose names begin with one of these words"
    )
    arguments = parser.parse_args()
    rows = [row for row in changes() if row.name == BASELINE or row.name.startswith(tuple(arguments.only or ("",)))]
    counts = {"single": arguments.singles, "pair": arguments.pairs, "null": arguments.nulls}
    cases = [replace(task, options=(*task.options, *SMALL.items())) for task in tasks(counts, arguments.seed)]
    if not cases:
        parser.error("nothing to do: give --singles, --pairs or --nulls")
    answers = {}
    for task, answer in here(partial(named, rows), cases, arguments.jobs):
        if isinstance(answer, BaseException):
            raise answer
        answers[task.name] = answer
        print(f"{len(answers)} of {len(cases)}: {task.name}", file=sys.stderr, flush=True)
    kinds = {kind: [task for task in cases if task.kind == kind] for kind in KINDS if counts[kind]}
    width = max(len(row.name) for row in rows)
    print(" | ".join([f"{'constant':<{width}}", *(f"{KINDS[kind]:<24}" for kind in kinds), "leaves the interval"]))
    before: dict[str, tuple[float, float]] = {}
    for place, row in enumerate(rows):
        cells, outside = [], []
        for kind, own in kinds.items():
            said = [(task, answers[task.name][place]) for task in own]
            hits = sum(bool(a) if kind == "null" else set(a) == set(t.true) for t, a in said)
            low, high = before.setdefault(kind, wilson(hits, len(own), LEVEL))
            cells.append(f"{cell(hits, len(own)):<24}")
            outside += [] if low <= hits / len(own) <= high else [KINDS[kind]]
        print(" | ".join([f"{row.name:<{width}}", *cells, ", ".join(outside)]))


if __name__ == "__main__":
    main()
