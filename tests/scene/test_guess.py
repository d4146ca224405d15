"""`paxisim scene init` finds the drives of a robot that it has never seen."""

import re
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from models.fingers import four_bars, on_arm, robot, two_fingers
from scene.rigs import path, total
from scipy.spatial.transform import Rotation

import paxisim
from paxisim import Drive, Recording, Scene
from paxisim.cli import main
from paxisim.scene.guess import guess_scene

HANDS = Path(__file__).parents[2].parent / "shared" / "data" / "hands"
LAYOUT = paxisim.TaxelLayout(3, 3, 4e-3)
TIME = np.arange(150) / 50
WAVE = np.sin(TIME)
POST = '<geom name="post" type="box" size="0.015 0.02 0.04" pos="0 0 0.53"/>'
CRANKS = ("left_crank", "right_crank")
ARM = [Drive(f"j{i}", joint=f"x_j{i}") for i in range(4)]
HALF = {"left": -0.5, "right": 0.5}
SLIDING = [*ARM, *(Drive("gripper_width", joint=s, scale=k, offset=-0.08 * k) for s, k in HALF.items())]


@pytest.fixture(autouse=True)
def work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write(xml, name="robot.xml"):
    """Write a robot with pads on its fingers."""
    Path(name).write_text(paxisim.attach(xml, LAYOUT).to_xml())
    return name


def arm_with(fingers, *more, prefix="x_", world=POST):
    bodies, actuators, *loops = fingers
    extra = f"<equality>{loops[0]}</equality>" if loops else ""
    return robot(on_arm((bodies, actuators), prefix), *more, extra=extra, world=world)


def squeezes(opening=(0.06, 0.0292)):
    """Return the streams of an arm that turns a little and closes its gripper on the post."""
    shares = path(TIME, [0, 0.4, 1.2, 1.8, 2.6, 3], [0, 0, 1, 1, 0, 0])
    streams = {f"j{i}": np.zeros(len(TIME)) for i in range(4)}
    return streams | {"j0": 0.02 * np.sin(TIME), "gripper_width": opening[0] + (opening[1] - opening[0]) * shares}


def blank(streams, pads=2):
    return Recording(TIME, np.zeros((len(TIME), pads, *LAYOUT.shape), np.float32), covariates=streams, layout=LAYOUT)


def measured(model, drives, streams, kept):
    """Simulate a sensor in a scene with known drives and save what a robot would record of it."""
    exact = Scene(model, drives).simulate(blank(streams))
    assert total(exact.simulated).max() > 2
    streams = {name: streams[name] for name in kept}
    replace(exact, measured=exact.simulated, simulated=None, metadata={}, covariates=streams).save("press.mcap")
    return exact.simulated


def init(model, *words):
    status = main(["scene", "init", model, "press.mcap", "-o", "found.toml", *words])
    return Scene.load("found.toml") if status == 0 else status


@pytest.mark.parametrize(("linkage", "actuated"), [(False, True), (False, False), (True, True)])
def test_the_drives_of_an_arm_with_a_hand_are_found_and_give_the_same_forces(capsys, linkage, actuated):
    model, streams = write(arm_with(four_bars() if linkage else two_fingers())), squeezes()
    if not actuated:
        Path(model).write_text(re.sub("<actuator>.*</actuator>", "", Path(model).read_text(), flags=re.DOTALL))
    if linkage:
        angle = np.arcsin((0.045 - streams["gripper_width"] / 2) / 0.05)
        drives = [*ARM, *(Drive(crank, joint=crank) for crank in CRANKS)]
        forces = measured(model, drives, streams | dict.fromkeys(CRANKS, angle), streams)
    else:
        forces = measured(model, SLIDING, streams, streams)
    scene = init(model)
    out = " ".join(capsys.readouterr().out.split())
    assert "to check: stream 'j0' moves joint 'x_j0': their names end alike" in out
    assert "to check: stream 'gripper_width' is taken to be the distance between the pads" in out
    assert scene.closing == "gripper_width"
    closing = [drive.joint for drive in scene.drives if drive.stream == "gripper_width"]
    assert closing == (list(CRANKS) if linkage else ["left", "right"])
    assert scene.parameters()["joint_offset_gripper_width"].unit == "m"
    again = total(scene.simulate(Recording.load("press.mcap")).simulated)
    assert np.abs(again - total(forces)).max() < 0.05 * total(forces).max()
    replay = scene.prepare(Recording.load("press.mcap"))
    turned = replay.pose(40)[replay.rig.model.joint("x_j0").qposadr[0]]
    assert turned == pytest.approx(streams["j0"][40], abs=1e-4)


