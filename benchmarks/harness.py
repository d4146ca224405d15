"""What the benchmarks that judge diagnoses share: cases -> diagnose -> judge -> table.

A benchmark has cases, each with a name, and a function that works on one of them and returns an `Outcome`. `run` works
on all cases in processes, stores each outcome as a line of JSON, and does not repeat those that are stored. The table
is made of the outcomes.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: one thread per job
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))  # the generator of hidden effects

import numpy as np
from hidden.compare import named
from scipy.stats import binomtest

import paxisim
from paxisim.diagnose import Diagnosis

ROOT = Path(__file__).parents[1]
PATIENCE = 600.0  # s of processor time for a diagnosis
NAMELESS = ("refused", "crashed", "unrelated")


class Case(Protocol):
    """What `run` needs to know of a case."""

    @property
    def name(self) -> str:
        """Name that no other case has, such as ``single:17``."""
        ...


@dataclass(frozen=True)
class Outcome:
    """The outcome of a case.

    Attributes:
        name: Name of the case.
        kind: Kind of the case, for the table.
        true: The hidden causes.
        verdict: The verdict, as in `paxisim.diagnose.Diagnosis`; ``refused`` or ``crashed`` if there is none.
        named: Named causes or their parts, each with its rivals; see `hidden.compare.named`.
        said: Warnings and left-over structure; the error if the recording was refused or the diagnosis crashed.
        seconds: Duration of the diagnosis.
        memory: Peak memory of the process so far (GB).
        explained: Held-out share of the headroom, given the diagnosis' own noise floor.
        ceiling: The same for the black box.
        about: What only this benchmark knows of the case.
    """

    name: str
    kind: str
    true: tuple[str, ...]
    verdict: str
    named: dict[str, tuple[str, ...]]
    said: tuple[str, ...] = ()
    seconds: float = 0.0
    memory: float = 0.0
    explained: float | None = None
    ceiling: float | None = None
    about: dict[str, Any] = field(default_factory=dict)

    @property
    def exact(self) -> bool:
        """Whether exactly the hidden causes were named."""
        return self.verdict not in NAMELESS and set(self.named) == set(self.true)

    @property
    def contained(self) -> bool:
        """Whether all hidden causes were named, possibly among others."""
        return self.verdict not in NAMELESS and set(self.true) <= set(self.named)

    @property
    def flagged(self) -> bool:
        """Whether the verdict states that no cause explains part of the error."""
        return self.verdict in ("partly_explained", "unexplained")

    @property
    def confidently_wrong(self) -> bool:
        """Whether the wrong causes were named with the verdict ``explained``."""
        return self.verdict == "explained" and not self.exact

    def __str__(self) -> str:
        """Return the answer as text."""
        names = [name + (f" (or {'/'.join(rivals)})" if rivals else "") for name, rivals in self.named.items()]
        said = f": {self.said[-1].strip().splitlines()[-1]}" if self.verdict in ("refused", "crashed") else ""
        return f"{self.verdict}{said or ': ' + (', '.join(names) or 'nothing')}"


@contextmanager
def patience(limit: float) -> Iterator[None]:
    """Raise TimeoutError after `limit` seconds of processor time, 0 for never: no search blocks the other cases."""

    def give_up(number: int, frame: object) -> None:
        raise TimeoutError(f"no answer after {limit:.0f} s of processor time")

    signal.signal(signal.SIGVTALRM, give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)


def diagnosed(
    name: str, kind: str, true: tuple[str, ...], recording: paxisim.Recording, limit: float = PATIENCE, **options: Any
) -> tuple[Outcome, Diagnosis | None]:
    """Diagnose a recording; one that is refused and one that crashes the diagnosis have an outcome too."""
    begin = time.perf_counter()

    def outcome(verdict: str, named: dict, said: Sequence[str], **more: Any) -> Outcome:
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        return Outcome(name, kind, true, verdict, named, tuple(said), time.perf_counter() - begin, memory, **more)

    try:
        with patience(limit):
            found = paxisim.diagnose(recording, **options)
    except paxisim.InvalidValueError as error:
        return outcome("refused", {}, [str(error)]), None
    except Exception:
        return outcome("crashed", {}, [traceback.format_exc(limit=-4)]), None
    names = {name: cause.rivals for name, cause in named(found).items()}
    said = (*found.symptoms.warnings, *(item.what for item in found.symptoms.left_over))
    explained = found.heldout.explained.value if found.heldout.explained else None
    ceiling = found.heldout.ceiling_explained
    return outcome(found.verdict, names, said, explained=explained, ceiling=ceiling), found


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that every benchmark has."""
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--json", type=Path, help="file of JSON lines that stores the outcomes")
    parser.add_argument("--limit-minutes", type=float, default=np.inf, help="begin no other case after this time")
    parser.add_argument("--ray", nargs="?", const="auto", metavar="ADDRESS", help="run on a Ray cluster, at HOST:PORT")
    parser.add_argument("--misses", action="store_true", help="print the wrong answers")


