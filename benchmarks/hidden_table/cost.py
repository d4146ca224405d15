"""Cost: time and memory of a diagnosis against the length of a recording and its number of taxels."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from hidden.cases import again, make

SIZES = ((6, 5, 1), (6, 5, 2), (6, 5, 5), (6, 5, 20), (8, 6, 2), (12, 10, 2), (12, 10, 5), (12, 10, 20))
"""Rows, columns and minutes; two pads at 100 Hz."""
TARGET = (6, 5, 2)
RATE = 100.0
CAUSES = ("creep", "axis_gain")
MEASURE = Path(__file__).with_name("measure.py")


def costs(seed: int, jobs: int, sizes: tuple[tuple[int, int, int], ...] = SIZES) -> None:
    """Print the cost of each size, measured in a fresh process to separate the memory."""
    print(f"\ncost of a diagnosis: two pads at {RATE:.0f} Hz, {' and '.join(CAUSES)} hidden, jobs {jobs}")
    print("  rows x cols  minutes   samples  channels  seconds  memory (GB)  named")
    for rows, cols, minutes in sizes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "recording.npz"
            write(path, rows, cols, minutes, seed)
            command = [sys.executable, str(MEASURE), str(path), str(jobs)]
            done = subprocess.run(command, capture_output=True, text=True, env=dict(os.environ))
        if done.returncode:
            print(
                f"  {rows:>4} x {cols:<4} {minutes:>8}   failed: {(done.stderr.strip() or 'killed').splitlines()[-1]}"
            )
            continue
        row = json.loads(done.stdout.splitlines()[-1])
        target = "  (target: 60 s on 2 cores, 2 GB)" if (rows, cols, minutes) == TARGET else ""
        print(
            f"  {rows:>4} x {cols:<4} {minutes:>8} {row['samples']:>9} {row['channels']:>9} {row['seconds']:>8.1f} "
            f"{row['memory']:>12.2f}  {', '.join(row['named']) or 'nothing'}{target}",
            flush=True,
        )


def write(path: Path, rows: int, cols: int, minutes: int, seed: int) -> None:
    """Write a recording, made eight episodes at a time; all of it at the generator's 500 Hz would exceed the memory."""
    case = make(CAUSES, seed=seed, rows=rows, cols=cols, strength=0.7, rate=RATE)
    parts, frames = [case], len(case.time)
    while frames < minutes * 60 * RATE:
        parts.append(again(parts[-1], ["varied"], seed=seed + len(parts)))
        frames += len(parts[-1].time)
    keep = round(minutes * 60 * RATE)
    episode = np.concatenate([part.episode + 8 * number for number, part in enumerate(parts)])[:keep]
    arrays = {n: np.concatenate([getattr(p, n) for p in parts])[:keep] for n in ("time", "measured", "simulated")}
    covariates = {n: np.concatenate([p.covariates[n] for p in parts])[:keep] for n in case.covariates}
    np.savez(path, episode=episode, **arrays, **covariates)