def write_log(streams, time=TIME):
    """Write a robot's log beside the recording."""
    rows = np.column_stack([time, *streams.values()])
    np.savetxt("robot.csv", rows, delimiter=",", header=",".join(["time", *streams]), comments="", fmt="%.9g")


def with_log(model, streams, *words):
    """Write a recording of a sensor alone, and begin the scene with the log of the robot."""
    measured(model, SLIDING, streams, ())
    return init(model, "--streams", "robot.csv", *words)


def test_a_robot_s_log_beside_the_recording_ends_in_a_table_and_a_picture_of_the_first_contact(capsys):
    model, streams = write(arm_with(two_fingers())), squeezes()
    streams["j1"] = np.round(0.01 * WAVE, 3)
    long = "a_very_long_name_of_a_stream_on_a_robot_with_many_of_them_that_ends_in.x_j3"
    write_log({long if name == "j3" else name: values for name, values in streams.items()})
    scene = with_log(model, streams, "--picture", "contact.png")
    assert {drive.joint: drive.resolution for drive in scene.drives}["x_j1"] == pytest.approx(1e-3)
    out = capsys.readouterr().out
    table = out[out.index("\nstream ") :].splitlines()[1:]
    assert max(map(len, out.splitlines())) <= 80
    assert [line.split() for line in table if line.startswith("gripper_width")] == [
        ["gripper_width", finger, "m", "0.0292", "to", "0.06"] for finger in ("left", "right")
    ]
    assert len({line.index(" m ") for line in table if " m " in line}) == 1, "the columns are aligned"
    assert "to check: the modulus of the gel, 100 kPa, is a default" in out
    assert "contact.png: the first contact" in out
    assert Path("contact.png").read_bytes().startswith(b"\x89PNG")
    assert main(["replay", "press.mcap", "--scene", "found.toml", "--streams", "robot.csv", "-o", "paired.npz"]) == 0
    paired = Recording.load("paired.npz")
    assert np.abs(total(paired.simulated) - total(paired.measured)).max() < 0.05 * total(paired.measured).max()


