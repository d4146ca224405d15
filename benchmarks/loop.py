"""Diagnosis in the sim-to-real loop, on randomly drawn sensors: ``python benchmarks/loop.py``.

The arm of ``examples/simulated_arm.py`` presses for 46 s, without the port and the clock of the example. Its sensor has
a random gain of 0.6 to 1.3 and a random creep of 8 to 25 % with a time constant of 0.5 to 3 s. The sensor reads noisy
counts of 0.1 N, and the arm's joints have encoder steps. The recording is replayed and pooled to 3x2 taxels. Its first
32 s are diagnosed with all causes; the rest is held out.
"""

from __future__ import annotations

import os
import runpy
import tempfile
import warnings
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import numpy as np
import tyro

import paxisim
from paxisim.augment import AxisGain, Creep

EXAMPLE = Path(__file__).parents[1] / "examples" / "simulated_arm.py"
DIAGNOSED, SECONDS, RATE = 32, 46, 25
LAYOUT = paxisim.load_profile("gen2-box-120").layout


def paired(sensor: paxisim.Chain) -> paxisim.Recording:
    """Return the arm's sensor readings paired with the replay of its joints."""
    example = runpy.run_path(str(EXAMPLE))
    arm = example["Arm"](LAYOUT, sensor)
    time = np.arange(1, RATE * SECONDS + 1) / RATE
    forces, joints = [], []
    for now in time:
        arm.run_until(now)
        forces.append(arm.reading)
        joints.append(list(arm.measured_joints().values()))
    counts = np.round(np.array(forces) / 0.1)
    counts[:, :, 2] = np.maximum(counts[:, :, 2], 0)
    recording = paxisim.Recording(
        time,
        (0.1 * counts).astype(np.float32),
        covariates=dict(zip(example["JOINTS"], np.transpose(joints), strict=True)),
        episode=np.array([example["press_at"](now)[0] for now in time]),
        layout=LAYOUT,
    )
    drives = [paxisim.Drive(name, joint=name, unit="rad", resolution=example["ENCODER"]) for name in example["JOINTS"]]
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "arm.xml"
        scene.write_text(arm.spec.to_xml(), encoding="utf-8")
        return paxisim.Scene(scene, drives).simulate(recording, modulus=example["MODULUS"]).pool(4, 5)


def main(sensors: int = 10, seed: int = 0) -> None:
    """Print a row for each sensor.

    Args:
        sensors: Number of sensors to draw.
        seed: Random seed of the sensors.
    """
    warnings.simplefilter("ignore")
    rng, exact = np.random.default_rng(seed), 0
    print(" gain  creep  tau (s)  held-out error (N)  named")
    for _ in range(sensors):
        gain, creep, tau = rng.uniform(0.6, 1.3), rng.uniform(0.08, 0.25), np.exp(rng.uniform(np.log(0.5), np.log(3)))
        loop = paired(paxisim.Chain([Creep((creep,), (tau,)), AxisGain((gain,) * 3)]))
        found = paxisim.diagnose(loop[loop.time < DIAGNOSED])
        later = loop[loop.time >= DIAGNOSED]
        before, after = (
            float(np.sqrt(np.mean((later.measured - prediction) ** 2)))
            for prediction in (later.simulated, found.model.run(later.simulated.astype(float), later.time))
        )
        named = sorted(cause.name for cause in found.causes)
        exact += named == ["axis_gain", "creep"]
        print(f"{gain:5.2f}  {creep:4.0%} {tau:8.1f}     {before:.3f} -> {after:.3f}    {', '.join(named)}", flush=True)
    print(f"exactly both named: {exact} of {sensors}")


if __name__ == "__main__":
    tyro.cli(main)