def run(
    work: Callable[[Any], Outcome], cases: Sequence[Case], options: argparse.Namespace, version: str = ""
) -> list[Outcome]:
    """Return the outcomes of the cases, in their order; those stored in ``options.json`` are not made again.

    Args:
        work: Function of a case, which a process imports from its module.
        cases: The cases.
        options: Those of `add_options`.
        version: Digest of the code under test; outcomes of another version are not mixed with these.
    """
    done = _stored(options.json, version)
    left = [case for case in cases if case.name not in done]
    ended = here(work, left, options.jobs, options.limit_minutes)
    try:
        if options.ray:
            ended = paxisim.RayCluster(options.ray).run(work, left, [Path(__file__)])
        for case, outcome in ended:
            if not isinstance(outcome, Outcome):
                print(f"{case.name} failed: {outcome!r}", flush=True)
                continue
            done[case.name] = outcome
            if options.json:
                with options.json.open("a") as file:
                    file.write(json.dumps({"version": version, **asdict(outcome)}) + "\n")
            print(f"{len(done)}/{len(cases)} {case.name} {outcome}", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        print("stopped")
    except paxisim.PaxisimError as error:
        raise SystemExit(f"error: {error}") from error
    outcomes = [done[case.name] for case in cases if case.name in done]
    if len(outcomes) < len(cases):
        print(f"the table contains {len(outcomes)} of {len(cases)} cases")
    return outcomes


def here(
    work: Callable[[Any], Outcome], cases: Sequence[Case], jobs: int, minutes: float = np.inf
) -> Iterator[tuple[Case, Outcome | BaseException]]:
    """Work on cases in processes of this machine and yield each with its outcome, or with what went wrong."""
    waiting, running, end = list(reversed(cases)), {}, time.monotonic() + 60 * minutes
    with ProcessPoolExecutor(jobs) as pool:
        while True:
            while waiting and len(running) < jobs and time.monotonic() < end:
                case = waiting.pop()
                running[pool.submit(work, case)] = case
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(future), future.exception() or future.result()


def _stored(path: Path | None, version: str) -> dict[str, Outcome]:
    """Return the outcomes stored in a file by case, and remove an incomplete last line from it."""
    if path is None or not path.exists():
        return {}
    lines = [line for line in path.read_text().splitlines(keepends=True) if line.endswith("\n")]
    path.write_text("".join(lines))
    done = {}
    for row in map(json.loads, lines):
        if row.pop("version") != version and version:
            raise SystemExit(f"{path} contains outcomes of another version of the code: pass another file to --json")
        named = {name: tuple(rivals) for name, rivals in row["named"].items()}
        done[row["name"]] = Outcome(**{**row, "named": named, "true": tuple(row["true"]), "said": tuple(row["said"])})
    return done


def digest(*folders: str) -> str:
    """Return a digest of the code that an outcome depends on: that of the diagnosis, and what else is given."""
    code = hashlib.sha256()
    for folder in ("paxisim/diagnose", "paxisim/augment", *folders):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if not path.name.startswith("test_"):
                code.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return code.hexdigest()[:12]


def wilson(hits: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Return the Wilson interval of a rate."""
    interval = binomtest(hits, count).proportion_ci(level, method="wilson")
    return float(interval.low), float(interval.high)


def print_rate(what: str, some: Sequence[Outcome], hit: Callable[[Outcome], bool], target: str = "") -> None:
    """Print how often `hit` holds, with the interval of the rate and whether it meets a target such as ``>= 90 %``."""
    if not some:
        return
    hits = sum(map(hit, some))
    low, high = wilson(hits, len(some))
    rate, mark = hits / len(some), ""
    if target:
        limit = float(target.split()[1]) / 100
        mark = "met" if (rate >= limit if target.startswith(">=") else rate <= limit) else "MISSED"
    shown = f"{100 * rate:5.1f} % ({100 * low:.0f} to {100 * high:.0f})"
    print(f"{f'{what} ({hits}/{len(some)})':<62} {target:<8} {shown} {mark}")


def print_costs(outcomes: Sequence[Outcome]) -> None:
    """Print the seconds and the memory of the diagnoses."""
    if outcomes:
        seconds = [o.seconds for o in outcomes]
        print(
            f"seconds per diagnosis: median {np.median(seconds):.1f}, p90 {np.quantile(seconds, 0.9):.1f}, largest "
            f"{max(seconds):.1f}; largest memory of a process {max(o.memory for o in outcomes):.2f} GB"
        )
