"""Where `find_mounts` puts pads on whole robots and on awkward hands, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import paxisim
from paxisim.errors import InvalidValueError, UnknownNameError

SHARED = Path(__file__).parents[3] / "shared" / "data" / "hands"
COORDINATE = st.integers(-100, 100).map(lambda n: n / 100)
FINGER = '<geom type="box" size="0.005 0.01 0.03" mass="0.05"/>'


def gripper(name="", left=FINGER, right=FINGER, reverse=False, hinge=False, pose=""):
    """Return the XML of a palm with two fingers that close along x, and their actuators."""
    bodies, actuators = "", ""
    for side, sign, geom in (("left", 1, left), ("right", -1, right)):
        joint = f"{name}{side}"
        if hinge:
            low, high = (0, 0.6) if sign > 0 else (-0.6, 0)
            place, move = f"{-sign * 0.045} 0 0", f'type="hinge" axis="0 1 0" range="{low} {high}"'
            geom = geom.replace("<geom", '<geom pos="0 0 0.05"', 1)
        else:
            low, high = (0, 0.04) if sign > 0 else (-0.04, 0)
            place, move = f"{-sign * 0.045} 0 0.04", f'type="slide" axis="1 0 0" range="{low} {high}"'
        if reverse:  # the control that opens is the larger one
            axis = "-1 0 0" if not hinge else "0 -1 0"
            move = move.replace("1 0 0" if not hinge else "0 1 0", axis).replace(
                f'range="{low} {high}"', f'range="{-high} {-low}"'
            )
            low, high = -high, -low
        bodies += f'<body name="{joint}" pos="{place}"><joint name="{joint}" {move} damping="5"/>{geom}</body>'
        actuators += f'<position name="{joint}" joint="{joint}" kp="200" ctrlrange="{low} {high}"/>'
    palm = f'<geom type="box" size="0.06 0.02 0.01" pos="0 0 -0.01" mass="0.3"/>{bodies}'
    return f'<body name="{name}palm" {pose}>{palm}</body>', actuators


def arm(name, hand, at="0 0 0", joints=4):
    """Return the XML of an arm of upright links that carries a hand, and the actuators of the arm."""
    axes = ("0 0 1", "0 1 0", "0 1 0", "0 1 0", "1 0 0", "0 1 0")
    inner, actuators = hand, ""
    for i in reversed(range(joints)):
        joint = f"{name}j{i}"
        place = at if i == 0 else "0 0 0.12"
        inner = (
            f'<body name="{name}link{i}" pos="{place}">'
            f'<joint name="{joint}" axis="{axes[i]}" range="-2 2" damping="1"/>'
            f'<geom type="capsule" fromto="0 0 0.02 0 0 0.1" size="0.02" mass="0.5"/>{inner}</body>'
        )
        actuators = f'<position name="{joint}" joint="{joint}" kp="100" ctrlrange="-2 2"/>{actuators}'
    return inner, actuators


def model(*parts, extra="", world=""):
    bodies, actuators = "".join(p[0] for p in parts), "".join(p[1] for p in parts)
    return (
        f'<mujoco><compiler angle="radian"/><worldbody>{world}{bodies}</worldbody>'
        f"<actuator>{actuators}</actuator>{extra}</mujoco>"
    )


def on_arm(name="", at="0 0 0", joints=4, **options):
    hand, fingers = gripper(name, pose='pos="0 0 0.12"', **options)
    inner, joints_of_arm = arm(name, hand, at, joints)
    return inner, joints_of_arm + fingers


def normals(found):
    """Return the outward normal of each mount in its body's frame."""
    matrices = []
    for mount in found.mounts:
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, np.array(mount.quat))
        matrices.append(-matrix.reshape(3, 3)[:, 2])
    return np.array(matrices)


def check_pair(found, names=("left", "right"), atol=1e-3):
    assert [m.body for m in found.mounts] == list(names)
    np.testing.assert_allclose(normals(found), [(1, 0, 0), (-1, 0, 0)], atol=0.03)
    np.testing.assert_allclose([m.pos[0] for m in found.mounts], (0.005, -0.005), atol=atol)


