"""Three reports on one minute of motion in a known scene, and what they cost: ``python benchmarks/scene_reports.py``.

A fault of the sensor, a fault of the scene, and both are hidden on the bench of `hidden_scenes.py`, with seeds that
were seen while the search was built. The diagnosis looks for all causes. Each row has the seconds it took and the
largest memory of this process and of a worker. Each report goes into a folder of its own.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy

import resource
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import tyro
from hidden_scene.cases import case

import paxisim

CASES = {"sensor": ("", "creep", 3), "scene": ("mount_tilt", "", 0), "both": ("friction", "latency", 1)}
EPISODES = 10  # of 6 s


def main(out: Path, jobs: int = 2, only: tuple[str, ...] = tuple(CASES)) -> None:
    """Write the reports and print a row for each.

    Args:
        out: Output folder; created if missing.
        jobs: Processes for the replays.
        only: Rows to make.
    """
    warnings.simplefilter("ignore")
    print("| report | hidden | named | rivals | verdict | seconds | memory, worker (MB) |")
    print("|---|---|---|---|---|---|---|")
    for name in only:
        cause, beside, seed = CASES[name]
        drawn = case(cause, seed, beside=beside, episodes=EPISODES)
        begun = time.monotonic()
        found = paxisim.diagnose(drawn.recording, scene=drawn.scene, jobs=jobs)
        seconds = time.monotonic() - begun
        found.save(out / name)
        rivals = dict.fromkeys(rival for cause in found.causes for rival in cause.rivals)
        memory = [resource.getrusage(who).ru_maxrss // 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        print(
            f"| {name} | {', '.join(drawn.causes)} | {', '.join(c.name for c in found.causes)} | {', '.join(rivals)} | "
            f"{found.verdict} | {seconds:.0f} | {memory[0]}, {memory[1]} |",
            flush=True,
        )
        for number, value in drawn.values.items():
            print(f"  hidden {number}: {value:.4g}", flush=True)


if __name__ == "__main__":  # the replays' processes import this file
    tyro.cli(main)
