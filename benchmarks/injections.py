"""Diagnosis of known effects injected into real recordings: ``python benchmarks/injections.py FOLDER``.

FOLDER holds two recordings of eFlesh, ``press_1`` and ``press_2`` (see `paxisim.logs.eflesh`). Their channels, treated
as forces of a pad of 1x5 taxels, are the measured stream (`injected.real`). The simulation is a smooth regression of
the same signal that predicts each press from the others, so its residual is the part that the sensor does not repeat.
The cases are:

- **injected**: a single effect of `tests/hidden` is applied to the real signal (`injected.effects`).
- **null**: the unchanged real signal.
- **broken**: streams that do not correspond (`injected.broken`).

`injected.judge` defines which answers count as right. ``--kinds`` prints one row per kind. ``--misses`` prints the
wrong answers; once the misses of a seed have been inspected, that seed is no longer suitable for judging.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from harness import Outcome, add_options, digest, print_costs, print_rate, run
from injected import judge
from injected.broken import COUNT, broken
from injected.cases import Case, Source, injected, null
from injected.effects import KINDS


@dataclass(frozen=True)
class Task:
    """Case `number` of a group: ``injected``, ``null`` or ``broken``."""

    group: str
    number: int
    seed: int
    folder: Path

    @property
    def name(self) -> str:
        """Name of the case."""
        return f"{self.group}:{self.number}"

    def made(self) -> Case:
        """Make the case."""
        make = {"injected": injected, "null": null, "broken": broken}[self.group]
        return make(source(self.folder), self.seed, self.number)


@cache
def source(folder: Path) -> Source:
    """Load the recordings, once a process."""
    return Source(folder)


def solve(task: Task) -> Outcome:
    """Make a case and diagnose it."""
    return judge.solve(task.made())


def table(outcomes: Sequence[Outcome], kinds: bool) -> None:
    """Print the rates, and a row for each kind if requested."""
    groups = {name: [o for o in outcomes if o.about["group"] == name] for name in ("injected", "null", "broken")}
    effects, nulls, streams = groups.values()
    print(f"{'':<62} {'target':<8} rate (95 % Wilson interval)")
    print_rate("injected effects: exact", effects, judge.exact, ">= 75 %")
    print_rate("injected effects: kind and place right", effects, judge.kind_and_place, ">= 90 %")
    print_rate("nulls with a name", nulls, lambda o: bool(o.named) or o.verdict in ("crashed", "refused"), "<= 0 %")
    print_rate("explained by a cause of another kind", effects + nulls, judge.false_and_explained, "<= 0 %")
    print_rate("streams that do not correspond: detected", streams, judge.noticed, ">= 100 %")
    print_rate("    reported, whatever else is named", streams, judge.warned)
    print_rate("crashed or timed out (all)", outcomes, lambda o: o.verdict == "crashed", "<= 0 %")
    print_costs(outcomes)
    if effects:
        low, middle, high = np.quantile([o.about["signal"] for o in effects], [0, 0.5, 1])
        print(
            f"energy of the effects over that of the regression's residual: {low:.3g}, median {middle:.3g}, {high:.3g}"
        )
    for group, kind in dict.fromkeys((o.about["group"], o.kind) for o in outcomes) if kinds else ():
        own = [o for o in groups[group] if o.kind == kind]
        said = Counter(", ".join(o.named) or o.verdict for o in own).most_common()
        place = f"{sum(map(judge.kind_and_place, own))}/{len(own)}" if group == "injected" else ""
        words = "; ".join(f"{what} x{count}" if count > 1 else what for what, count in said)
        print(f"{f'{group} {kind}':<34} {f'{sum(map(judge.right, own))}/{len(own)}':<8} {place:<8} {words}")


def main() -> None:
    """Parse the arguments, run the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with press_1 and press_2")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--effects", type=int, default=2 * len(KINDS), help="number of injected effects")
    parser.add_argument("--nulls", type=int, default=10, help="number of nulls")
    parser.add_argument("--broken", type=int, default=COUNT, help="number of streams that do not correspond")
    parser.add_argument("--list", action="store_true", help="list the cases without diagnosing them")
    parser.add_argument("--kinds", action="store_true", help="print one row per kind")
    add_options(parser)
    options = parser.parse_args()
    counts = {"injected": options.effects, "null": options.nulls, "broken": options.broken}
    tasks = [Task(group, number, options.seed, options.folder) for group, n in counts.items() for number in range(n)]
    if options.list:
        for case in (task.made() for task in tasks):
            print(f"{case.name:<13} {case.kind:<26} signal {case.signal:9.2f}  {case.words}")
        return
    outcomes = run(solve, tasks, options, digest("tests/hidden", "benchmarks/injected"))
    table(outcomes, options.kinds)
    for o in outcomes if options.misses else ():
        if not judge.right(o):
            print(f"{o.name} {o.kind} [{o.about['words'].split(';')[0]}], signal {o.about['signal']:.3g}\n    {o}")
    if len(outcomes) < len(tasks):
        sys.exit(1)


if __name__ == "__main__":
    main()