def test_the_hand_of_an_arm_closes_and_the_arm_does_not():
    found = paxisim.find_mounts(model(on_arm()))
    check_pair(found)
    assert "j0" not in found.report
    (grip,) = found.grips
    np.testing.assert_allclose(grip.qpos[:, :4], 0, atol=1e-6)
    assert grip.pads == (0, 1)
    assert grip.partners == ((1,), (0,))


def test_an_actuator_that_runs_backwards():
    check_pair(paxisim.find_mounts(model(on_arm(reverse=True))))


def test_two_arms_get_pads_on_their_own_hands():
    found = paxisim.find_mounts(model(on_arm("a_", "0 -0.2 0", joints=2), on_arm("b_", "0 0.2 0", joints=2)))
    assert [m.body for m in found.mounts] == ["a_left", "a_right", "b_left", "b_right"]
    assert [g.pads for g in found.grips] == [(0, 1), (2, 3)]
    assert [face.opposite for face in found.faces] == [("a_right",), ("a_left",), ("b_right",), ("b_left",)]


def test_under_chooses_one_hand_of_two():
    text = model(on_arm("a_", "0 -0.2 0", joints=2), on_arm("b_", "0 0.2 0", joints=2))
    assert [m.body for m in paxisim.find_mounts(text, under="b_link0").mounts] == ["b_left", "b_right"]
    assert [m.body for m in paxisim.find_mounts(text, close=["a_left", "a_right"]).mounts] == ["a_left", "a_right"]
    assert [m.body for m in paxisim.find_mounts(text, fingers=["a_right", "a_left"]).mounts] == ["a_left", "a_right"]


def test_objects_and_furniture_do_not_matter():
    world = '<geom type="plane" size="1 1 0.1" pos="0 0 -0.5"/><geom type="box" size="0.3 0.3 0.02" pos="0 0 -0.2"/>'
    world += '<body name="ball" pos="0 0 0.6"><freejoint/><geom size="0.02" mass="0.05"/></body>'
    plain, scene = (paxisim.find_mounts(model(on_arm(), world=w)) for w in ("", world))
    assert plain.mounts == scene.mounts


JAW = """
<body name="fixed_jaw" pos="0 0 0.12">
  <geom name="fixed" type="box" pos="0.01 0 0.06" size="0.003 0.01 0.06" mass="0.1"/>
  <body name="jaw" pos="-0.03 0 0.02"><joint name="jaw" axis="0 1 0" range="-1.2 0.35" damping="0.1"/>
    <geom name="jaw" type="box" pos="0 0 0.05" size="0.003 0.01 0.05" mass="0.05"/></body></body>
"""


def test_a_jaw_on_an_arm():
    inner, actuators = arm("", JAW, joints=5)
    servo = '<position name="jaw" joint="jaw" kp="5" ctrlrange="-1.2 0.35"/>'
    found = paxisim.find_mounts(model((inner, actuators + servo)))
    assert [m.body for m in found.mounts] == ["fixed_jaw", "jaw"]
    np.testing.assert_allclose(normals(found), [(-1, 0, 0), (1, 0, 0)], atol=0.03)
    # in line when closed, at the outer part of both
    assert found.mounts[1].pos[2] > 0.06
    assert found.mounts[0].pos[2] == pytest.approx(found.mounts[1].pos[2] + 0.02, abs=0.02)


def box(x, y, z, dx, dy, dz):
    return f'<geom type="box" pos="{x} {y} {z}" size="{dx} {dy} {dz}" mass="0.01"/>'


CORNERS = "".join(box(0.0055, y, z, 0.002, 0.003, 0.003) for y in (-0.0055, 0.0055) for z in (-0.0055, 0.0055))
RECESSED = {"left": box(0, 0, 0, 0.006, 0.0085, 0.0085), "right": box(0, 0, 0, 0.006, 0.0085, 0.0085)}