@pytest.mark.parametrize(
    ("log", "words", "message"),
    [
        (TIME + 9, (), "robot.csv does not overlap the recording: it spans 9.000 s to 11.980 s, the recording 0.000 s"),
        (TIME + 1.7e9, (), "both must use the same clock"),
        (TIME, ("--picture", "contact.jpg"), "the output must end in .png"),
        (TIME[:40], ("--picture", "contact.png"), "the driving streams are not all known at"),
    ],
)
def test_a_log_that_is_not_of_the_recording_writes_nothing(capsys, log, words, message):
    model, streams = write(arm_with(two_fingers())), squeezes()
    write_log({name: values[: len(log)] for name, values in streams.items()}, log)
    assert with_log(model, streams, *words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not list(Path().glob("found.*")) + list(Path().glob("contact.*"))


@pytest.mark.parametrize(("unit", "message"), [("N", "never exceeds 0.2 N (it reaches 0 N)"), ("count", "is in count")])
def test_a_picture_needs_a_contact(capsys, unit, message):
    replace(blank(squeezes()), metadata={"unit": unit}).save("press.mcap")
    assert init(write(arm_with(two_fingers())), "--picture", "contact.png") == 2
    assert message in capsys.readouterr().err
    assert not Path("found.toml").exists()


def found_in(streams, model, *words):
    blank(streams).save("press.mcap")
    scene = init(model, *words)
    return scene, {drive.stream: (drive.joint, drive.unit) for drive in scene.drives} if scene != 2 else {}


@pytest.mark.parametrize(
    ("changes", "expected", "said"),
    [
        # the values tell the unit; an arm has one for all its joints
        ({"gripper_width": 1e3 * squeezes()["gripper_width"]}, {"gripper_width": ("right", "mm")}, "distance between"),
        ({"j1": 100 * WAVE, "j2": WAVE}, {"j1": ("x_j1", "deg"), "j2": ("x_j2", "deg")}, "'j1' is in deg"),
        # what could be several things is none of them
        ({"gripper_opening": squeezes()["gripper_width"]}, {"gripper_width": None}, "choose one with --opening"),
        ({"a.x_j1": WAVE, "j1": None, "b.x_j1": WAVE}, {"a.x_j1": None}, "could each move joint 'x_j1'"),
        ({"gripper_status": TIME > 1, "gripper_fault": 0 * TIME}, {"gripper_width": ("right", "m")}, "gripper_status"),
        ({"gripper_width": np.linspace(0, 1, 150)}, {"gripper_width": None}, "may be a share, a count or an angle"),
        # a stream of a joint is no other joint that only ends alike
        ({"left": None, "other_left": 3 * WAVE}, {"other_left": None}, "streams that move nothing: other_left"),
    ],
)  # fmt: skip
def test_units_and_doubts(capsys, changes, expected, said):
    streams = {name: values for name, values in (squeezes() | changes).items() if values is not None}
    _, found = found_in(streams, write(arm_with(two_fingers())))
    assert {name: found.get(name) for name in expected} == expected
    assert said in " ".join(capsys.readouterr().out.split())


def test_a_hand_that_is_not_on_the_arm_and_two_hands_with_one_opening(capsys):
    model = write(robot(on_arm(("", "")), two_fingers(pose='pos="1 0 0"')))
    _, found = found_in({"j0": WAVE, "gripper_width": 0.05 + 0.01 * WAVE}, model)
    assert found["gripper_width"] == ("right", "m")
    assert "no pad is moved by joint 'j0': if the hand is on this arm" in " ".join(capsys.readouterr().out.split())
    model = write(robot(two_fingers("a_"), two_fingers("b_", pose='pos="0 1 0"')))
    blank({"a_left": 0.01 + 0.01 * WAVE, "gripper_width": 0.05 + 0.01 * WAVE}, pads=4).save("press.mcap")
    assert {drive.joint for drive in init(model, "--force").drives} == {"a_left", "b_left", "b_right"}
    blank({"gripper_width": 0.05 + 0.01 * WAVE}, pads=4).save("press.mcap")
    assert init(model, "--force") == 2
    assert "stream 'gripper_width' could be the opening of 2 hands, so none moves" in capsys.readouterr().err


def test_opening_names_the_stream_and_the_closing_one_is_never_that_of_the_arm():
    model, streams = write(arm_with(two_fingers())), squeezes()
    streams["gap"] = streams.pop("gripper_width")
    scene, found = found_in(streams, model)
    assert (scene.closing, "gap" in found) == ("", False)
    scene, found = found_in(streams, model, "--opening", "gap", "--force")
    assert (scene.closing, found["gap"]) == ("gap", ("right", "m"))
    fingers = {"shoulder_left": 0.01 * TIME, "left": 0.01 * TIME, "j3": TIME / 9}
    assert found_in(fingers, model, "--force")[0].closing == "left"


@pytest.mark.parametrize(
    ("changes", "words", "message"),
    [
        ({"j1": 400 + TIME}, (), "'j1' goes from 400 to 403, which no unit of rad, deg brings into the limits"),
        ({}, ("--opening", "j9"), "unknown stream 'j9'"),
        ({"a": np.zeros((150, 2))}, ("--opening", "a"), "one number per sample, got 'a' of shape (150, 2)"),
        ({"left": 0.01 + 0.01 * WAVE}, ("--opening", "gripper_width"), "needs a hand with two pads that no other"),
        ({"gripper_width": TIME * 90}, ("--opening", "gripper_width"), "it may be a share, a count or an angle"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_writes_nothing(capsys, changes, words, message):
    model = write(arm_with(two_fingers()).replace("x_j", "j")) if not words else write(arm_with(two_fingers()))
    assert found_in(squeezes() | changes, model, *words)[0] == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message.replace("x_j", "j") in line
    assert not Path("found.toml").exists()


FLOATING = """<body name="{name}base" pos="0 0 0.1"><freejoint/><geom type="box" size=".1 .1 .02" mass="2"/>{arm}</body>
  <body name="cup" mocap="true"><geom type="box" size="0.015 0.02 0.04"/></body>"""


def shapes(places, turns):
    """Return poses in all the shapes that a stream may have, with the option that they need."""
    matrices = np.tile(np.eye(4), (len(places), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = turns.as_matrix(), places
    xyzw = turns.as_quat()
    return {
        "rows": (matrices.reshape(-1, 16), ()),
        "columns": (matrices.transpose(0, 2, 1).reshape(-1, 16), ()),
        "4x4": (matrices, ()),
        "xyzw": (np.hstack([places, xyzw]), ("--quaternion", "xyzw")),
        "wxyz": (np.hstack([places, xyzw[:, [3, 0, 1, 2]]]), ("--quaternion", "wxyz")),
    }


@pytest.mark.parametrize("shape", ["rows", "columns", "4x4", "xyzw", "wxyz"])
def test_a_floating_base_and_an_object_follow_their_poses(capsys, shape):
    """The object stays 30 mm wide between the fingers of a robot that turns about z and moves."""
    bodies, actuators = two_fingers()
    model = write(robot((FLOATING.format(name="x_", arm=bodies), actuators)))
    turns = Rotation.from_rotvec(0.3 * np.outer(WAVE, [0, 0, 1]) + [0, 0, 1])
    base = np.column_stack([0.05 * WAVE, 0.02 * TIME, 0.3 + 0.01 * TIME])
    poses, words = shapes(1e3 * base if shape == "wxyz" else base, turns)[shape]
    cup = shapes(base + [0, 0, 0.04], turns)["rows"][0]
    scene, _ = found_in({"base_pose": poses, "cup": cup, "width": squeezes()["gripper_width"]}, model, *words)
    drives = {drive.target: (drive.stream, drive.unit) for drive in scene.drives if drive.body}
    assert drives == {"x_base": ("base_pose", "mm" if shape == "wxyz" else "m"), "cup": ("cup", "m")}
    simulated = total(scene.simulate(Recording.load("press.mcap")).simulated)
    assert simulated[:30].max() == 0
    assert simulated[65:85].min() > 1
    assert simulated[130:].max() == 0


@pytest.mark.parametrize("shape", ["rows", "columns", "4x4", "xyzw", "wxyz"])
def test_an_object_starts_at_the_pose_of_its_stream(shape):
    cup = '<body name="cup"><freejoint/><geom type="box" size="0.01 0.01 0.01"/></body>'
    model = write(robot(two_fingers(), world=cup))
    turns = Rotation.from_rotvec(np.tile([0.1, 0.2, 0.3], (len(TIME), 1)))
    poses, words = shapes(np.tile([0.3, 0.2, 0.1], (len(TIME), 1)), turns)[shape]
    start = paxisim.ObjectStart("cup", stream="cup", quaternion=words[1] if words else "wxyz")
    scene = Scene(model, [Drive("width", joint="left")], start=[start], settle=0.0)
    replay = scene.prepare(blank({"cup": poses, "width": 0.01 + 0.01 * WAVE}))
    expected = [0.3, 0.2, 0.1, *turns[0].as_quat()[[3, 0, 1, 2]]]
    np.testing.assert_allclose(replay.pose(0)[replay.rig.object_address("cup") :][:7], expected, atol=1e-4)


def test_the_order_of_quaternions_is_asked_for(capsys):
    bodies, actuators = two_fingers()
    model = write(robot((FLOATING.format(name="", arm=bodies), actuators)))
    poses = np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(TIME), 1))
    assert found_in({"base": poses}, model)[0] == 2
    assert "w x y z or x y z w: say so with --quaternion wxyz or --quaternion xyzw" in capsys.readouterr().err
    assert found_in({"base": 2 * np.tile(np.eye(4), (len(TIME), 1, 1))}, model)[0] == 2
    assert "must have homogeneous matrices: a rotation, a position and the row 0 0 0 1" in capsys.readouterr().err
    scene, _ = found_in({"width": 0.05 + 0.01 * WAVE}, model)
    assert [start.body for start in scene.start] == ["base"]
    assert "body 'base' carries pads and moves freely, but no stream poses it" in " ".join(
        capsys.readouterr().out.split()
    )


# public hands


def bare_xarm():
    """Return the arm without its gripper, and where that was."""
    spec = mujoco.MjSpec.from_file(str(HANDS / "ufactory_xarm7" / "xarm7.xml"))
    base = spec.body("xarm_gripper_base_link")
    at = base.parent.name
    spec.delete(base)
    return spec, at


@pytest.mark.skipif(not HANDS.is_dir(), reason="the public hands are not here")
@pytest.mark.parametrize(
    ("hand", "joints", "error"),
    [
        ("franka_emika_panda/hand.xml", ("finger_joint1", "finger_joint2"), 1e-5),
        ("robotiq_2f85/2f85.xml", ("right_driver_joint", "left_driver_joint"), 2e-5),
        ("", ("left_driver_joint", "right_driver_joint"), 1.5e-3),  # its own gripper has a loose linkage
    ],
)
@pytest.mark.filterwarnings("ignore:.* mm inside")
def test_the_pads_of_public_grippers_are_apart_as_recorded(tmp_path, hand, joints, error):
    """The distance between the pads, simulated at several samples, is that of the stream."""
    arm, at = (HANDS / "ufactory_xarm7" / "xarm7.xml", "") if not hand else bare_xarm()
    composed = paxisim.compose_scene(arm, HANDS / hand if hand else None, at=at)
    Path("robot.xml").write_text(paxisim.attach(composed.spec, LAYOUT).to_xml(tmp_path))
    width = path(TIME, [0, 0.5, 1, 1.5, 2, 3], [60, 60, 45, 45, 32, 32])
    streams = {f"joint{i}": 0.1 * np.sin(TIME + i) for i in range(1, 8)} | {"gripper_width": width}
    scene, found = found_in(streams, "robot.xml")
    assert scene.closing == "gripper_width"
    assert [drive.joint.removeprefix("hand_") for drive in scene.drives][7:] == list(joints)
    assert {name: found[name] for name in ("joint1", "joint7")} == {n: (n, "rad") for n in ("joint1", "joint7")}
    assert found["gripper_width"][1] == "mm"
    replay = scene.prepare(Recording.load("press.mcap"))
    data = mujoco.MjData(replay.rig.model)
    for sample in (20, 70, 140):  # the gripper is at rest
        data.qpos[:] = replay.pose(sample)
        mujoco.mj_kinematics(data.model, data)
        apart = np.linalg.norm(np.diff(data.xpos[replay.rig.pads.bodies], axis=0))
        assert apart == pytest.approx(1e-3 * width[sample], abs=error)


def test_the_steps_of_an_encoder_are_known_after_its_stream_was_interpolated_to_another_clock(capsys):
    model, streams = write(arm_with(two_fingers())), squeezes()
    streams["j1"] = np.round(0.01 * WAVE, 3)
    write_log({name: values[:-1] for name, values in streams.items()}, TIME[:-1] + 0.37 * (TIME[1] - TIME[0]))
    measured(model, SLIDING, streams, ())
    assert main(["convert", "press.mcap", "with.mcap", "--streams", "robot.csv"]) == 0
    assert main(["convert", "with.mcap", "again.npz"]) == 0
    Recording.load("again.npz").resample(77).save("slow.mcap")
    for name in ("with.mcap", "again.npz", "slow.mcap"):
        found = guess_scene(model, Recording.load(name))
        assert {drive.joint: drive.resolution for drive in found.scene.drives}["x_j1"] == pytest.approx(1e-3, rel=1e-5)
