"""How often a wrong number of a scene is found: ``python benchmarks/hidden_scenes.py --out scenes.jsonl --jobs 2``.

A bench that the diagnosis never sees (`hidden_scene/bench.py`) differs from the scene in one cause, in two, or in none.
It also has another time step, other contact settings and a finer pad than the scene, servos with friction, a jittering
clock, and a tip whose pose in its holder varies between episodes. The script prints the verdict, the named causes and
their rivals for each case. A table compares them with least squares (`baseline.py`) and counts how often the 90 %
intervals contain the true values. A case takes some minutes, so outcomes are kept in a file, and an interrupted run
resumes.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy

import json
import sys
import time
import traceback
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

sys.path.insert(0, str(Path(__file__).parent))

import tyro
from hidden_scene.baseline import fit
from hidden_scene.cases import CAUSES, case

import paxisim
from paxisim.diagnose.inside.responses import SHOWN

BESIDE = ("axis_gain", "latency", "creep")
IN_SCENE = set(CAUSES)


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case.

    Attributes:
        cause: Hidden cause in the scene; empty for none.
        beside: Hidden cause in the sensor; empty for none.
        seed: Random seed.
        named: Named causes.
        rivals: Rivals of the named causes.
        within: Number of hidden values, among those fitted, that lie within their 90 % intervals, and number of those
            fitted.
        verdict: Verdict of the diagnosis.
        seconds: Duration of the diagnosis.
        baseline: Causes named by least squares over all numbers of the scene.
        baseline_within: Number of hidden values that lie within its 90 % intervals, and number of hidden values.
    """

    cause: str
    beside: str
    seed: int
    named: list[str]
    rivals: list[str]
    within: list[int]
    verdict: str
    seconds: float
    baseline: list[str]
    baseline_within: list[int]

    @property
    def hidden(self) -> set[str]:
        """The hidden causes."""
        return {name for name in (self.cause, self.beside) if name}


def solve(task: tuple[str, str, int], sensor: str, replays: Path) -> Outcome:
    """Diagnose one case, given by a cause of the scene, a cause of the sensor and a seed."""
    warnings.simplefilter("ignore")
    cause, beside, seed = task
    drawn = case(cause, seed, sensor=sensor, beside=beside)
    parameters = drawn.scene.parameters()
    with TemporaryDirectory(dir=replays) as own:  # no two cases share a replay
        beside_it = fit(drawn.recording, drawn.scene, Path(own))
        ends = [(*beside_it.intervals[n], v) for n, v in drawn.values.items()]
        baseline = list(beside_it.named), [sum(bool(low <= v <= high) for low, high, v in ends), len(ends)]
        begun = time.monotonic()
        try:
            found = paxisim.diagnose(drawn.recording, scene=drawn.scene, replays=Path(own))
        except paxisim.PaxisimError as error:  # counts as nothing named
            seconds = round(time.monotonic() - begun, 1)
            return Outcome(cause, beside, seed, [], [], [0, 0], f"refused: {error}", seconds, *baseline)
        seconds = time.monotonic() - begun
    values = {p.name: p.value for c in found.causes for p in c.parameters}
    known = [(values[n], v * SHOWN[parameters[n].unit][1]) for n, v in drawn.values.items() if n in values]
    within = sum(bool(i.low is not None and i.high is not None and i.low <= v <= i.high) for i, v in known)
    return Outcome(
        cause,
        beside,
        seed,
        [c.name for c in found.causes],
        list(dict.fromkeys(r for c in found.causes for r in c.rivals)),
        [within, len(known)],
        found.verdict,
        round(seconds, 1),
        *baseline,
    )


