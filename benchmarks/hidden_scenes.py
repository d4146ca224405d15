"""How often a wrong number of a scene is found: ``python benchmarks/hidden_scenes.py --json scenes.jsonl --jobs 2``.

A bench that the diagnosis never sees (`hidden_scene/bench.py`) differs from the scene in one cause, in two, or in none.
It also has another time step, other contact settings and a finer pad than the scene, servos with friction, a jittering
clock, and a tip whose pose in its holder varies between episodes. The table compares the named causes with those of
least squares (`hidden_scene/baseline.py`) and counts how often the 90 % intervals contain the true values. A case takes
some minutes, so outcomes are kept in a file, and an interrupted run resumes.

``--sensor reference --known unit`` reads the forces through a unit of the magnetic pad that was calibrated on another
recording; ``--known product`` knows only its product's operator.

``--reports FOLDER`` writes three reports on one minute of motion instead, with seeds that were seen while the search
was built: a fault of the sensor, one of the scene, and both. Each row has the seconds that the diagnosis took, and the
largest memory of this process and of a worker.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from harness import Outcome, add_options, diagnosed, run
from hidden_scene.baseline import fit
from hidden_scene.cases import CAUSES, case
from hidden_scene.known import known_sensor

import paxisim
from paxisim.diagnose.data.responses import SHOWN

BESIDE = ("axis_gain", "latency", "creep")
IN_SCENE = set(CAUSES)
REPORTS = {"sensor": ("", "creep", 3), "scene": ("mount_tilt", "", 0), "both": ("friction", "latency", 1)}


@dataclass(frozen=True)
class Task:
    """A case: a cause in the scene and one in the sensor, empty for none, its seed, and what reads the forces."""

    cause: str
    beside: str
    seed: int
    sensor: str = "chain"
    known: str = ""

    @property
    def name(self) -> str:
        """Name of the case."""
        return f"{self.cause or 'nothing'}{self.beside and '+'}{self.beside}:{self.seed}"


def solve(task: Task) -> Outcome:
    """Diagnose one case, and fit all numbers of the scene to it by least squares."""
    warnings.simplefilter("ignore")
    drawn = case(task.cause, task.seed, sensor=task.sensor, beside=task.beside)
    kind = "one in the scene, one in the sensor" if task.beside else task.cause or "nothing"
    with TemporaryDirectory() as own:  # no two cases share a replay
        least = fit(drawn.recording, drawn.scene, Path(own))
        outcome, found = diagnosed(
            task.name, kind, drawn.causes, drawn.recording, limit=0.0, scene=drawn.scene, replays=Path(own),
            sensor=known_sensor(task.seed, task.known),
        )  # fmt: skip
    parameters = drawn.scene.parameters()
    values = {p.name: p.value for c in found.causes for p in c.parameters} if found else {}
    known = [(values[n], v * SHOWN[parameters[n].unit][1]) for n, v in drawn.values.items() if n in values]
    within = sum(i.low is not None and i.high is not None and i.low <= v <= i.high for i, v in known)
    ends = [(*least.intervals[n], v) for n, v in drawn.values.items()]
    outcome.about.update(
        within=[int(within), len(known)],
        baseline=list(least.named),
        baseline_within=[sum(bool(low <= v <= high) for low, high, v in ends), len(ends)],
    )
    return outcome


def tasks(first: int, seeds: int, sensor: str, known: str) -> list[Task]:
    """Return the cases of each seed: each cause alone, none, and one beside a cause of the sensor."""
    out = []
    for seed in range(first, first + seeds):
        pair = (CAUSES[seed % len(CAUSES)], BESIDE[seed % 3])
        out += [Task(*causes, seed, sensor, known) for causes in (*((cause, "") for cause in CAUSES), ("", ""), pair)]
    return out


def table(outcomes: Sequence[Outcome]) -> None:
    """Print a row for each cause and one for all."""
    print("\n| hidden | cases | exact | named | named or rival | covered | least squares: exact | its covered |")
    print("|---|---|---|---|---|---|---|---|")
    single = [o for o in outcomes if o.kind in CAUSES]
    for name in (*CAUSES, "any single cause", "nothing", "one in the scene, one in the sensor"):
        own = single if name == "any single cause" else [o for o in outcomes if o.kind == name]
        if own:
            print(f"| {name} | {len(own)} | {' | '.join(_cells(own))} |")
    if single:
        sure = [o for o in single if not _rivals(o)]
        rivals, right = sum(len(_rivals(o)) for o in single), sum(o.exact for o in sure)
        print(f"\nrivals of a single cause: {rivals / len(single):.1f} on average; ", end="")
        print(f"none in {len(sure)} of {len(single)}, of which {right} exact")


def _rivals(outcome: Outcome) -> set[str]:
    return {rival for rivals in outcome.named.values() for rival in rivals}


def _cells(own: Sequence[Outcome]) -> list[str]:
    # the magnetic pad has sensor causes of its own, so the scene's causes are compared separately
    in_scene = sum(o.contained and set(o.true) & IN_SCENE == set(o.named) & IN_SCENE for o in own)
    among = sum(set(o.true) <= {*o.named, *_rivals(o)} for o in own)
    inside, of, squares_inside, squares_of = (
        sum(o.about[key][k] for o in own) for key in ("within", "baseline_within") for k in (0, 1)
    )
    squares = sum(set(o.true) & IN_SCENE == set(o.about["baseline"]) for o in own)
    return [
        f"{sum(o.exact for o in own)} ({in_scene} in the scene)", str(sum(o.contained for o in own)), str(among),
        f"{inside} of {of}", str(squares), f"{squares_inside} of {squares_of}",
    ]  # fmt: skip


def reports(folder: Path, jobs: int) -> None:
    """Write the reports and print a row for each."""
    warnings.simplefilter("ignore")
    print(
        "| report | hidden | named | rivals | verdict | seconds | memory, worker (MB) |\n|---|---|---|---|---|---|---|"
    )
    for name, (cause, beside, seed) in REPORTS.items():
        drawn = case(cause, seed, beside=beside, episodes=10)
        begun = time.monotonic()
        found = paxisim.diagnose(drawn.recording, scene=drawn.scene, jobs=jobs)
        seconds = time.monotonic() - begun
        found.save(folder / name)
        rivals = ", ".join(dict.fromkeys(rival for cause in found.causes for rival in cause.rivals))
        memory = [resource.getrusage(who).ru_maxrss // 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        print(
            f"| {name} | {', '.join(drawn.causes)} | {', '.join(c.name for c in found.causes)} | {rivals} | "
            f"{found.verdict} | {seconds:.0f} | {memory[0]}, {memory[1]} |\n  hidden: {drawn.values}",
            flush=True,
        )


def main() -> None:
    """Diagnose the cases that are not in the file yet, and print a table of all cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8, help="number of cases per cause")
    parser.add_argument("--first", type=int, default=100, help="first seed; those below 100 were used in development")
    parser.add_argument("--sensor", choices=("chain", "reference"), default="chain", help="what reads the forces")
    parser.add_argument("--reports", type=Path, metavar="FOLDER", help="write three reports instead")
    parser.add_argument(
        "--known", choices=("", "product", "unit"), default="", help="what is known of a magnetic pad beforehand"
    )
    add_options(parser)
    options = parser.parse_args()
    if options.known and options.sensor != "reference":
        parser.error("--known needs --sensor reference")
    if options.reports:
        reports(options.reports, options.jobs)
        return
    wanted = tasks(options.first, options.seeds, options.sensor, options.known)
    outcomes = run(solve, wanted, options)
    table(outcomes)
    for o in outcomes if options.misses else ():
        if not o.exact:
            print(f"{o.name}: {o}")
    if len(outcomes) < len(wanted):
        sys.exit(1)


if __name__ == "__main__":
    main()
