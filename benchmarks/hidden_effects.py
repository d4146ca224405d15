"""How often a hidden effect is named: ``python benchmarks/hidden_effects.py --singles 100 --pairs 60 --nulls 100``.

Recordings are made by `tests/hidden`, which shares no code with the diagnosis. Case number n of a kind has the seed
``seed * 1_000_000 + n`` and a kind's number on top, so that each line of the list of misses can be made again.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import traceback
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: one thread for each job

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from hidden.cases import make
from hidden.effects import EFFECTS
from hidden.outsiders import OUTSIDERS

KINDS = {"single": 1, "pair": 2, "null": 3, "outsider": 4, "triple": 5}
STRONG = 0.1  # of the noise's energy
NULLS = {"plain": {}, "AR 0.95": {"rho": 0.95}, "0.1 N rounding": {"coarse": True}}


@dataclass(frozen=True)
class Task:
    """A case to be made and diagnosed."""

    kind: str
    true: tuple[str, ...]
    seed: int
    family: str
    options: str = "plain"


@dataclass(frozen=True)
class Outcome:
    """What was found in a case."""

    task: Task
    found: tuple[str, ...]
    signal: float
    explained: float
    seconds: float
    error: str = ""

    @property
    def exact(self) -> bool:
        """Whether these and no others were named."""
        return set(self.found) == set(self.task.true)

    @property
    def contained(self) -> bool:
        """Whether all were named, others perhaps too."""
        return set(self.task.true) <= set(self.found)


def solve(task: Task) -> Outcome:
    """Make a case and diagnose it."""
    from paxisim.diagnose.engine import explain
    from paxisim.recording import Recording

    case = make(task.true, seed=task.seed, family=task.family, **NULLS[task.options])
    begin = time.perf_counter()
    try:
        found = explain(Recording(case.time, case.measured, case.simulated, case.covariates, case.episode))
    except Exception:  # a crash is a miss, and the other cases still count
        spent = time.perf_counter() - begin
        return Outcome(task, ("crash",), case.signal, 0.0, spent, traceback.format_exc(limit=-2))
    names = tuple(item.name for item in found.found)
    explained = 1 - float(found.energy.sum() / found.empty_energy.sum())
    return Outcome(task, names, case.signal, explained, time.perf_counter() - begin)


def tasks(arguments: argparse.Namespace) -> list[Task]:
    """All cases that are asked for; singles go through the causes in turn, sets are drawn."""
    rng = np.random.default_rng(arguments.seed)
    families = ["development", "final"] if arguments.family == "both" else [arguments.family]
    names, foreign = list(EFFECTS), list(OUTSIDERS)
    out = []
    for kind, count in (
        ("single", arguments.singles), ("pair", arguments.pairs), ("triple", arguments.triples),
        ("null", arguments.nulls), ("outsider", arguments.outsiders),
    ):  # fmt: skip
        for number in range(count):
            if kind == "single":
                true = (names[number % len(names)],)
            elif kind == "outsider":
                true = (foreign[number % len(foreign)],)
            else:
                size = {"pair": 2, "triple": 3, "null": 0}[kind]
                true = tuple(sorted(rng.choice(names, size, replace=False)))
            seed = arguments.seed * 1_000_000 + KINDS[kind] * 10_000 + number
            # the cycle over the causes must not go in step with that over the families
            family = families[(number + number // len(names)) % len(families)]
            options = list(NULLS)[number % len(NULLS)] if kind == "null" else "plain"
            out.append(Task(kind, true, seed, family, options))
    return out


def wilson(hits: int, count: int) -> str:
    """A rate with its 95 % interval after Wilson."""
    if not count:
        return "-"
    z, rate = 1.96, hits / count
    middle = (rate + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * np.sqrt(rate * (1 - rate) / count + z * z / (4 * count**2))
    return f"{hits:>4}/{count:<4} {100 * rate:5.1f} %  ({100 * (middle - half):.1f} to {100 * (middle + half):.1f})"


def table(outcomes: list[Outcome]) -> None:
    """Print the rates, the confusion matrix of the singles and the misses."""
    kinds = {kind: [o for o in outcomes if o.task.kind == kind] for kind in KINDS}
    singles, pairs, triples = kinds["single"], kinds["pair"], kinds["triple"]
    strong = [o for o in singles if o.signal > STRONG]

    def row(what: str, hits: int, count: int) -> None:
        if count:
            print(f"{what:<44} {wilson(hits, count)}")

    row("exact singles", sum(o.exact for o in singles), len(singles))
    row(f"exact singles, signal > {STRONG}", sum(o.exact for o in strong), len(strong))
    row("exact pairs", sum(o.exact for o in pairs), len(pairs))
    row("pairs with both named", sum(o.contained for o in pairs), len(pairs))
    row("exact triples", sum(o.exact for o in triples), len(triples))
    row("false names in nulls", sum(bool(o.found) for o in kinds["null"]), len(kinds["null"]))
    for options in NULLS:
        some = [o for o in kinds["null"] if o.task.options == options]
        row(f"  of those, {options}", sum(bool(o.found) for o in some), len(some))
    row(
        "outsiders with a name of the vocabulary", sum(bool(o.found) for o in kinds["outsider"]), len(kinds["outsider"])
    )
    seconds = [o.seconds for o in outcomes]
    print(f"seconds a case: median {np.median(seconds):.1f}, largest {max(seconds):.1f}")

    if singles:
        print("\nwhat was named for each single (count of cases)")
        for name in EFFECTS:
            named = Counter(" + ".join(sorted(o.found)) or "nothing" for o in singles if o.task.true == (name,))
            if named:
                print(f"  {name:<14} " + ", ".join(f"{what} {count}" for what, count in named.most_common()))
    misses = [o for o in outcomes if o.task.kind != "outsider" and not o.exact]
    if misses:
        print("\nmisses, clearest effect first")
        for o in sorted(misses, key=lambda o: -o.signal):
            what = o.error.strip().splitlines()[-1] if o.error else ", ".join(o.found) or "nothing"
            print(
                f"  {' + '.join(o.task.true) or o.task.options:<32} named {what:<44} signal {o.signal:.3f}, seed "
                f"{o.task.seed}, {o.task.family}, {100 * o.explained:.0f} % of the energy explained, {o.seconds:.0f} s"
            )


def main() -> None:
    """Parse the arguments, run the cases and print the table; on an interrupt, of those that are done."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for kind in KINDS:
        parser.add_argument(f"--{kind}s", type=int, default=0, help=f"number of {kind}s")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--family", choices=("development", "final", "both"), default="both", help="of motions")
    arguments = parser.parse_args()
    wanted = tasks(arguments)
    if not wanted:
        parser.error("nothing to do: give --singles, --pairs, --triples, --nulls or --outsiders")
    outcomes: list[Outcome] = []
    pool = ProcessPoolExecutor(arguments.jobs)
    try:
        for job in as_completed([pool.submit(solve, task) for task in wanted]):
            outcomes.append(job.result())
            print(f"\r{len(outcomes)}/{len(wanted)}", end="", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        print(f"interrupted: {len(outcomes)} of {len(wanted)} cases are in the table")
    pool.shutdown(wait=False, cancel_futures=True)
    print(file=sys.stderr)
    table(sorted(outcomes, key=lambda o: o.task.seed))


if __name__ == "__main__":
    main()