def main(
    out: Path,
    seeds: int = 8,
    first: int = 100,
    jobs: int = 1,
    sensor: Literal["chain", "reference"] = "chain",
    replays: Path = Path(),
) -> None:
    """Diagnose the cases that are not in a file yet, and print a table of all cases.

    Args:
        out: File with one line of JSON per case, to which new cases are appended.
        seeds: Number of cases per cause.
        first: First seed. Seeds below 100 were used while the search was developed.
        jobs: Number of cases to run in parallel.
        sensor: Sensor that reads the forces: a chain of gains, noise and counts, or the magnetic reference pad.
        replays: Folder for the replays, which are deleted after each case.
    """
    tasks = [
        task
        for seed in range(first, first + seeds)
        for task in (
            *((cause, "", seed) for cause in CAUSES),
            ("", "", seed),
            (CAUSES[seed % len(CAUSES)], BESIDE[seed % 3], seed),
        )
    ]
    outcomes = _read(out)
    done = {(one.cause, one.beside, one.seed) for one in outcomes}
    left, failed = [task for task in tasks if task not in done], 0
    with ProcessPoolExecutor(jobs) as pool, out.open("a") as file:
        running = {pool.submit(solve, task, sensor, replays): task for task in left}
        for future in as_completed(running):
            if future.exception() is not None:  # the others go on, and the next run tries this one again
                failed += 1
                print(f"{running[future]} failed:", *traceback.format_exception(future.exception()), flush=True)
                continue
            one = future.result()
            file.write(json.dumps(asdict(one)) + "\n")
            file.flush()
            outcomes.append(one)
            print(f"{' + '.join(sorted(one.hidden)) or 'nothing'}, seed {one.seed}: {one.verdict}; named", end=" ")
            print(f"{', '.join(one.named) or 'nothing'}; rivals {', '.join(one.rivals) or 'none'}", flush=True)
    _table([one for one in outcomes if (one.cause, one.beside, one.seed) in tasks])
    if failed:
        print(f"hidden_scenes.py: {failed} of {len(left)} cases failed; run again to repeat them", file=sys.stderr)
        sys.exit(1)


def _read(path: Path) -> list[Outcome]:
    if not path.exists():
        return []
    return [Outcome(**json.loads(line)) for line in path.read_text().splitlines()]


def _table(outcomes: list[Outcome]) -> None:
    print("\n| hidden | cases | exact | named | named or rival | covered | least squares: exact | its covered |")
    print("|---|---|---|---|---|---|---|---|")
    alone = [one for one in outcomes if not one.beside]
    single = [one for one in alone if one.cause]
    for name in CAUSES:
        _row(name, [one for one in alone if one.cause == name])
    _row("any single cause", single)
    _row("nothing", [one for one in alone if not one.cause])
    _row("one in the scene, one in the sensor", [one for one in outcomes if one.beside])
    if single:
        sure = [one for one in single if not one.rivals]
        rivals, right = sum(len(one.rivals) for one in single), sum(one.hidden == set(one.named) for one in sure)
        print(f"\nrivals of a single cause: {rivals / len(single):.1f} on average; ", end="")
        print(f"none in {len(sure)} of {len(single)}, of which {right} exact")


def _row(label: str, own: list[Outcome]) -> None:
    if not own:
        return
    # the magnetic pad has sensor causes of its own, so the scene's causes are compared separately
    exact = sum(one.hidden & IN_SCENE == set(one.named) & IN_SCENE and one.hidden <= set(one.named) for one in own)
    only = sum(one.hidden == set(one.named) for one in own)
    named = sum(one.hidden <= set(one.named) for one in own)
    among = sum(one.hidden <= {*one.named, *one.rivals} for one in own)
    inside, of = (sum(one.within[k] for one in own) for k in (0, 1))
    squares = sum(one.hidden & IN_SCENE == set(one.baseline) for one in own)
    squares_inside, squares_of = (sum(one.baseline_within[k] for one in own) for k in (0, 1))
    print(
        f"| {label} | {len(own)} | {only} ({exact} in the scene) | {named} | {among} | {inside} of {of} | {squares} | "
        f"{squares_inside} of {squares_of} |"
    )


if __name__ == "__main__":
    tyro.cli(main)
