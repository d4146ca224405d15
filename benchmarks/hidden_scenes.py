"""How often a wrong number of a scene is found: ``python benchmarks/hidden_scenes.py --seeds 8 --jobs 2``.

A bench that the diagnosis never sees (`hidden_scene/bench.py`) has one number wrong, two causes, or nothing. It has
another time step, other contact settings and a finer pad than the scene, servos with friction, a clock that jitters,
and a tip that sits otherwise in its holder in each episode. Printed for each case are what was named, with rivals, and
whether the number that was hidden lies within its 90 % interval.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy

import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

sys.path.insert(0, str(Path(__file__).parent))

import tyro
from hidden_scene.cases import CAUSES, case

import paxisim

BESIDE = ("axis_gain", "latency", "creep")
IN_SCENE = set(CAUSES)


@dataclass(frozen=True)
class Outcome:
    """What was said of a case.

    Attributes:
        hidden: What was wrong.
        named: What was named.
        rivals: Rivals of what was named.
        within: Of the numbers that were hidden and found, how many lie within their intervals, and of how many.
        verdict: The verdict.
    """

    hidden: tuple[str, ...]
    named: tuple[str, ...]
    rivals: tuple[str, ...]
    within: tuple[int, int]
    verdict: str


def solve(task: tuple[str, str, int], sensor: str, replays: Path) -> Outcome:
    """Diagnose one case: a cause of the scene, one of the sensor, and a seed."""
    warnings.simplefilter("ignore")
    cause, beside, seed = task
    drawn = case(cause, seed, sensor=sensor, beside=beside)
    found = paxisim.diagnose(drawn.recording, scene=drawn.scene, replays=replays)
    values = {p.name: p.value for c in found.causes for p in c.parameters}
    times = {"m": 1e3, "rad": 57.29577951308232, "1": 1.0}
    parameters = drawn.scene.parameters()
    known = [(values[n], v * times[parameters[n].unit]) for n, v in drawn.values.items() if n in values]
    within = sum(i.low is not None and i.high is not None and i.low <= v <= i.high for i, v in known)
    rivals = tuple(dict.fromkeys(r for c in found.causes for r in c.rivals))
    return Outcome(drawn.causes, tuple(c.name for c in found.causes), rivals, (within, len(known)), found.verdict)


def main(
    seeds: int = 8,
    first: int = 100,
    jobs: int = 1,
    sensor: Literal["chain", "reference"] = "chain",
    replays: Path = Path("replays"),
) -> None:
    """Print a line for each case and a table.

    Args:
        seeds: Cases of each cause.
        first: The first seed. Seeds below 100 were looked at while the search was built.
        jobs: Cases at the same time.
        sensor: What reads the forces: a chain of gains, noise and counts, or the magnetic reference pad.
        replays: Folder for replays, which many cases have in common.
    """
    numbers = range(first, first + seeds)
    singles = [(cause, "", seed) for cause in CAUSES for seed in numbers]
    nulls = [("", "", seed) for seed in numbers]
    pairs = [(CAUSES[seed % len(CAUSES)], BESIDE[seed % 3], seed) for seed in numbers]
    tasks = [*singles, *nulls, *pairs]
    outcomes = []
    with ProcessPoolExecutor(jobs) as pool:
        for task, one in zip(tasks, pool.map(partial(solve, sensor=sensor, replays=replays), tasks), strict=True):
            print(f"{' + '.join(one.hidden) or 'nothing'}, seed {task[2]}: {one.verdict}; named", end=" ")
            print(f"{', '.join(one.named) or 'nothing'}; rivals {', '.join(one.rivals) or 'none'}", flush=True)
            outcomes.append(one)
    print()
    _table(outcomes)


def _table(outcomes: list[Outcome]) -> None:
    for label, count in (("singles", 1), ("pairs", 2), ("nulls", 0)):
        own = [one for one in outcomes if len(one.hidden) == count]
        if not own:
            continue
        # of the magnetic pad the sensor's causes are there, too
        exact = sum(set(one.hidden) & IN_SCENE == set(one.named) & IN_SCENE for one in own)
        both = sum(set(one.hidden) <= set(one.named) for one in own)
        among = sum(set(one.hidden) <= {*one.named, *one.rivals} for one in own)
        inside, of = (sum(one.within[k] for one in own) for k in (0, 1))
        only = sum(set(one.hidden) == set(one.named) for one in own)
        print(
            f"{label}: {len(own)}; exactly these causes {only}, the scene's exact {exact}, all named {both}, all among "
            f"named and rivals {among}, numbers within their intervals {inside} of {of}"
        )


if __name__ == "__main__":
    tyro.cli(main)
