"""Rates at which a diagnosis names hidden effects, and other measures of its quality.

    python benchmarks/hidden_effects.py --singles 100 --pairs 60 --triples 40 --nulls 100 --outsiders 40 --jobs 2

Recordings are made by `tests/hidden/practice`, which shares no code with the diagnosis, or by another generator:

- ``--generator exam``: use `tests/hidden/exam`, which no diagnosis was developed on: singles, pairs, nulls and
  outsiders. Once its misses have been inspected, it is only another practice generator.

For ``practice`` only:

- ``--poor N``: motions of one slow speed, diagnosed, recorded again as advised, and diagnosed again.
- ``--nested N``: diagnose the first N cases of each kind once more without two episodes, and judge the model on these.
- ``--cost``: time and memory against the length of a recording and its number of taxels.

For both generators:

- ``--misses``: list what was named, by cause and for each miss.
- ``--json FILE``: store each case as a line of JSON; cases already in FILE are not run again.
- ``--case single:17``: show one case as text, including what was hidden.
- ``--ray [ADDRESS]``: run on a Ray cluster, on each core of its nodes. All nodes must see this checkout.

Case number n of a kind is the same for any counts.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: one thread per job

import numpy as np
from hidden_table.cost import costs
from hidden_table.solve import compared, diagnosed, made, solve
from hidden_table.table import table
from hidden_table.tasks import GENERATORS, IN_EXAM, KINDS, Outcome, Task, read_outcome, tasks, version

import paxisim

Ended = tuple[Task, Outcome | paxisim.PaxisimError]


def kept(path: Path | None, code: str) -> list[Outcome]:
    """Return the outcomes stored in a file, ignoring an incomplete last line."""
    if path is None or not path.exists():
        return []
    out = []
    for line in path.read_text().splitlines(keepends=True):
        if not line.endswith("\n"):
            break
        row = json.loads(line)
        if row.pop("version") != code:
            raise SystemExit(f"{path} contains results of another version of the code: pass another file to --json")
        out.append(read_outcome(row))
    return out


def here(work: Callable[[Task], Outcome], left: Sequence[Task], jobs: int) -> Iterator[Ended]:
    """Work on tasks in processes of this machine and yield each with its outcome, as `paxisim.RayCluster.run` does."""
    with ProcessPoolExecutor(jobs) as pool:
        futures = {pool.submit(work, task): task for task in left}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def run(
    wanted: Sequence[Task], nested: int, jobs: int, path: Path | None, cluster: paxisim.RayCluster | None = None
) -> list[Outcome]:
    """Return all outcomes, reusing those in `path`; after an interrupt, return those completed."""
    code = version(wanted[0].generator)
    done = {o.task: o for o in kept(path, code)}
    outcomes = [done[task] for task in wanted if task in done]
    left = [task for task in wanted if task not in done]
    if path is not None and path.exists():  # removes an incomplete last line
        path.write_text("".join(json.dumps({"version": code, **o.as_row()}) + "\n" for o in done.values()))
    work = partial(solve, nested=nested)
    try:
        for task, outcome in cluster.run(work, left, [Path(__file__)]) if cluster else here(work, left, jobs):
            if isinstance(outcome, paxisim.PaxisimError):
                print(f"{task.name}: {outcome}")
                continue
            outcomes.append(outcome)
            if path is not None:
                with path.open("a") as file:
                    file.write(json.dumps({"version": code, **outcome.as_row()}) + "\n")
            print(f"\r{len(outcomes)}/{len(wanted)}", end="", file=sys.stderr, flush=True)
    except (KeyboardInterrupt, BrokenProcessPool) as error:
        print(f"stopped by {type(error).__name__}")
    print(file=sys.stderr)
    if len(outcomes) < len(wanted):
        print(f"the table contains {len(outcomes)} of {len(wanted)} cases")
    return sorted(outcomes, key=lambda o: o.task.seed)


def show(task: Task) -> None:
    """Print one case as text."""
    case = made(task)
    rate = 1 / np.median(np.diff(case.time))
    print(f"{task.name}: {' + '.join(task.true) or 'nothing'} hidden, {dict(task.options)}, seed {case.seed}")
    print(f"signal {case.signal:.3f}, {len(case.time)} samples at {rate:.0f} Hz\n{case.truth}\n")
    diagnosis, seconds = diagnosed(case)
    print(diagnosis)
    print(f"\n{seconds:.1f} s")
    for name, (error, inside, count) in compared(case, diagnosis).items() if task.generator == "practice" else ():
        print(f"{name}: error {error:.1%}, {inside} of {count} intervals contain the true value")


def main() -> None:
    """Parse the arguments, run the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for kind in KINDS:
        plural = "" if kind == "poor" else "s"
        parser.add_argument(f"--{kind}{plural}", dest=kind, type=int, default=0, help=f"number of {kind} cases")
    parser.add_argument("--generator", choices=GENERATORS, default="practice", help="generator of the recordings")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--ray", nargs="?", const="auto", metavar="ADDRESS", help="run on a Ray cluster, at HOST:PORT")
    parser.add_argument("--family", choices=("development", "final", "both"), default="both", help="family of motions")
    parser.add_argument("--nested", type=int, default=0, help="cases of each kind to judge on unseen episodes as well")
    parser.add_argument("--json", type=Path, help="file of JSON lines that stores the cases")
    parser.add_argument("--case", help="show one case, such as single:17, as text")
    parser.add_argument("--misses", action="store_true", help="list what was named by cause, and each miss")
    parser.add_argument("--cost", action="store_true", help="measure time and memory against size")
    arguments = parser.parse_args()
    counts = {kind: getattr(arguments, kind) for kind in KINDS}
    if arguments.ray and (arguments.cost or arguments.jobs != 1):
        parser.error("--ray is not available with --jobs, nor with --cost, which measures this machine")
    if arguments.generator == "exam":
        beyond = [f"--{name}" for name in ("nested", "cost") if getattr(arguments, name)]
        beyond += [f"--{kind}" for kind in KINDS if counts[kind] and kind not in IN_EXAM]
        if beyond:
            parser.error(f"{', '.join(beyond)}: not available with --generator exam")
    if arguments.case:
        kind, _, number = arguments.case.partition(":")
        kinds = IN_EXAM if arguments.generator == "exam" else KINDS
        if kind not in kinds or not number.isdigit():
            parser.error(f"--case expects KIND:NUMBER, with KIND one of {', '.join(kinds)}, got {arguments.case!r}")
        show(tasks(arguments.generator, {kind: int(number) + 1}, arguments.seed, arguments.family)[-1])
        return
    wanted = tasks(arguments.generator, counts, arguments.seed, arguments.family)
    if not (wanted or arguments.cost):
        parser.error("nothing to do: give --singles, --pairs, --triples, --nulls, --outsiders, --poor or --cost")
    try:
        cluster = paxisim.RayCluster(arguments.ray) if arguments.ray else None
    except paxisim.PaxisimError as error:
        parser.exit(2, f"hidden_effects.py: error: {error}\n")
    if wanted:
        outcomes = run(wanted, arguments.nested, arguments.jobs, arguments.json, cluster)
        table(outcomes, misses=arguments.misses)
        if len(outcomes) < len(wanted):
            sys.exit(1)
    if arguments.cost:
        costs(arguments.seed, arguments.jobs)


if __name__ == "__main__":
    main()
