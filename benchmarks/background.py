"""What the subtraction of a robot's field leaves: ``python benchmarks/background.py``.

The sensor is a board of five magnetometers on a gripper (`tests/field_rig.py`, fields by magpylib): a magnet on the
other finger, the earth's field in a turning hand, noise of 0.5 uT, and a drift. Each row fits a background to 60 s at
50 Hz and subtracts it from a motion with other phases. Figures are root mean squares over the channels in uT, of the
median of the seeds; the time is for one frame.
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np
import tyro
from field_rig import moving

import paxisim

JOINTS = ("opening", "wrist")
CASES: dict[str, tuple[tuple[str, ...], dict]] = {
    "opening and two wrist joints": (JOINTS, {}),
    "opening and the hand's quaternion": (("opening", "hand"), {}),
    "the same, 20 s": (("opening", "hand"), {"seconds": 20.0}),
    "opening alone": (("opening",), {}),
    "joints, drift of 20 uT a minute": (JOINTS, {"drift": 20.0}),
    "joints, 20 ms before the channels": (JOINTS, {"delay": 0.02}),
}


def main(seeds: int = 10) -> None:
    """Print the table.

    Args:
        seeds: Number of random seeds.
    """
    print(f"{'background':<35} {'before':>7} {'promised':>9} {'other motion':>13} {'us a frame':>11}")
    for name, (covariates, how) in CASES.items():
        rows = []
        for seed in range(seeds):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # the short motion, the delay
                background = paxisim.fit_background(moving(seed, **how), covariates)
                other = moving(1000 + seed, **(how | {"drift": 0.0}))
                left = background.apply(other).measured
                assert left is not None
            rows.append(
                [rms(background.before), rms(background.error), rms(left - left.mean(axis=0)), cost(background, other)]
            )
        before, error, left, each = np.median(rows, axis=0)
        print(f"{name:<35} {before:>7.0f} {error:>9.2f} {left:>13.2f} {each:>11.0f}")


def rms(values: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def cost(background: paxisim.Background, recording: paxisim.Recording, frames: int = 300) -> float:
    """Return the time (us) that one frame takes."""
    moments = [{name: values[k] for name, values in recording.covariates.items()} for k in range(frames)]
    began = time.perf_counter()
    for values in moments:
        background.field(values)
    return 1e6 * (time.perf_counter() - began) / frames


if __name__ == "__main__":
    tyro.cli(main)
