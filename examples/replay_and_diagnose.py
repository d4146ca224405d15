"""Record, replay, diagnose, and test the model on a held-out motion; all in simulation, without a sensor.

A stage presses a ball onto a pad. The "real sensor" is the simulation behind a chain of errors that the diagnosis does
not know: the sensor creeps, and reads 20 % too little. Needs the extra diagnose:

    python examples/replay_and_diagnose.py
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import paxisim
from paxisim.augment import AxisGain, Creep
from paxisim.cli import main as paxisim_command

HIDDEN = paxisim.Chain([Creep((0.15,), (1.0,)), AxisGain((0.8, 0.8, 0.8))])
CAUSES = ["axis_gain", "creep", "hysteresis", "low_pass", "latency", "offset"]  # searching all causes takes a minute
RATE = 20.0  # Hz
NOISE = 0.005  # N


def record(scene: paxisim.Scene, episodes: list[int]) -> paxisim.Recording:
    """Return what a robot would record: the motion of the stage and the readings of the sensor.

    Args:
        scene: Scene of the stage.
        episodes: Indices of the protocol's episodes.
    """
    motion = paxisim.protocol("press").unrecorded(scene).select(episodes)
    felt = scene.simulate(motion).resample(RATE).select(known=True)
    rng = np.random.default_rng(0)
    parts = []
    for episode in felt.episodes():  # each starts at rest
        read = HIDDEN.run(episode.simulated.astype(float), episode.time)
        parts.append(read + rng.normal(0, NOISE, read.shape))
    return replace(felt, measured=np.concatenate(parts).astype(np.float32), simulated=None)


def main() -> None:
    """Run the loop once."""
    grid = ["--rows", "3", "--cols", "3", "--pitch-mm", "8"]
    paxisim_command(["scene", "make", "indenter", *grid, "-o", "stage.toml", "--force"])  # as in the shell
    scene = paxisim.Scene.load("stage.toml")
    recorded = record(scene, [0, 1])
    recorded.save("recorded.mcap")
    print(recorded)

    paired = scene.simulate(recorded)  # as `paxisim replay` does
    print(paxisim.compare_streams(paired))

    found = paxisim.diagnose(paired, CAUSES)
    print(found)
    found.save("diagnosis")  # diagnosis/report.html

    unseen = scene.simulate(record(scene, [2]))
    corrected = found.model.run(unseen.simulated.astype(float), unseen.time)
    before, after = (np.sqrt(np.mean((unseen.measured - stream) ** 2)) for stream in (unseen.simulated, corrected))
    print(f"\nerror on a motion that the fit has not seen: {before:.3f} N, through the model {after:.3f} N")


if __name__ == "__main__":
    main()
