"""How often a hidden effect is found on other people's robots: ``python benchmarks/robots.py MENAGERIE --jobs 2``.

Three robots (`robot_world.py`) record four episodes of two grasps each, with an effect in the sensor, one in the scene
or none. Their owner composes the scene, attaches the pads and lets ``scene init`` find what moves what. No line of the
scene is written by hand but the modulus of the gel. Then the box is placed in each grasp, and the recording is replayed
and diagnosed. The table also has
the share of the replay that is in doubt, and how long a replay takes in relation to the recording.

MENAGERIE is a folder of MuJoCo Menagerie with franka_emika_panda, robotiq_2f85_v4 and ufactory_xarm7.
"""

from __future__ import annotations

import argparse
import itertools
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from harness import Outcome, add_options, diagnosed, print_costs, print_rate, run
from robot_world import GEL, OWNED, ROBOTS, Truth, record, scene_model

import paxisim
from paxisim.augment import AxisGain, Creep, Latency
from paxisim.scene.guess import guess_scene

EPISODES = 4
IN_SCENE = ("friction", "mount_offset")
KINDS = ("gain and latency", "creep", *IN_SCENE, "nothing")


@dataclass(frozen=True)
class Task:
    """A case: a robot, a kind of effect and a random seed."""

    menagerie: Path
    robot: str
    kind: str
    seed: int
    search_scene: bool = False
    cubes: int = OWNED

    @property
    def name(self) -> str:
        """Name of the case."""
        return f"{self.robot}:{self.kind}:{self.seed}"


def hidden(kind: str, rng: np.random.Generator) -> tuple[Truth, tuple[str, ...]]:
    """Draw the truth of a case, and return it with the names of its causes."""
    if kind == "gain and latency":
        gain, delay = rng.uniform(0.7, 0.85), rng.uniform(0.04, 0.08)
        return Truth(sensor=paxisim.Chain([AxisGain((gain,) * 3), Latency(delay)])), ("axis_gain", "latency")
    if kind == "creep":
        return Truth(sensor=paxisim.Chain([Creep((rng.uniform(0.1, 0.2),), (rng.uniform(0.5, 1.5),))])), ("creep",)
    if kind == "friction":
        return Truth(friction=0.7), ("friction",)
    if kind == "mount_offset":
        angle = rng.uniform(0, 2 * np.pi)
        return Truth(offset=(1e-3 * np.cos(angle), 1e-3 * np.sin(angle))), ("mount_offset",)
    return Truth(), ()


@cache
def owned(menagerie: Path, name: str, cubes: int) -> tuple[str, tuple[paxisim.Mount, ...]]:
    """Return the owner's model of a robot as MJCF text, and the mounts that `attach` found."""
    mounts = scene_model(ROBOTS[name], menagerie, 1).mounts
    return scene_model(ROBOTS[name], menagerie, cubes, mounts).to_xml(), mounts


def recorded(task: Task, folder: Path, episodes: int) -> tuple[paxisim.Scene, paxisim.Recording, tuple[str, ...]]:
    """Return the owner's scene, the recording, and the hidden causes."""
    rng = np.random.default_rng([task.seed, KINDS.index(task.kind), list(ROBOTS).index(task.robot)])
    truth, causes = hidden(task.kind, rng)
    mjcf, mounts = owned(task.menagerie, task.robot, task.cubes)
    recording = record(ROBOTS[task.robot], task.menagerie, mounts, truth, rng, episodes)
    path = folder / "scene.xml"
    path.write_text(mjcf, encoding="utf-8")
    return guess_scene(path, recording).scene.with_parameters(modulus=GEL.modulus), recording, causes


def solve(task: Task) -> Outcome:
    """Record, find the scene, replay and diagnose one case."""
    warnings.simplefilter("ignore")
    with TemporaryDirectory() as folder:
        scene, recording, causes = recorded(task, Path(folder), EPISODES)
        placing = time.process_time()
        scene, recording, _ = paxisim.place_objects(scene, recording)
        placing = (time.process_time() - placing) / recording.duration
        begun = time.process_time()
        paired = scene.simulate(recording)
        share = (time.process_time() - begun) / recording.duration
        in_scene = {"scene": scene, "replays": Path(folder)} if task.search_scene else {}
        given = recording if task.search_scene else paired
        outcome, found = diagnosed(task.name, task.kind, causes, given, limit=0.0, **in_scene)
    before, after = (found.heldout.nrmse_before, found.heldout.nrmse_after) if found else (np.nan, np.nan)
    replay = paired.metadata["replay"]
    outcome.about.update(
        robot=task.robot, mode=replay["mode"], in_doubt=replay["in_doubt"], placing=placing, cost=share,
        before=before, after=after,
        not_testable=sorted(found.not_testable) if found else [],
    )  # fmt: skip
    return outcome


