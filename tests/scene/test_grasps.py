"""A hand that grasps, carries and grasps again: what a replay does when its object is lost, and what it says."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scene.rigs import path, total

import paxisim
from paxisim import Drive, InvalidValueError, ObjectStart, Recording, Scene, TaxelLayout
from paxisim.cli import main

LAYOUT = TaxelLayout(3, 3, (5e-3, 5e-3))
JOINTS = ("along", "lift", "left", "right")
HAND = """
<mujoco>
  <option timestep="0.002" cone="elliptic" impratio="10" integrator="implicitfast"/>
  <default><joint type="slide" armature="1"/><position kp="8000" dampratio="1"/></default>
  <worldbody>
    <geom name="table" type="box" size="0.2 0.2 0.01" pos="0 0 -0.01"/>
    <body name="cart" pos="0 0 0.02"><joint name="along" axis="0 1 0"/><geom size="0.01" pos="0 0 0.1"/>
      <body name="hand"><joint name="lift" axis="0 0 1"/><geom size="0.01" pos="0 0 0.1"/>
        <body name="left" pos="-0.04 0 0">
          <joint name="left" axis="1 0 0"/><geom type="box" size="0.005 0.01 0.01"/>
        </body>
        <body name="right" pos="0.04 0 0">
          <joint name="right" axis="-1 0 0"/><geom type="box" size="0.005 0.01 0.01"/>
        </body>
      </body>
    </body>
    <body name="box" pos="0 0 0.02"><freejoint/><geom type="box" size="0.015 0.015 0.02" mass="0.1"/></body>
  </worldbody>
  <actuator>
    <position joint="along"/><position joint="lift"/><position joint="left"/><position joint="right"/>
  </actuator>
