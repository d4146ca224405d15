"""Diagnosis of known effects injected into real recordings: ``python benchmarks/injections.py FOLDER``.

FOLDER holds two recordings of eFlesh, ``press_1`` and ``press_2`` (see `paxisim.logs.eflesh`). Their channels, treated
as forces of a pad of 1x5 taxels, are the measured stream (`injected.real`). The simulation is a smooth regression of
the same signal that predicts each press from the others, so its residual is the part that the sensor does not repeat.
The cases are:

- **injected**: a single effect, implemented separately in numpy, is applied to the real signal (`injected.cases`).
- **null**: the unchanged real signal.
- **broken**: streams that do not correspond (`injected.broken`).

`injected.judge` defines which answers count as right. ``--kinds`` prints one row per kind. ``--misses`` prints the
wrong answers; once the misses of a seed have been inspected, that seed is no longer suitable for judging.
``--write CASES`` writes the cases to a folder, and ``--read CASES`` diagnoses the cases of a folder with whatever
version of the package is on the path.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: one thread per job

from injected.broken import broken
from injected.cases import EFFECTS, Case, Source, injected, nulls
from injected.judge import Outcome, as_line, from_line, solve, write
from injected.real import leaves, regressions
from injected.report import said, show

import paxisim


def cases_of(folder: Path, seed: int, effects: int, empty: int, with_broken: bool) -> list[Case]:
    """Return all cases of a seed, and print the residuals of the regressions to stderr."""
    source = Source(folder)
    for number, real in enumerate(source.both):
        for name in regressions():
            left = leaves(real, source.simulated(number, name))
            print(
                f"press_{number + 1}, regression {name}: leaves {left.mean():.2f} times the sensor's noise "
                f"({left.min():.2f} to {left.max():.2f} by channel)",
                file=sys.stderr,
            )
    some = [*injected(source, seed, effects), *nulls(source, seed, empty)]
    return some + (broken(source, seed) if with_broken else [])


def engine() -> str:
    """Return a digest of the code under test."""
    root, digest = Path(paxisim.__file__).parent, hashlib.sha256()
    for path in sorted([*(root / "diagnose").rglob("*.py"), *(root / "augment").rglob("*.py")]):
        digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def run(paths: Sequence[Path], jobs: int, kept: Path | None) -> list[Outcome]:
    """Return all outcomes in the order of `paths`, reusing those stored in `kept`."""
    code, done = engine(), {}
    if kept is not None and kept.exists():
        lines = [line for line in kept.read_text().splitlines(keepends=True) if line.endswith("\n")]
        done = {outcome.name: outcome for outcome in (from_line(line, code) for line in lines)}
        kept.write_text("".join(lines))  # removes an incomplete last line
    names = [path.stem.replace("-", ":") for path in paths]
    left = [path for path, name in zip(paths, names, strict=True) if name not in done]
    with ProcessPoolExecutor(jobs) as pool:
        for count, job in enumerate(as_completed([pool.submit(solve, path) for path in left]), start=1):
            outcome = job.result()
            done[outcome.name] = outcome
            if kept is not None:
                with kept.open("a") as file:
                    file.write(as_line(outcome, code))
            print(f"{count}/{len(left)} {outcome.name} {outcome.seconds:.0f} s", file=sys.stderr, flush=True)
    return [done[name] for name in names]


def main() -> None:
    """Parse the arguments, run the cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", help="folder with press_1 and press_2")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--effects", type=int, default=2 * len(EFFECTS), help="number of injected effects")
    parser.add_argument("--nulls", type=int, default=10, help="number of nulls")
    parser.add_argument("--no-broken", action="store_true", help="omit the streams that do not correspond")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--json", type=Path, help="file of JSON lines that stores the outcomes")
    parser.add_argument("--list", action="store_true", help="list the cases without diagnosing them")
    parser.add_argument("--case", help="show one case, such as injected:3, as text")
    parser.add_argument("--kinds", action="store_true", help="print one row per kind")
    parser.add_argument("--misses", action="store_true", help="print the wrong answers")
    parser.add_argument(
        "--write", type=Path, metavar="CASES", help="write the cases to a folder without diagnosing them"
    )
    parser.add_argument("--read", type=Path, metavar="CASES", help="diagnose the cases of a folder instead")
    arguments = parser.parse_args()
    if (arguments.folder is None) == (arguments.read is None):
        parser.error("give either FOLDER or --read CASES")
    with tempfile.TemporaryDirectory() as temporary:
        target = arguments.read or arguments.write or Path(temporary)
        if arguments.read is None:
            cases = cases_of(
                arguments.folder, arguments.seed, arguments.effects, arguments.nulls, not arguments.no_broken
            )
            if arguments.case:
                cases = [case for case in cases if case.name == arguments.case]
                if not cases:
                    parser.error(f"there is no case {arguments.case!r}; see --list")
                print(f"{cases[0].name} {cases[0].kind}: {cases[0].words}\n{paxisim.diagnose(cases[0].recording)}")
            if arguments.list:
                for case in cases:
                    print(f"{case.name:<13} {case.kind:<26} signal {case.signal:9.2f}  {case.words}")
            target.mkdir(parents=True, exist_ok=True)
            paths = [write(case, target) for case in cases]
        else:
            paths = sorted(target.glob("*.json"), key=_order)
        if not (arguments.list or arguments.write):
            outcomes = run(paths, arguments.jobs, arguments.json)
            show(outcomes, kinds=arguments.kinds, misses=arguments.misses)
            if arguments.case:
                print(said(outcomes[0]))


def _order(path: Path) -> tuple[int, int]:
    group, _, number = path.stem.partition("-")
    return ("injected", "null", "broken").index(group), int(number)


if __name__ == "__main__":
    main()
