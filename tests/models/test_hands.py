"""Where `find_mounts` puts pads on whole robots, on awkward hands and on public ones, and what it refuses."""

from __future__ import annotations

import functools
from pathlib import Path

import mujoco
import numpy as np
import pytest
from fingers import bending_hand, box, check_two, on_arm, outward, robot, two_fingers
from hypothesis import given, settings
from hypothesis import strategies as st

import paxisim
from paxisim.errors import InvalidValueError

SHARED = Path(__file__).parents[3] / "shared" / "data" / "hands"
LAYOUT = paxisim.TaxelLayout(3, 2, 4e-3)
find_once = functools.cache(paxisim.find_mounts)


def bodies_of(found) -> list[str]:
    return [mount.body for mount in found.mounts]


# arms


def test_the_hand_of_an_arm_closes_and_the_arm_does_not_whatever_is_around():
    found = find_once(robot(on_arm(two_fingers())))
    check_two(found)
    assert "j0" not in found.report
    (grip,) = found.grips
    np.testing.assert_allclose(grip.qpos[:, :4], 0, atol=1e-6)
    assert grip.pads == (0, 1)
    assert grip.partners == ((1,), (0,))
    around = '<geom type="plane" size="1 1 0.1" pos="0 0 -0.5"/><geom type="box" size="0.3 0.3 0.02" pos="0 0 -0.2"/>'
    around += '<body name="ball" pos="0 0 0.6"><freejoint/><geom size="0.02" mass="0.05"/></body>'
    assert paxisim.find_mounts(robot(on_arm(two_fingers()), world=around)).mounts == found.mounts


def test_two_arms_get_pads_on_their_own_hands_or_on_the_one_chosen():
    arms = [on_arm(two_fingers(name), name, at, joints=2) for name, at in (("a_", "0 -0.2 0"), ("b_", "0 0.2 0"))]
    text = robot(*arms)
    found = paxisim.find_mounts(text)
    assert bodies_of(found) == ["a_left", "a_right", "b_left", "b_right"]
    assert [g.pads for g in found.grips] == [(0, 1), (2, 3)]
    assert [face.opposite for face in found.faces] == [("a_right",), ("a_left",), ("b_right",), ("b_left",)]
    assert bodies_of(paxisim.find_mounts(text, under="b_link0")) == ["b_left", "b_right"]
    for options in ({"close": ["a_left", "a_right"]}, {"fingers": ["a_right", "a_left"]}):
        assert bodies_of(paxisim.find_mounts(text, **options)) == ["a_left", "a_right"]


def test_joints_without_actuators_close_by_name():
    text = robot((two_fingers()[0], ""))
    found = paxisim.find_mounts(text, close=["left", "right"])
    check_two(found)
    assert found.grips == ()  # the robot has no actuators that would close it
    tactile = paxisim.attach(text, LAYOUT, close=["left", "right"])
    assert tactile.compile().nu == 0
    assert tactile.grips == ()
    with pytest.raises(InvalidValueError, match="choose the mounts"):
        paxisim.attach(text, LAYOUT, [paxisim.Mount("left")], under="palm")


COORDINATE = st.integers(-100, 100).map(lambda n: n / 100)
anywhere = given(
    hinge=st.booleans(),
    reverse=st.booleans(),
    joints=st.integers(0, 4),
    scale=st.floats(0.6, 1.6),
    at=st.tuples(*[COORDINATE] * 3),
    turn=st.tuples(*[COORDINATE] * 4).filter(lambda q: np.linalg.norm(q) > 0.2),
    right_first=st.booleans(),
)


def find_scaled(hinge, reverse, joints, scale, at, turn, right_first):
    """Check a gripper of any size, on any arm, at any place, whose fingers may come in any order."""
    bodies, actuators = on_arm(two_fingers(hinge=hinge, reverse=reverse), joints=joints)
    if right_first:
        first, second = bodies.index('<body name="left"'), bodies.index('<body name="right"')
        end = bodies.index("</body>", second) + len("</body>")
        bodies = bodies[:first] + bodies[second:end] + bodies[first:second] + bodies[end:]
    place = f'<body name="stand" pos="{" ".join(map(str, at))}" quat="{" ".join(map(str, turn))}">{bodies}</body>'
    spec = mujoco.MjSpec.from_string(robot((place, actuators)))
    for body in spec.bodies[1:]:
        body.pos = body.pos * scale
        for geom in body.geoms:
            geom.pos, geom.size, geom.fromto = geom.pos * scale, geom.size * scale, geom.fromto * scale
        for joint in body.joints:
            if int(joint.type) == int(mujoco.mjtJoint.mjJNT_SLIDE):
                joint.range = joint.range * scale
    for actuator in spec.actuators:
        if not hinge and not actuator.name.startswith("j"):
            actuator.ctrlrange = actuator.ctrlrange * scale
    found = paxisim.find_mounts(spec)
    assert set(outward(found)) == {"left", "right"}
    for mount in found.mounts:
        sign = 1 if mount.body == "left" else -1
        np.testing.assert_allclose(outward(found)[mount.body], (sign, 0, 0), atol=0.05)
        assert mount.pos[0] == pytest.approx(sign * 0.005 * scale, abs=5e-4)
        assert mount.pos[1] == pytest.approx(0, abs=1e-3)


