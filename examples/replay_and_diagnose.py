"""Record, replay, diagnose, and check the model on a motion that it has not seen; all in simulation, without a port.

A stage presses a ball on a pad. "The real sensor" is the simulation behind a chain with an error that the diagnosis
does not know: it creeps, and reads 20 % too little. Needs the extra diagnose:

    python examples/replay_and_diagnose.py
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import paxisim
from paxisim.augment import AxisGain, Creep
from paxisim.cli import main as paxisim_command

HIDDEN = paxisim.Chain([Creep((0.15,), (1.0,)), AxisGain((0.8, 0.8, 0.8))])
CAUSES = ["axis_gain", "creep", "hysteresis", "low_pass", "latency", "offset"]  # all of them take a minute
RATE = 20.0  # Hz
NOISE = 0.005  # N


def record(scene: paxisim.Scene, episodes: list[int]) -> paxisim.Recording:
    """What a robot would record: the stage's motion and what the sensor measures.

    Args:
        scene: The stage.
        episodes: Numbers of the protocol's episodes.
    """
    motion = paxisim.protocol("press").unrecorded(scene).select(episodes)
    felt = scene.simulate(motion).resample(RATE).select(known=True)
    rng = np.random.default_rng(0)
    parts = []
    for episode in felt.episodes():  # each begins at rest
        read = HIDDEN.run(episode.simulated.astype(float), episode.time)
        parts.append(read + rng.normal(0, NOISE, read.shape))
    return replace(felt, measured=np.concatenate(parts).astype(np.float32), simulated=None)


def main() -> None:
    """The loop, once."""
    grid = ["--rows", "3", "--cols", "3", "--pitch-mm", "8"]
    paxisim_command(["scene", "make", "indenter", *grid, "-o", "stage.toml", "--force"])  # as in the shell
    scene = paxisim.Scene.load("stage.toml")
    recorded = record(scene, [0, 1])
    recorded.save("recorded.mcap")
    print(recorded)

    paired = scene.simulate(recorded)  # what `paxisim replay` does
    print(paxisim.compare_streams(paired))

    found = paxisim.diagnose(paired, CAUSES)
    print(found)
    found.save("diagnosis")  # diagnosis/report.html

    unseen = scene.simulate(record(scene, [2]))
    corrected = found.model.run(unseen.simulated.astype(float), unseen.time)
    before, after = (np.sqrt(np.mean((unseen.measured - stream) ** 2)) for stream in (unseen.simulated, corrected))
    print(f"\nerror on a motion that no fit has seen: {before:.3f} N, through the model {after:.3f} N")


if __name__ == "__main__":
    main()