def test_corner_boxes_in_front_of_a_large_one_are_one_face():
    left = RECESSED["left"] + CORNERS
    right = RECESSED["right"] + CORNERS.replace('pos="0.0055', 'pos="-0.0055')
    found = paxisim.find_mounts(model(gripper(left=left, right=right)))
    np.testing.assert_allclose([m.pos for m in found.mounts], [(0.0075, 0, 0), (-0.0075, 0, 0)], atol=2e-4)
    np.testing.assert_allclose([f.size for f in found.faces], 0.017, atol=5e-4)
    # the large box is within the thickness of the gel behind the pad
    assert [m.replaces for m in found.mounts] == [(0, 1, 2, 3, 4)] * 2


def test_three_coplanar_boxes_are_one_face():
    boxes = "".join(box(0, 0, z, 0.005, 0.01, 0.01) for z in (-0.02, 0, 0.02))
    found = paxisim.find_mounts(model(gripper(left=boxes, right=boxes)))
    check_pair(found)
    np.testing.assert_allclose([f.size for f in found.faces], [(0.06, 0.02)] * 2, atol=5e-4)
    assert found.mounts[0].replaces == (0, 1, 2)


def test_faces_of_different_length_are_put_in_line():
    short = box(0, 0, 0.02, 0.005, 0.01, 0.01)
    found = paxisim.find_mounts(model(gripper(left=short)))
    np.testing.assert_allclose([m.pos[2] for m in found.mounts], 0.02, atol=1e-3)


@pytest.mark.filterwarnings("ignore:pads behind other geoms")
def test_a_geom_without_any_name_is_noted_and_stays_on():
    hidden = f"<body>{box(-0.003, 0, 0, 0.005, 0.01, 0.03)}</body>"
    text = model(gripper(left=f'<geom name="skin" type="box" pos="0.004 0 0" size="0.001 0.01 0.03"/>{hidden}'))
    tactile = paxisim.attach(text, paxisim.TaxelLayout(3, 2, 4e-3))
    assert tactile.mounts[0].replaces == ("skin",)
    assert "no name, nor has its body" in tactile.report


def hand(straight="0 1.4", thumb="0 1.2", fingers=2):
    """Return a palm with fingers of two joints that bend towards a thumb below them, like a human hand."""
    bodies, actuators = "", ""
    parts = [(f"f{i}", f"0.09 {0.03 * i} 0.01", "0 1 0", straight) for i in range(fingers)]
    parts.append(("thumb", "0.02 0.01 0.07", "0 -1 0", thumb))
    for name, place, axis, bend in parts:
        bodies += (
            f'<body name="{name}_1" pos="{place}"><joint name="{name}_1" axis="{axis}" range="{bend}" '
            f'damping="0.05"/><geom type="capsule" fromto="0 0 0 0.04 0 0" size="0.008" mass="0.02"/>'
            f'<body name="{name}_2" pos="0.045 0 0">'
            f'<joint name="{name}_2" axis="{axis}" range="{bend}" damping="0.05"/>'
            f'<geom type="capsule" fromto="0 0 0 0.03 0 0" size="0.008" mass="0.02"/></body></body>'
        )
        for k in (1, 2):
            actuators += f'<position name="{name}_{k}" joint="{name}_{k}" kp="1" ctrlrange="{bend}"/>'
    palm = '<geom type="box" size="0.05 0.03 0.01" pos="0.03 0.015 0" mass="0.3"/>'
    return f'<body name="palm">{palm}{bodies}</body>', actuators


@pytest.mark.parametrize("straight", ["0 1.4", "-0.3 1.4"])
def test_fingers_bend_and_do_not_straighten(straight):
    # the fingers' joints bend them down, about +y; the thumb's, about -y, bend it up towards them
    found = paxisim.find_mounts(model(hand(straight)))
    tips = {m.body: n for m, n in zip(found.mounts, normals(found), strict=True)}
    assert set(tips) == {"f0_2", "f1_2", "thumb_2"}
    for name in ("f0_2", "f1_2"):
        assert tips[name][2] < -0.85
    assert tips["thumb_2"][2] > 0.85
    assert f"f0_1: from {straight.split()[0]} to 1.4" in found.report
    assert all(face.off_course < np.radians(40) for face in found.faces)