def errors(task: Task) -> str:
    """Return a row with the error of the replay in each grasp, from two episodes without a diagnosis."""
    warnings.simplefilter("ignore")
    with TemporaryDirectory() as folder:
        scene, recording, _ = recorded(task, Path(folder), 2)
        scene, recording, _ = paxisim.place_objects(scene, recording)
        paired = scene.simulate(recording)
    found = []
    for part in paired.select(known=True).episodes():
        assert part.measured is not None
        assert part.simulated is not None
        found.append(float(np.linalg.norm(part.measured - part.simulated) / np.linalg.norm(part.measured)))
    in_doubt = paired.metadata["replay"]["in_doubt"]
    return f"| {task.robot} | {task.cubes} | {' | '.join(f'{error:.2f}' for error in found)} | {in_doubt:.0%} |"


def table(outcomes: Sequence[Outcome]) -> None:
    """Print a row for each robot and kind, and the rates."""
    print("\n| robot | hidden | exact | named | named or rival | in doubt | normalised RMSE | replay / real time |")
    print("|---|---|---|---|---|---|---|---|")
    for robot in ROBOTS:
        for kind in KINDS:
            own = [o for o in outcomes if o.about["robot"] == robot and o.kind == kind]
            if own:
                doubt, cost = (np.mean([o.about[key] for o in own]) for key in ("in_doubt", "cost"))
                before, after = (np.median([o.about[key] for o in own]) for key in ("before", "after"))
                counts = " | ".join(f"{sum(hits)} of {len(own)}" for hits in _hits(own))
                print(f"| {robot} | {kind} | {counts} | {doubt:.0%} | {before:.2f} -> {after:.2f} | {cost:.2f} |")
    print()
    real, nothing = ([o for o in outcomes if (o.kind != "nothing") is is_real] for is_real in (True, False))
    print_rate("exactly the hidden causes that are testable named", real, _exact, ">= 60 %")
    print_rate("all of them named or rivals", real, _among, ">= 90 %")
    print_rate("nothing hidden, but something named", nothing, lambda o: bool(o.named), "<= 10 %")
    print_rate("explained with a false name", outcomes, lambda o: o.verdict == "explained" and not _exact(o), "<= 0 %")
    print_costs(outcomes)


def _testable(outcome: Outcome) -> set[str]:
    return set(outcome.true) - set(outcome.about["not_testable"])


def _exact(outcome: Outcome) -> bool:
    return bool(_testable(outcome)) and set(outcome.named) == _testable(outcome)


def _among(outcome: Outcome) -> bool:
    rivals = {rival for own in outcome.named.values() for rival in own}
    return bool(_testable(outcome)) and _testable(outcome) <= {*outcome.named, *rivals}


def _hits(own: Sequence[Outcome]) -> list[list[bool]]:
    if own[0].kind == "nothing":
        return [[not o.named for o in own]] * 3
    return [[_exact(o) for o in own], [_testable(o) <= set(o.named) for o in own], [_among(o) for o in own]]


def main() -> None:
    """Diagnose the cases that are not in the file yet, and print a table of all cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("menagerie", type=Path, help="folder of MuJoCo Menagerie")
    parser.add_argument("--seeds", type=int, default=4, help="number of cases per robot and kind")
    parser.add_argument("--first", type=int, default=100, help="first seed; those below 100 were used in development")
    parser.add_argument("--robots", nargs="+", choices=tuple(ROBOTS), default=tuple(ROBOTS))
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--errors", action="store_true", help="only print the error of the replay in each grasp")
    parser.add_argument("--cubes", type=int, nargs="+", default=[OWNED], help="cubes along each taxel, for --errors")
    parser.add_argument("--search-scene", action="store_true", help="search causes in the scene too, which takes long")
    add_options(parser)
    options = parser.parse_args()
    kinds = options.kinds if options.search_scene else [kind for kind in options.kinds if kind not in IN_SCENE]
    seeds = range(options.first, options.first + options.seeds)
    if options.errors:
        print("| robot | cubes | first grasp | second | third | fourth | in doubt |\n|---|---|---|---|---|---|---|")
        for seed, robot, cubes in itertools.product(seeds, options.robots, options.cubes):
            print(errors(Task(options.menagerie, robot, "nothing", seed, cubes=cubes)), flush=True)
        return
    wanted = [
        Task(options.menagerie, robot, kind, seed, options.search_scene)
        for seed in seeds for robot in options.robots for kind in kinds
    ]  # fmt: skip
    outcomes = run(solve, wanted, options)
    table(outcomes)
    for o in outcomes if options.misses else ():
        if not (_exact(o) or (o.kind == "nothing" and not o.named)):
            print(f"{o.name}: {o}")


if __name__ == "__main__":
    main()
