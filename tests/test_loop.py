"""The core of the loop: a recording is replayed, what is hidden in its sensor is named, and the model is used."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("serial")
pytest.importorskip("termios")  # for the example's emulator

import paxisim
from paxisim.augment import AxisGain, Creep

EXAMPLE = Path(__file__).parents[1] / "examples" / "simulated_arm.py"
HIDDEN = paxisim.Chain([Creep((0.15,), (1.0,)), AxisGain((0.7, 0.7, 0.7))])
DIAGNOSED, SECONDS, RATE = 32, 46, 25


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    """The arm's motion, with what its sensor reads in counts of 0.1 N, and the replay of it."""
    example = runpy.run_path(str(EXAMPLE))
    arm = example["Arm"](HIDDEN)
    time = np.arange(1, RATE * SECONDS + 1) / RATE
    forces, joints = [], []
    for now in time:
        arm.run_until(now)
        forces.append(arm.force)
        joints.append(list(arm.measured_joints().values()))
    counts = np.round(np.array(forces) / 0.1)
    counts[:, :, 2] = np.maximum(counts[:, :, 2], 0)
    recording = paxisim.Recording(
        time,
        (0.1 * counts).astype(np.float32),
        covariates=dict(zip(example["JOINTS"], np.transpose(joints), strict=True)),
        episode=np.array([example["press_at"](now)[0] for now in time]),
        layout=paxisim.load_profile(example["PROFILE"]).layout,
    )
    scene = tmp_path_factory.mktemp("loop") / "arm.xml"
    scene.write_text(arm.spec.to_xml(), encoding="utf-8")
    drives = [paxisim.Drive(name, joint=name, unit="rad", resolution=example["ENCODER"]) for name in example["JOINTS"]]
    return paxisim.Scene(scene, drives).simulate(recording, modulus=example["MODULUS"]).pool(4, 5)


@pytest.mark.timeout(300)
def test_gain_and_creep_are_named_and_their_model_predicts_another_motion(loop, monkeypatch):
    for name in ("sklearn", "sklearn.ensemble"):  # no black box: slow, and it names nothing
        monkeypatch.setitem(sys.modules, name, None)
    found = paxisim.diagnose(loop[loop.time < DIAGNOSED])
    named = {cause.name: {p.name: p.value.value for p in cause.parameters} for cause in found.causes}
    assert set(named) == {"axis_gain", "creep"}
    assert named["creep"]["amplitude"] == pytest.approx(0.15, abs=0.04)

    later = loop[loop.time >= DIAGNOSED]
    before, after = (
        np.sqrt(np.mean((later.measured - prediction) ** 2))
        for prediction in (later.simulated, found.model.run(later.simulated.astype(float), later.time))
    )
    assert after < 0.5 * before
