"""Rates at which a diagnosis names hidden effects, and other measures of its quality.

    python benchmarks/hidden_effects.py --singles 100 --pairs 60 --nulls 100 --outsiders 40 --jobs 2

Recordings are made by `tests/hidden`, which shares no code with the diagnosis. Case number n of a kind is the same for
any counts. ``--family broad`` draws motions, objects, imperfections and forms of effects that the others do not have.
``--case single:17`` shows one case as text, including what was hidden, and ``--cost`` measures time and memory against
the length of a recording and its number of taxels. ``--json FILE`` stores each outcome, and does not make it again.
"""

from __future__ import annotations

import argparse
import sys

from harness import add_options, digest, run
from hidden_table.cases import FAMILIES, HARD, KINDS, Task, recording, solve, tasks
from hidden_table.cost import costs
from hidden_table.table import misses, table

import paxisim


def show(task: Task) -> None:
    """Print one case as text."""
    case = task.made()
    print(f"{task.name}: {' + '.join(task.true) or 'nothing'} hidden, {dict(task.options)}, seed {case.seed}")
    print(f"signal {case.signal:.3f}, {len(case.time)} samples\n{case.truth}\n\n{paxisim.diagnose(recording(case))}")


def main() -> None:
    """Parse the arguments, run the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for kind in KINDS:
        parser.add_argument(f"--{kind}s", dest=kind, type=int, default=0, help=f"number of {kind}s")
    parser.add_argument("--hard", type=int, default=0, help=f"number of cases of each of: {', '.join(HARD)}")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--family", choices=FAMILIES, default="both", help="family of motions")
    parser.add_argument("--case", help="show one case, such as single:17, as text")
    parser.add_argument("--cost", action="store_true", help="measure time and memory against size")
    add_options(parser)
    options = parser.parse_args()
    counts = {kind: getattr(options, kind) for kind in KINDS} | dict.fromkeys(HARD, options.hard)
    if options.case:
        kind, _, number = options.case.partition(":")
        if kind not in counts or not number.isdigit():
            parser.error(f"--case expects KIND:NUMBER, with KIND one of {', '.join(counts)}, got {options.case!r}")
        show(tasks({kind: int(number) + 1}, options.seed, options.family)[-1])
        return
    wanted = tasks(counts, options.seed, options.family)
    if not (wanted or options.cost):
        parser.error("nothing to do: give --singles, --pairs, --nulls, --outsiders, --hard, --case or --cost")
    if wanted:
        outcomes = run(solve, wanted, options, digest("tests/hidden"))
        table(outcomes)
        if options.misses:
            misses(outcomes)
        if len(outcomes) < len(wanted):
            sys.exit(1)
    if options.cost:
        costs(options.seed, options.jobs)


if __name__ == "__main__":
    main()
