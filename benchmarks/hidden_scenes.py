"""How often a wrong number of a scene is found: ``python benchmarks/hidden_scenes.py --out scenes.jsonl --jobs 2``.

A bench that the diagnosis never sees (`hidden_scene/bench.py`) has one number wrong, two causes, or nothing. It has
another time step, other contact settings and a finer pad than the scene, servos with friction, a clock that jitters,
and a tip that sits otherwise in its holder in each episode. Printed for each case are what was named, with rivals, and
whether the number that was hidden lies within its 90 % interval; beside it what least squares say (`baseline.py`).
A case takes some minutes, so that outcomes are kept in a file, and a run that was ended goes on.
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
    """What was said of a case.

    Attributes:
        cause: The cause in the scene that was hidden; empty for none.
        beside: That in the sensor.
        seed: Random seed.
        named: What was named.
        rivals: Rivals of what was named.
        within: Of the numbers that were hidden and found, how many lie within their intervals, and of how many.
        verdict: The verdict.
        seconds: That the diagnosis took.
        baseline: What least squares over all numbers of the scene names.
        baseline_within: Of the numbers that were hidden, how many lie within its intervals, and of how many.
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
        """What was wrong."""
        return {name for name in (self.cause, self.beside) if name}


def solve(task: tuple[str, str, int], sensor: str, replays: Path) -> Outcome:
    """Diagnose one case: a cause of the scene, one of the sensor, and a seed."""
    warnings.simplefilter("ignore")
    cause, beside, seed = task
    drawn = case(cause, seed, sensor=sensor, beside=beside)
    parameters = drawn.scene.parameters()
    with TemporaryDirectory(dir=replays) as own:  # no two cases have a replay in common
        begun = time.monotonic()
        found = paxisim.diagnose(drawn.recording, scene=drawn.scene, replays=Path(own))
        seconds = time.monotonic() - begun
        beside_it = fit(drawn.recording, drawn.scene, Path(own))
    values = {p.name: p.value for c in found.causes for p in c.parameters}
    known = [(values[n], v * SHOWN[parameters[n].unit][1]) for n, v in drawn.values.items() if n in values]
    within = sum(bool(i.low is not None and i.high is not None and i.low <= v <= i.high) for i, v in known)
    ends = [(*beside_it.intervals[n], v) for n, v in drawn.values.items()]
    return Outcome(
        cause,
        beside,
        seed,
        [c.name for c in found.causes],
        list(dict.fromkeys(r for c in found.causes for r in c.rivals)),
        [within, len(known)],
        found.verdict,
        round(seconds, 1),
        list(beside_it.named),
        [sum(bool(low <= v <= high) for low, high, v in ends), len(ends)],
    )


def main(
    out: Path,
    seeds: int = 8,
    first: int = 100,
    jobs: int = 1,
    sensor: Literal["chain", "reference"] = "chain",
    replays: Path = Path(),
) -> None:
    """Diagnose the cases that a file does not have yet, and print a table of all.

    Args:
        out: File with a line of JSON for each case, to which cases are added.
        seeds: Cases of each cause.
        first: The first seed. Seeds below 100 were looked at while the search was built.
        jobs: Cases at the same time.
        sensor: What reads the forces: a chain of gains, noise and counts, or the magnetic reference pad.
        replays: Folder in which replays are kept for as long as a case takes.
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
    left = [task for task in tasks if task not in done]
    with ProcessPoolExecutor(jobs) as pool, out.open("a") as file:
        running = {pool.submit(solve, task, sensor, replays): task for task in left}
        for future in as_completed(running):
            if future.exception() is not None:  # the others go on, and the next run tries this one again
                print(f"{running[future]} failed:", *traceback.format_exception(future.exception()), flush=True)
                continue
            one = future.result()
            file.write(json.dumps(asdict(one)) + "\n")
            file.flush()
            outcomes.append(one)
            print(f"{' + '.join(sorted(one.hidden)) or 'nothing'}, seed {one.seed}: {one.verdict}; named", end=" ")
            print(f"{', '.join(one.named) or 'nothing'}; rivals {', '.join(one.rivals) or 'none'}", flush=True)
    _table([one for one in outcomes if (one.cause, one.beside, one.seed) in tasks])


def _read(path: Path) -> list[Outcome]:
    if not path.exists():
        return []
    return [Outcome(**json.loads(line)) for line in path.read_text().splitlines()]


def _table(outcomes: list[Outcome]) -> None:
    print("\n| hidden | cases | exactly | named | named or rival | within | least squares exactly | its within |")
    print("|---|---|---|---|---|---|---|---|")
    alone = [one for one in outcomes if not one.beside]
    for name in CAUSES:
        _row(name, [one for one in alone if one.cause == name])
    _row("any one", [one for one in alone if one.cause])
    _row("nothing", [one for one in alone if not one.cause])
    _row("one of the scene, one of the sensor", [one for one in outcomes if one.beside])


def _row(label: str, own: list[Outcome]) -> None:
    if not own:
        return
    # the magnetic pad has causes of the sensor of its own
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
