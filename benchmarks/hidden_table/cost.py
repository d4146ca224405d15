"""Cost: time and memory of a diagnosis against the length of a recording and its number of taxels."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import harness  # noqa: F401  # makes the generator importable
import numpy as np
from hidden.cases import again, make

from paxisim.recording import Recording

SIZES = ((6, 5, 1), (6, 5, 2), (6, 5, 5), (6, 5, 20), (8, 6, 2), (12, 10, 2), (12, 10, 5), (12, 10, 20))
"""Rows, columns and minutes; two pads at 100 Hz."""
RATE = 100.0
CAUSES = ("creep", "axis_gain")
MEASURE = """
import json, resource, sys, time, paxisim
recording = paxisim.Recording.load(sys.argv[1])
begin = time.perf_counter()
found = paxisim.diagnose(recording, jobs=int(sys.argv[2]))
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
print(json.dumps([time.perf_counter() - begin, memory, [cause.name for cause in found.causes]]))
"""


def costs(seed: int, jobs: int, sizes: tuple[tuple[int, int, int], ...] = SIZES) -> None:
    """Print the cost of each size, measured in a fresh process to separate the memory."""
    print(f"\ncost of a diagnosis: two pads at {RATE:.0f} Hz, {' and '.join(CAUSES)} hidden, jobs {jobs}")
    print("  rows x cols  minutes  seconds  memory (GB)  named")
    for rows, cols, minutes in sizes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "recording.npz"
            recorded(rows, cols, minutes, seed).save(path)
            command = [sys.executable, "-c", MEASURE, str(path), str(jobs)]
            done = subprocess.run(command, capture_output=True, text=True)
        start = f"  {rows:>4} x {cols:<4} {minutes:>8}"
        if done.returncode:
            print(f"{start}  failed: {(done.stderr.strip() or 'killed').splitlines()[-1]}", flush=True)
        else:
            seconds, memory, named = json.loads(done.stdout.splitlines()[-1])
            print(f"{start} {seconds:>8.1f} {memory:>12.2f}  {', '.join(named) or 'nothing'}", flush=True)


def recorded(rows: int, cols: int, minutes: int, seed: int) -> Recording:
    """Return a recording, made eight episodes at a time: at the generator's 500 Hz, all of it exceeds the memory."""
    parts = [make(CAUSES, seed=seed, rows=rows, cols=cols, strength=0.7, rate=RATE)]
    while sum(len(part.time) for part in parts) < minutes * 60 * RATE:
        parts.append(again(parts[-1], seed=seed + len(parts)))
    joined = [np.concatenate([getattr(p, n) for p in parts]) for n in ("time", "measured", "simulated")]
    covariates = {n: np.concatenate([p.covariates[n] for p in parts]) for n in parts[0].covariates}
    episode = np.concatenate([part.episode + 8 * number for number, part in enumerate(parts)])
    return Recording(*joined, covariates, episode)[: round(minutes * 60 * RATE)]
