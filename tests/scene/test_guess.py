"""`paxisim scene init` finds the drives of a robot that it has never seen."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from models.fingers import four_bars, on_arm, robot, two_fingers
from scene.rigs import path, total

import paxisim
from paxisim import Drive, Recording, Scene
from paxisim.cli import main

HANDS = Path(__file__).parents[2].parent / "shared" / "data" / "hands"
LAYOUT = paxisim.TaxelLayout(3, 3, 4e-3)
TIME = np.arange(150) / 50
POST = '<geom name="post" type="box" size="0.015 0.02 0.04" pos="0 0 0.53"/>'
CRANKS = ("left_crank", "right_crank")


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
    status = main(["scene", "init", model, "--recording", "press.mcap", "-o", "found.toml", *words])
    return Scene.load("found.toml") if status == 0 else status


@pytest.mark.parametrize("linkage", [False, True])
def test_the_drives_of_an_arm_with_a_hand_are_found_and_give_the_same_forces(capsys, linkage):
    model, streams = write(arm_with(four_bars() if linkage else two_fingers())), squeezes()
    drives = [Drive(f"j{i}", joint=f"x_j{i}") for i in range(4)]
    if linkage:
        angle = np.arcsin((0.045 - streams["gripper_width"] / 2) / 0.05)
        forces = measured(
            model, [*drives, *(Drive(c, joint=c) for c in CRANKS)], streams | dict.fromkeys(CRANKS, angle), streams
        )
    else:
        drives += [
            Drive("gripper_width", joint=s, scale=k, offset=-0.08 * k) for s, k in (("left", -0.5), ("right", 0.5))
        ]
        forces = measured(model, drives, streams, streams)
    scene = init(model)
    out = " ".join(capsys.readouterr().out.split())
    assert "stream 'j0' moves joint 'x_j0': their names end alike, to check" in out
    assert "'gripper_width' is taken to be the distance between the pads, to check" in out
    assert scene.closing == "gripper_width"
    closing = [drive.joint for drive in scene.drives if drive.stream == "gripper_width"]
    assert closing == (list(CRANKS) if linkage else ["left", "right"])
    again = total(scene.simulate(Recording.load("press.mcap")).simulated)
    assert np.abs(again - total(forces)).max() < 0.05 * total(forces).max()


def found_in(streams, model, *words):
    blank(streams).save("press.mcap")
    scene = init(model, *words)
    return scene, {drive.stream: (drive.joint, drive.unit) for drive in scene.drives} if scene != 2 else {}


@pytest.mark.parametrize(
    ("changes", "expected", "said"),
    [
        # the values tell the unit; an arm has one for all its joints
        ({"gripper_width": 1e3 * squeezes()["gripper_width"]}, {"gripper_width": ("right", "mm")}, "distance between"),
        ({"j1": 100 * np.sin(TIME), "j2": np.sin(TIME)}, {"j1": ("x_j1", "deg"), "j2": ("x_j2", "deg")}, "'j1' is in deg"),
        # what could be several things is none of them
        ({"gripper_opening": squeezes()["gripper_width"]}, {"gripper_width": None}, "choose one with --opening"),
        ({"a.x_j1": np.sin(TIME), "j1": None, "b.x_j1": np.sin(TIME)}, {"a.x_j1": None, "b.x_j1": None}, "could each move joint 'x_j1'"),
        ({"gripper_width": np.linspace(0, 1, 150)}, {"gripper_width": None}, "may be a share, a count or an angle"),
        # a stream of a joint is no other joint that only ends alike
        ({"left": None, "other_left": 3 * np.sin(TIME)}, {"other_left": None}, "streams that move nothing: other_left"),
    ],
)  # fmt: skip
def test_units_and_doubts(capsys, changes, expected, said):
    streams = {name: values for name, values in (squeezes() | changes).items() if values is not None}
    _, found = found_in(streams, write(arm_with(two_fingers())))
    assert {name: found.get(name) for name in expected} == expected
    assert said in " ".join(capsys.readouterr().out.split())


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
        ({"j1": 400 + TIME}, (), "'j1' goes from 400 to 403, which no unit of rad, deg brings into the limits of joint 'x_j1'"),
        ({}, ("--opening", "j9"), "unknown stream 'j9'"),
        ({"gripper_width": TIME * 90}, ("--opening", "gripper_width"), "it may be a share, a count or an angle"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_writes_nothing(capsys, changes, words, message):
    model = write(arm_with(two_fingers()).replace("x_j", "j")) if not words else write(arm_with(two_fingers()))
    assert found_in(squeezes() | changes, model, *words)[0] == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message.replace("x_j", "j") in line
    assert not Path("found.toml").exists()