def test_a_mirrored_hand_bends_the_other_way():
    bodies, actuators = hand()
    bodies = bodies.replace('axis="0 1 0" range="0 1.4"', 'axis="0 1 0" range="-1.4 0"')
    actuators = actuators.replace('ctrlrange="0 1.4"', 'ctrlrange="-1.4 0"')
    found = paxisim.find_mounts(model((bodies, actuators)))
    tips = {m.body: n for m, n in zip(found.mounts, normals(found), strict=True)}
    assert tips["f0_2"][2] > 0.85
    assert "f0_1: from 0 to -1.4" in found.report


def test_a_palm_gets_a_pad_only_when_asked():
    text = model(hand())
    assert "palm" not in [m.body for m in paxisim.find_mounts(text).mounts]
    asked = paxisim.find_mounts(text, fingers=["f0_2", "thumb_2", "palm"])
    assert sorted(m.body for m in asked.mounts) == ["f0_2", "palm", "thumb_2"]


def test_joints_without_actuators_close_by_name():
    bodies, _ = gripper()
    text = model((bodies, ""))
    with pytest.raises(InvalidValueError, match=r"no actuators.*--close left right,"):
        paxisim.find_mounts(text)
    found = paxisim.find_mounts(text, close=["left", "right"])
    check_pair(found)
    assert found.grips == ()  # the robot has no actuators that would close it
    tactile = paxisim.attach(text, paxisim.TaxelLayout(3, 2, 4e-3), close=["left", "right"])
    assert tactile.compile().nu == 0
    assert tactile.grips == ()


def test_an_arm_without_a_hand_is_refused():
    with pytest.raises(InvalidValueError, match=r"^no hand found.*--fingers.*--mount\)$"):
        paxisim.find_mounts(model(arm("", "")))


def test_legs_are_no_fingers():
    legs = "".join(
        f'<body name="leg{i}" pos="0 {y} 0"><joint name="leg{i}" axis="1 0 0" range="-0.6 0.6" damping="1"/>'
        f'<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.04" mass="2"/></body>'
        for i, y in enumerate((-0.1, 0.1))
    )
    servos = "".join(f'<position joint="leg{i}" kp="100" ctrlrange="-0.6 0.6"/>' for i in range(2))
    pelvis = f'<body name="pelvis"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="5"/>{legs}</body>'
    with pytest.raises(InvalidValueError, match="no hand found"):
        paxisim.find_mounts(model((pelvis, servos)))


def test_fingers_that_pass_each_other_are_refused():
    left, right = (box(0, y, 0, 0.005, 0.005, 0.02) for y in (-0.02, 0.02))
    with pytest.raises(InvalidValueError, match=r"pass each other 40 mm apart.*--mount"):
        paxisim.find_mounts(model(gripper(left=left, right=right)))


def test_named_fingers_are_taken_with_a_warning():
    left, right = (box(0, y, 0, 0.005, 0.005, 0.02) for y in (-0.02, 0.02))
    found = paxisim.find_mounts(model(gripper(left=left, right=right)), fingers=["left", "right"])
    assert len(found.mounts) == 2
    assert "warning: the faces of left and right pass each other" in found.report


def test_unknown_names_are_refused():
    text = model(gripper())
    with pytest.raises(UnknownNameError, match="did you mean 'left'"):
        paxisim.find_mounts(text, fingers=["lefft", "right"])
    with pytest.raises(UnknownNameError, match="actuator or joint"):
        paxisim.find_mounts(text, close=["grip"])
    with pytest.raises(UnknownNameError, match="body 'wrist'"):
        paxisim.find_mounts(text, under="wrist")
    with pytest.raises(InvalidValueError, match="choose the mounts"):
        paxisim.attach(text, paxisim.TaxelLayout(3, 2, 4e-3), [paxisim.Mount("left")], under="palm")