</mujoco>
"""
MOUNTS = [
    paxisim.Mount("left", pos=(0.005, 0, 0), quat=(0.5, 0.5, -0.5, -0.5), replaces=(0,), name="left"),
    paxisim.Mount("right", pos=(-0.005, 0, 0), quat=(0.5, 0.5, 0.5, 0.5), replaces=(0,), name="right"),
]
SECONDS, RATE = 12.0, 50


@pytest.fixture(scope="module")
def mjcf():
    return paxisim.attach(HAND, paxisim.Pad(LAYOUT), MOUNTS).to_xml()


@pytest.fixture(scope="module")
def carried(mjcf):
    """The box is grasped, carried 30 mm along, put down, and grasped again there."""
    model = mujoco.MjModel.from_xml_string(mjcf)
    pads = paxisim.find_pads(model)
    paxisim.Gel().apply(model, pads)
    data, readout = mujoco.MjData(model), paxisim.TactileReadout(model, pads)
    steps = np.arange(round(SECONDS / model.opt.timestep)) * model.opt.timestep
    grip = path(steps, [0, 1, 5, 6, 7, 8, 10.5, 11.5, 12], [0, 1, 1, 0, 0, 1, 1, 0, 0]) * 0.0205
    lift = path(steps, [0, 1.5, 2.2, 3.8, 4.5, 12], [0, 0, 1, 1, 0, 0]) * 0.03
    along = path(steps, [0, 2.3, 3.7, 12], [0, 0, 1, 1]) * 0.03
    forces, joints = [], []
    for k in range(len(steps)):
        data.ctrl[:] = along[k], lift[k], grip[k], grip[k]
        if k % 10 == 0:
            mujoco.mj_forward(model, data)
            forces.append(readout.read(data))
            joints.append([float(data.joint(name).qpos[0]) for name in JOINTS])
        mujoco.mj_step(model, data)
    assert data.body("box").xpos[1] == pytest.approx(0.03, abs=1e-3)
    streams = dict(zip(JOINTS, np.transpose(joints), strict=True))
    return Recording(steps[::10], np.array(forces), covariates=streams, layout=LAYOUT, pads=("left", "right"))


@pytest.fixture(scope="module")
def scene(mjcf):
    drives = tuple(Drive(name, joint=name, unit="m") for name in JOINTS)
    return Scene(mjcf, drives, closing="left", start=(ObjectStart("box", (0, 0, 0.02)),))


def test_what_the_scene_lost_is_left_out_and_the_next_grasp_finds_the_object_where_it_was_carried(scene, carried):
    assert partings(scene.simulate(carried)) == []
    slippery = scene.simulate(carried, friction=0.02)
    how = slippery.metadata["replay"]
    assert len(partings(slippery)) == 1
    assert "loses the object in the scene" in how["doubts"][0]
    lost = np.isnan(slippery.simulated).any(axis=(1, 2, 3, 4))
    assert how["in_doubt"] == pytest.approx(lost.mean())
    assert 1.0 < carried.time[lost].min() < 4.5  # from the lift to the end of the first grasp
    assert carried.time[lost].max() < 7
    held = (carried.time > 8.5) & (carried.time < 10)
    ratio = total(slippery.simulated)[held].mean() / total(carried.measured)[held].mean()
    assert ratio == pytest.approx(1, abs=0.03)
    # the sensor's own faults are no doubt: gain, latency, offset and creep
    for sensor in (
        paxisim.augment.AxisGain((0.4, 0.4, 0.4)),
        paxisim.augment.Latency(0.1),
        paxisim.augment.Offset(np.full((2, 3, 3, 3), 0.1)),
        paxisim.augment.Creep((0.4,), (2.0,)),
    ):
        read = np.asarray(sensor.run(carried.measured.astype(float), carried.time), np.float32)
        assert partings(scene.simulate(replace(carried, measured=read))) == [], sensor


def partings(paired):
    return [doubt for doubt in paired.metadata["replay"]["doubts"] if "pressed on" not in doubt]


def test_while_the_object_in_the_hand_is_pressed_on_the_table_the_replay_is_in_doubt(scene, carried):
    # it sags in the hand, so putting it down where it was taken presses it on the table until the hand opens at 5 s
    paired = scene.simulate(carried)
    assert [doubt.partition(": ")[2] for doubt in paired.metadata["replay"]["doubts"]] == [
        "what the hand holds is pressed on something else"
    ]
    pressed = carried.time[np.isnan(paired.simulated).all(axis=(1, 2, 3, 4))]
    assert 4.2 < pressed.min() < 4.6
    assert 5.1 < pressed.max() < 6
    # from 2.2 to 3.8 s it hangs in the hand, and at first it stands on the table with its weight
    assert paired.metadata["replay"]["in_doubt"] == pytest.approx(len(pressed) / len(carried))
    # pressed harder, as by a lift that is 0.3 mm lower, more of the shear is the table's
    lower = carried.with_covariate("lift", carried.covariates["lift"] - 3e-4 * (carried.time > 4))
    assert scene.simulate(lower).metadata["replay"]["in_doubt"] >= paired.metadata["replay"]["in_doubt"]
    # without weight or table there is nothing to press on
    space = replace(scene, mjcf=mujoco_without_table(scene.mjcf))
    assert "pressed on" not in str(space.simulate(carried).metadata["replay"]["doubts"])


def mujoco_without_table(mjcf):
    spec = mujoco.MjSpec.from_string(mjcf)
    spec.delete(spec.geom("table"))
    spec.option.gravity = [0, 0, 0]
    return spec.to_xml()


def test_a_closing_is_fitted_to_each_grasp(scene, carried):
    second = carried.time > 6.5
    drifted = carried.with_covariate("left", carried.covariates["left"] - np.where(second, 2e-4, 1e-4))
    fitted = replace(scene, mode="fitted").simulate(drifted)
    assert fitted.metadata["replay"]["closing"]["0"] == pytest.approx([1e-4, 2e-4], abs=1e-5)
    assert paxisim.compare_streams(fitted).force_ratio == pytest.approx(1, abs=0.02)
    # a force that is already there at the next sample does not tell how deep the fingers are
    with pytest.raises(InvalidValueError, match=r"episode 0: .*closing"):
        replace(scene, mode="shape").simulate(drifted[::15])


def test_the_mode_is_chosen_by_what_the_opening_determines(scene, carried):
    auto = replace(scene, mode="auto")
    soft = auto.simulate(carried).metadata["replay"]
    assert (soft["mode"], soft["notes"]) == ("kinematic", [])
    stiff = auto.simulate(carried, modulus=4e5).metadata["replay"]
    assert stiff["mode"] == "fitted"
    # 0.025 mm on 9 springs of 400 kPa * 25 mm2 / 3.3 mm
    assert "0.025 mm" in stiff["notes"][0]
    assert f"by {4e5 * 25e-6 / 3.3e-3 * 9 * 25e-6:.2g} N" in stiff["notes"][0]

    coarse = replace(auto, drives=[replace(d, resolution=2e-4) for d in scene.drives])
    assert coarse.simulate(carried).metadata["replay"]["mode"] == "fitted"
    assert replace(auto, closing="").simulate(carried).metadata["replay"]["mode"] == "kinematic"


def test_fingers_that_give_way_behind_their_joints_are_fitted(mjcf, scene, carried):
    spec = mujoco.MjSpec.from_string(mjcf)
    for name, axis in (("left", [1, 0, 0]), ("right", [-1, 0, 0])):
        spec.body(name).add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, stiffness=2e4, damping=50)
    springy = replace(scene, mjcf=spec.to_xml(), mode="auto").simulate(carried).metadata["replay"]
    assert springy["mode"] == "fitted"
    peak = total(carried.measured).max() / 2
    given = re.search(r"([\d.]+) mm, by which the fingers give way under load", springy["notes"][0])
    assert 1e-3 * float(given[1]) == pytest.approx(peak / 2e4, rel=0.1)


def test_a_diagnosis_repeats_the_doubt_and_explains_nothing_where_most_is_in_doubt(scene, carried, tmp_path, capsys):
    lossy = np.asarray(paxisim.augment.Latency(0.06).run(carried.measured.astype(float), carried.time), np.float32)
    lossy += np.random.default_rng(0).normal(0, 0.01, lossy.shape).astype(np.float32)
    slippery = scene.simulate(replace(carried, measured=lossy), friction=0.02)
    found = paxisim.diagnose(slippery, causes=["latency"])
    assert "the replay is in doubt in" in found.symptoms.warnings[0]
    assert "loses the object in the scene" in found.symptoms.warnings[0]
    metadata = {**slippery.metadata, "replay": {**slippery.metadata["replay"], "in_doubt": 0.7}}
    assert paxisim.diagnose(replace(slippery, metadata=metadata), causes=["latency"]).verdict == "partly_explained"
    replace(carried, measured=lossy).save(tmp_path / "carried.npz")
    replace(scene, gel=paxisim.Gel(friction=0.02)).save(tmp_path / "scene.toml")
    arguments = [tmp_path / "carried.npz", "--scene", tmp_path / "scene.toml", "-o", tmp_path / "paired.npz"]
    assert main(["replay", *map(str, arguments)]) == 0
    printed = capsys.readouterr().out
    assert "In doubt, and left out:" in printed
    assert "loses the object in the scene" in printed
