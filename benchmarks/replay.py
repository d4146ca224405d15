"""How well and how fast a recorded motion is replayed, and what a diagnosis then names.

    python benchmarks/replay.py [--rigs 10]

An indenter on one pad of 6x5 taxels is moved by servos in MuJoCo: that is the real stage. Its joints are recorded in
encoder steps of 0.05 mm at 100 Hz, its sensor reads 0.8 of the force 80 ms late, with 0.02 N of noise. The recording is
replayed in the default mode, whose forces are compared with those of the stage, and diagnosed.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "scene"))

from rigs import LAYOUT, press, recording, simulated_press, steps_of, total, with_servos

import paxisim
from paxisim.scene import ready

HIDDEN = paxisim.Chain([paxisim.augment.AxisGain((0.8, 0.8, 0.8)), paxisim.augment.Latency(0.08)])
EPISODES = 6


def rig(seed: int) -> tuple[paxisim.Recording, np.ndarray]:
    """A recording of the stage, and the forces on its pad."""
    rng = np.random.default_rng(seed)
    scene = ready.indenter(LAYOUT)
    parts, forces = [], []
    for number in range(EPISODES):
        time, streams = press(depth=rng.uniform(1.0e-3, 1.8e-3))
        streams = {"x": streams["x"] * rng.uniform(-1, 1), "y": streams["y"] * rng.uniform(-1, 1), **_rest(streams)}
        force, joints = simulated_press(with_servos(scene), time, streams)
        read = HIDDEN.run(force, time) + rng.normal(0, 0.02, force.shape)
        covariates = dict(zip(streams, steps_of(joints).T, strict=True))
        episode = np.full(len(time), number)
        parts.append(recording(time, covariates, measured=read.astype(np.float32), episode=episode))
        forces.append(force)
    return paxisim.Recording.concatenate(parts), np.concatenate(forces)


def _rest(streams: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: values for name, values in streams.items() if name not in ("x", "y")}


def main() -> None:
    """Print a line for each rig."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rigs", type=int, default=10, help="how many are drawn (seeds 0, 1, ...)")
    arguments = parser.parse_args()
    scene = ready.indenter(LAYOUT)
    exact = 0
    for seed in range(arguments.rigs):
        given, force = rig(seed)
        began = perf_counter()
        paired = scene.simulate(given)
        seconds = perf_counter() - began
        off = total(paired.simulated).max() / total(force).max() - 1
        said = any("encoder" in note for note in paired.metadata["replay"]["notes"])
        found = paxisim.diagnose(replace(paired, episode=given.episode))
        names = sorted(cause.name for cause in found.causes)
        exact += names == ["axis_gain", "latency"]
        peak = f"peak of the total force {off:+.1%}{' (said)' if said else ''}"
        time = f"{len(given.time) / 100:.0f} s replayed in {seconds:.1f} s"
        print(f"rig {seed}: {peak}; {time}; {found.verdict}: {', '.join(names)}", flush=True)
    print(f"axis_gain and latency, and nothing else: {exact} of {arguments.rigs}")


if __name__ == "__main__":
    main()