def test_an_include_file_is_no_model(tmp_path):
    path = tmp_path / "part.xml"
    path.write_text("<mujocoinclude><worldbody/></mujocoinclude>")
    with pytest.raises(InvalidValueError, match="give the file that includes it"):
        paxisim.find_mounts(path)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    hinge=st.booleans(),
    reverse=st.booleans(),
    joints=st.integers(0, 4),
    scale=st.floats(0.6, 1.6),
    at=st.tuples(*[COORDINATE] * 3),
    turn=st.tuples(*[COORDINATE] * 4).filter(lambda q: np.linalg.norm(q) > 0.2),
    right_first=st.booleans(),
)
def test_any_gripper_anywhere(hinge, reverse, joints, scale, at, turn, right_first):
    bodies, actuators = on_arm(joints=joints, hinge=hinge, reverse=reverse)
    if right_first:
        first = bodies.index('<body name="left"')
        second = bodies.index('<body name="right"')
        end = bodies.index("</body>", second) + len("</body>")
        bodies = bodies[:first] + bodies[second:end] + bodies[first:second] + bodies[end:]
    place = f'<body name="stand" pos="{" ".join(map(str, at))}" quat="{" ".join(map(str, turn))}">{bodies}</body>'
    spec = mujoco.MjSpec.from_string(model((place, actuators)))
    for body in spec.bodies[1:]:
        body.pos = body.pos * scale
        for geom in body.geoms:
            geom.pos, geom.size = geom.pos * scale, geom.size * scale
            geom.fromto = geom.fromto * scale
        for joint in body.joints:
            if int(joint.type) == int(mujoco.mjtJoint.mjJNT_SLIDE):
                joint.range = joint.range * scale
    for actuator in spec.actuators:
        if not hinge and not actuator.name.startswith("j"):
            actuator.ctrlrange = actuator.ctrlrange * scale
    found = paxisim.find_mounts(spec)
    by_body = {m.body: (m, n) for m, n in zip(found.mounts, normals(found), strict=True)}
    assert set(by_body) == {"left", "right"}
    for name, sign in (("left", 1), ("right", -1)):
        mount, normal = by_body[name]
        np.testing.assert_allclose(normal, (sign, 0, 0), atol=0.05)
        assert mount.pos[0] == pytest.approx(sign * 0.005 * scale, abs=5e-4)
        assert mount.pos[1] == pytest.approx(0, abs=1e-3)


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the public grippers beside the checkout")
@pytest.mark.parametrize(
    ("file", "bodies"),
    [
        ("franka_emika_panda/hand.xml", ["left_finger", "right_finger"]),
        ("robotiq_2f85/2f85.xml", ["left_pad", "right_pad"]),
        ("robotiq_2f85_v4/2f85.xml", ["left_pad", "right_pad"]),
        ("ufactory_xarm7/hand.xml", ["left_finger", "right_finger"]),
        ("ufactory_xarm7/xarm7.xml", ["left_finger", "right_finger"]),
        ("trossen_vx300s/vx300s.xml", ["left_finger_link", "right_finger_link"]),
        ("trossen_wx250s/wx250s.xml", ["wx250s/left_finger_link", "wx250s/right_finger_link"]),
        ("robotstudio_so101/so101.xml", ["gripper", "moving_jaw_so101_v1"]),
        ("trs_so_arm100/so_arm100.xml", ["Fixed_Jaw", "Moving_Jaw"]),
        ("low_cost_robot_arm/low_cost_robot_arm.xml", ["gripper_moving_finger", "gripper_static_finger"]),
        ("shadow_hand/right_hand.xml", ["rh_ffdistal", "rh_lfdistal", "rh_mfdistal", "rh_rfdistal", "rh_thdistal"]),
        ("wonik_allegro/right_hand.xml", ["ff_tip", "mf_tip", "rf_tip", "th_tip"]),
        ("leap_hand/right_hand.xml", ["if_ds", "mf_ds", "rf_ds", "th_ds"]),
    ],
)
def test_public_hands(file, bodies):
    found = paxisim.find_mounts(SHARED / file)
    assert sorted(m.body for m in found.mounts) == bodies
    assert "warning" not in found.report
    assert all(face.off_course < np.radians(40) for face in found.faces)
