"""Replayed forces compared with MuJoCo's own, in every mode."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scene.rigs import LAYOUT, press, recording, simulated_press, squeezed, steps_of, total, with_servos

import paxisim
from paxisim import Drive, InvalidValueError, ObjectStart, Scene
from paxisim.scene import ready
from paxisim.scene.modes import MODES

NAMES = ("x", "y", "depth")
INDENTER = ready.indenter(LAYOUT)
GRIPPER = ready.gripper(LAYOUT, peg=True)
FINGERS = tuple(Drive(side, joint=f"gripper_{side}_slide", unit="m") for side in ("left", "right"))


@pytest.fixture(scope="module")
def pressed():
    """A press of the indenter that MuJoCo simulates with servos; holds commands and true positions."""
    time, streams = press()
    force, joints = simulated_press(with_servos(INDENTER), time, streams)
    covariates = dict(zip(NAMES, joints.T, strict=True)) | {f"{name} command": streams[name] for name in NAMES}
    return recording(time, covariates, measured=force)


@pytest.fixture(scope="module")
def gripped():
    """The gripper squeezes the peg with its motor."""
    time, force, joints, motor = squeezed(str(GRIPPER.mjcf))
    free, left, right = joints[:, :7], joints[:, 7], joints[:, 8]
    covariates = {"left": left, "right": right, "motor": motor, "peg": free}
    return recording(time, covariates, measured=force)


def worst(replayed):
    """Return the largest error of a taxel as a fraction of the largest reading of a taxel."""
    return np.abs(replayed.simulated - replayed.measured).max() / np.abs(replayed.measured).max()


def test_exact_poses_give_the_forces_of_the_simulation_that_they_are_from(pressed):
    replayed = INDENTER.simulate(pressed)
    assert worst(replayed) < 0.01
    assert np.abs(replayed.measured).max() > 3


def test_writing_positions_alone_gives_a_fraction_of_the_force(pressed):
    """This is why replay does more than `mj_forward`, which gives 2 N instead of 16 N."""
    model = mujoco.MjModel.from_xml_string(str(INDENTER.mjcf))
    pads = paxisim.find_pads(model)
    paxisim.Gel().apply(model, pads)
    data, readout, forces = mujoco.MjData(model), paxisim.TactileReadout(model, pads), []
    for row in zip(*(pressed.covariates[name] for name in NAMES), strict=True):
        data.qpos[:] = row
        mujoco.mj_forward(model, data)
        forces.append(readout.read(data))
    assert total(np.array(forces)).max() < 0.2 * total(pressed.measured).max()


@pytest.mark.parametrize(("timestep", "cone"), [(0.001, "pyramidal"), (0.004, "elliptic")])
def test_another_timestep_and_cone_give_these_forces_to_5_percent(pressed, timestep, cone):
    option = f'<option timestep="{timestep}" cone="{cone}" impratio="10"/>'
    other = re.sub("<option [^>]*>", option, str(INDENTER.mjcf))
    assert option in other
    assert worst(replace(INDENTER, mjcf=other).simulate(pressed)) < 0.05


def test_an_object_between_prescribed_fingers_is_free_or_follows_its_recorded_pose(gripped):
    pose = Scene(GRIPPER.mjcf, (*FINGERS, Drive("peg", body="peg", unit="m")))
    scene = Scene(GRIPPER.mjcf, FINGERS, start=[ObjectStart("peg", stream="peg")])
    for replayed in (pose.simulate(gripped), scene.simulate(gripped)):
        off = np.abs(total(replayed.simulated) - total(replayed.measured))
        assert np.percentile(off, 99) < 0.01 * total(gripped.measured).max()
    # the first touch is faster than samples 10 ms apart can resolve
    assert off.max() < 0.1 * total(gripped.measured).max()


def test_the_force_of_a_motor(gripped):
    drives = (*FINGERS, Drive("motor", actuator="gripper_close", unit="N"))
    scene = Scene(GRIPPER.mjcf, drives, mode="force", start=[ObjectStart("peg", stream="peg")])
    replayed = scene.simulate(gripped)
    assert [drive.stream for drive in scene.prepare(gripped).rig.unused] == ["left", "right"]
    late = gripped.time > 2.0  # the replay starts the fingers at rest, although they were moving
    assert np.abs(replayed.simulated - replayed.measured)[late].max() < 0.01 * np.abs(gripped.measured).max()


def test_servos_follow_commands_as_they_did_and_recorded_positions_with_a_lag(pressed):
    drives = tuple(Drive(f"{name} command", actuator=name, unit="m") for name in NAMES)
    assert worst(Scene(with_servos(INDENTER), drives, mode="servo").simulate(pressed)) < 0.01
    followed = replace(INDENTER, mjcf=with_servos(INDENTER), mode="servo").simulate(pressed)
    assert worst(followed) > 0.1
    assert followed.metadata["replay"]["not_testable"] == dict(MODES["servo"].not_testable)
    assert {"axis_gain", "latency", "low_pass"} <= set(MODES["servo"].not_testable)
    with pytest.raises(InvalidValueError, match="no position actuator moves joint 'x'"):
        replace(INDENTER, mode="servo").simulate(pressed)


def test_a_fitted_closing_finds_an_offset_and_says_what_it_hides(pressed):
    off = pressed.with_covariate("depth", pressed.covariates["depth"] - 1e-4)
    assert worst(INDENTER.simulate(off)) > 0.3
    fitted = replace(INDENTER, mode="fitted").simulate(off)
    assert worst(fitted) < 0.01
    assert fitted.metadata["replay"]["closing"]["0"] == pytest.approx([1e-4, 1e-4], abs=2e-6)  # in each grasp
    assert "axis_gain" in fitted.metadata["replay"]["not_testable"]


@pytest.mark.parametrize(
    "offset", [-3e-4, *(pytest.param(offset, marks=pytest.mark.slow) for offset in (-1e-4, 1e-4, 3e-4))]
)
def test_the_course_of_the_force_tells_where_the_object_lies_whatever_the_gain(pressed, offset):
    sensor = paxisim.Chain([paxisim.augment.AxisGain((0.7, 0.7, 0.7)), paxisim.augment.Latency(0.04)])
    noise = np.random.default_rng(0).normal(0, 0.02, pressed.measured.shape)
    read = replace(pressed, measured=sensor.run(pressed.measured.astype(float), pressed.time) + noise)
    off = read.with_covariate("depth", pressed.covariates["depth"] - offset)
    shaped = replace(INDENTER, mode="shape").simulate(off)
    how = shaped.metadata["replay"]
    assert how["closing"]["0"] == pytest.approx([offset, offset], abs=2.5e-5)
    assert "axis_gain" not in how["not_testable"]
    assert "stiffening" in how["not_testable"]
    # the gain can be told apart from the depth
    peaks = total(read.measured).max(), total(shaped.simulated).max()
    assert peaks[0] / peaks[1] == pytest.approx(0.7, abs=0.05)


def test_a_fitted_closing_that_is_not_there(pressed):
    far = pressed.with_covariate("depth", pressed.covariates["depth"] - 0.02)
    with pytest.raises(InvalidValueError, match="episode 0: no closing of up to 3 mm"):
        replace(INDENTER, mode="fitted").simulate(far)
    free = recording(pressed.time, {name: pressed.covariates[name] for name in NAMES})
    for mode in ("fitted", "shape"):
        notes = replace(INDENTER, mode=mode).simulate(free).metadata["replay"]["notes"]
        assert notes == ["episode 0: the mean force is only 0.000 N, so the closing was left as recorded"]


def test_a_mocap_body_is_felt_as_a_joint_is(pressed):
    """MuJoCo itself gives a mocap body no velocity, hence neither damping nor friction."""
    body = re.search('<body name="ball".*?</body>', str(INDENTER.mjcf), re.DOTALL).group()
    mocap = re.sub("<joint [^>]*>", "", body).replace('name="ball"', 'name="ball" mocap="true"', 1)
    place = np.column_stack([pressed.covariates[name] for name in NAMES]) * [1, -1, -1] + [0, 0, ready.BALL]
    moved = pressed.with_covariate("stage", 1e3 * place)
    scene = Scene(str(INDENTER.mjcf).replace(body, mocap), [Drive("stage", body="ball", unit="mm")])
    assert worst(scene.simulate(moved)) < 0.01


def test_encoder_steps_are_smoothed_and_what_they_are_worth_is_said(pressed):
    def read(step=5e-5):
        streams = {name: steps_of(pressed.covariates[name], step) for name in NAMES}
        return recording(pressed.time, streams, measured=pressed.measured)

    smoothed = INDENTER.simulate(read())
    said = smoothed.metadata["replay"]
    assert said["encoder_steps"] == pytest.approx(dict.fromkeys(NAMES, 5e-5))
    # at 1.7 mm the gel stiffens: 0.1 mm changes the force by 9 N, as in the test of a fitted closing
    assert 0.1 < said["encoder_error"]["newtons"] / said["encoder_error"]["peak"] < 0.3
    assert "positions alone do not determine the total force to 10%" in said["notes"][0]
    as_read = tuple(replace(drive, resolution=0.0) for drive in INDENTER.drives)
    rough = replace(INDENTER, drives=as_read).simulate(read())
    moving = np.abs(np.gradient(pressed.covariates["depth"], pressed.time)) > 1e-3
    off = [
        (total(one.simulated) - total(one.measured))[moving & (total(one.measured) < 5)] for one in (smoothed, rough)
    ]
    assert np.std(off[0]) < 0.5 * np.std(off[1])
    said = INDENTER.simulate(read(2e-6)).metadata["replay"]
    assert said["encoder_error"]["newtons"] < 0.02 * said["encoder_error"]["peak"]
    assert not said["notes"]


def test_the_mean_over_the_interval_is_that_of_the_forces_in_it(pressed):
    tap = pressed[300:380]
    mean = INDENTER.simulate(tap, mean=True)
    fine = tap.resample(500.0, align="linear")
    depth = INDENTER.prepare(tap)  # between samples the motion follows the spline, not a straight line
    motion = depth._follower.motion(tap)
    at = fine.time
    streams = {name: curve(at)[0] for name, curve in zip(NAMES, motion.curves.values(), strict=True)}
    forces = INDENTER.simulate(recording(at, streams)).simulated
    expected = [(forces[i - 5 : i + 1].sum(axis=0) - (forces[i - 5] + forces[i]) / 2) / 5 for i in range(5, len(at), 5)]
    np.testing.assert_allclose(mean.simulated[1:], expected, atol=2e-3 * np.abs(forces).max())


def test_episodes_do_not_depend_on_one_another(pressed):
    half = len(pressed) // 2
    episode = np.where(np.arange(len(pressed)) < half, 3, 8)
    parts = replace(pressed, episode=episode)
    both = INDENTER.simulate(parts)
    second = INDENTER.simulate(parts.select([8]))
    np.testing.assert_array_equal(both.select([8]).simulated, second.simulated)


def test_a_replayed_recording_replays_again_from_its_file(pressed, tmp_path):
    softer = INDENTER.simulate(pressed, modulus=7e4)
    assert total(softer.simulated).max() < 0.8 * total(pressed.measured).max()
    softer.save(tmp_path / "paired.mcap")
    loaded = paxisim.Recording.load(tmp_path / "paired.mcap")
    again = Scene.from_recording(loaded)
    assert again.gel.modulus == 7e4
    np.testing.assert_allclose(again.simulate(loaded).simulated, softer.simulated, atol=1e-5)


def test_a_sensor_is_put_where_the_scene_says():
    world = """<mujoco><option cone="elliptic" impratio="10"/><worldbody><body name="bench"/>
      <body name="tip" pos="0 0 -0.02"><joint name="z" type="slide" axis="0 0 1" range="-0.1 0.1"/>
      <geom type="sphere" size="0.02" mass="0.1"/></body></worldbody></mujoco>"""
    scene = Scene(world, [Drive("z", joint="z", unit="m")], sensor="paxini-gen1-l4629", pool=2,
                  mounts=[paxisim.Mount("bench")])  # fmt: skip
    time, streams = press(seconds=2.0)
    replayed = scene.simulate(recording(time, {"z": streams["depth"]}))
    assert total(replayed.simulated).max() > 1
    again = Scene.from_recording(replayed)
    assert not again.sensor
    np.testing.assert_allclose(again.simulate(replayed).simulated, replayed.simulated, atol=1e-4)