few = settings(max_examples=6, deadline=None, derandomize=True)
test_any_gripper_anywhere = few(anywhere(find_scaled))
test_many_grippers_anywhere = pytest.mark.slow(settings(few, max_examples=25)(anywhere(find_scaled)))


# hands whose fingers bend


@pytest.mark.parametrize(("bend", "down", "closing"), [("-0.3 1.4", 1, "-0.3 to 1.4"), ("-1.4 0", -1, "0 to -1.4")])
def test_fingers_bend_and_do_not_straighten(bend, down, closing):
    # the fingers' joints bend them down, about +y, or up where they are mirrored; the thumb's, about -y, bend it up
    found = find_once(robot(bending_hand(bend)))
    normals = outward(found)
    assert {"f0_2", "thumb_2"} <= set(normals) <= {"f0_2", "f1_2", "thumb_2"}
    assert down * normals["f0_2"][2] < -0.85
    assert f"f0_1: from {closing}" in found.report
    if down > 0:
        assert normals["f1_2"][2] < -0.85
        assert normals["thumb_2"][2] > 0.85
        assert all(face.off_course < np.radians(40) for face in found.faces)


def test_a_palm_gets_a_pad_only_when_asked():
    asked = paxisim.find_mounts(robot(bending_hand("-0.3 1.4")), fingers=["f0_2", "thumb_2", "palm"])
    assert sorted(bodies_of(asked)) == ["f0_2", "palm", "thumb_2"]


@pytest.mark.filterwarnings("ignore:pads behind other geoms")
def test_a_geom_without_any_name_is_noted_and_stays_on():
    skin = '<geom name="skin" type="box" pos="0.004 0 0" size="0.001 0.01 0.03"/>'
    text = robot(two_fingers(left=f"{skin}<body>{box(-0.003, 0, 0, 0.005, 0.01, 0.03)}</body>"))
    tactile = paxisim.attach(text, LAYOUT)
    assert tactile.mounts[0].replaces == ("skin",)
    assert "no name, nor has its body" in tactile.report


def test_robots_without_a_hand_are_refused():
    legs = "".join(
        f'<body name="leg{i}" pos="0 {y} 0"><joint name="leg{i}" axis="1 0 0" range="-0.6 0.6" damping="1"/>'
        f'<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.04" mass="2"/></body>'
        for i, y in enumerate((-0.1, 0.1))
    )
    servos = "".join(f'<position joint="leg{i}" kp="100" ctrlrange="-0.6 0.6"/>' for i in range(2))
    pelvis = f'<body name="pelvis"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="5"/>{legs}</body>'
    for part in (on_arm(("", "")), (pelvis, servos)):
        with pytest.raises(InvalidValueError, match=r"^no hand found.*--fingers.*--mount\)$"):
            paxisim.find_mounts(robot(part))


def test_fingers_that_pass_each_other_are_refused_unless_they_are_named():
    left, right = (box(0, y, 0, 0.005, 0.005, 0.02) for y in (-0.02, 0.02))
    text = robot(two_fingers(left=left, right=right))
    with pytest.raises(InvalidValueError, match=r"pass each other 40 mm apart.*--mount"):
        paxisim.find_mounts(text)
    found = paxisim.find_mounts(text, fingers=["left", "right"])
    assert len(found.mounts) == 2
    assert "warning: the faces of left and right pass each other" in found.report


# public grippers and hands

PUBLIC = {
    "franka_emika_panda/hand.xml": ["left_finger", "right_finger"],
    "robotiq_2f85/2f85.xml": ["left_pad", "right_pad"],
    "low_cost_robot_arm/low_cost_robot_arm.xml": ["gripper_moving_finger", "gripper_static_finger"],
    "shadow_hand/right_hand.xml": ["rh_ffdistal", "rh_lfdistal", "rh_mfdistal", "rh_rfdistal", "rh_thdistal"],
    "robotiq_2f85_v4/2f85.xml": ["left_pad", "right_pad"],
    "ufactory_xarm7/hand.xml": ["left_finger", "right_finger"],
    "ufactory_xarm7/xarm7.xml": ["left_finger", "right_finger"],
    "trossen_vx300s/vx300s.xml": ["left_finger_link", "right_finger_link"],
    "trossen_wx250s/wx250s.xml": ["wx250s/left_finger_link", "wx250s/right_finger_link"],
    "robotstudio_so101/so101.xml": ["gripper", "moving_jaw_so101_v1"],
    "trs_so_arm100/so_arm100.xml": ["Fixed_Jaw", "Moving_Jaw"],
    "wonik_allegro/right_hand.xml": ["ff_tip", "mf_tip", "rf_tip", "th_tip"],
    "leap_hand/right_hand.xml": ["if_ds", "mf_ds", "rf_ds", "th_ds"],
}
OF_EACH_KIND = list(PUBLIC)[:4]  # parallel, four-bar, one moving jaw, five fingers


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the public grippers beside the checkout")
@pytest.mark.parametrize(
    "file", [pytest.param(name, marks=[] if name in OF_EACH_KIND else pytest.mark.slow) for name in PUBLIC]
)
def test_public_hands(file):
    found = paxisim.find_mounts(SHARED / file)
    assert sorted(bodies_of(found)) == PUBLIC[file]
    assert "warning" not in found.report
    assert all(face.off_course < np.radians(40) for face in found.faces)
