from __future__ import annotations

import mujoco
import numpy as np
import pytest

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.models.attach import attach
from paxisim.models.find_mounts import choose_mounts, find_mounts
from paxisim.models.load import load_spec

# two fingers on slides along x, 80 mm apart when open; their inner faces are at x = -+40 mm, centre 40 mm up
TWO_FINGERS = """
<mujoco>
  <asset>{asset}</asset>
  <worldbody>
    <body name="palm" {palm}>
      <geom name="palm" type="box" size="0.06 0.02 0.01" pos="0 0 -0.01"/>
      <body name="left" pos="-0.045 0 0.04">
        <joint name="left" type="slide" axis="1 0 0" range="0 0.04" damping="5"/>
        {left}
      </body>
      <body name="right" pos="0.045 0 0.04">
        <joint name="right" type="slide" axis="1 0 0" range="-0.04 0" damping="5"/>
        {right}
      </body>
    </body>
  </worldbody>
  <actuator>{actuators}</actuator>
  <keyframe><key name="rest" qpos="0 0"/></keyframe>
</mujoco>
"""
BOX = '<geom type="box" size="0.005 0.01 0.03" mass="0.05"/>'
SERVOS = """
<position name="left" joint="left" kp="100" ctrlrange="0 0.04"/>
<position name="right" joint="right" kp="100" ctrlrange="-0.04 0"/>
"""


def two_fingers(left=BOX, right=BOX, actuators=SERVOS, asset="", palm=""):
    return TWO_FINGERS.format(left=left, right=right, actuators=actuators, asset=asset, palm=palm)


def frame(mount):
    """Return the x, y and z axes of the pad frame as columns in the body frame."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array(mount.quat))
    return matrix.reshape(3, 3)


def check_two(found, x, size, centre=0.0, atol=1e-4):
    """Check that the faces oppose each other along x, `x` from their bodies' origins, with rows along z."""
    assert [m.body for m in found.mounts] == ["left", "right"]
    for face, side in zip(found.faces, (1, -1), strict=True):
        np.testing.assert_allclose(face.mount.pos, (side * x, 0, centre), atol=atol)
        axes = frame(face.mount)
        np.testing.assert_allclose(axes[:, 2], (-side, 0, 0), atol=0.03)
        np.testing.assert_allclose(axes[:, 1], (0, 0, 1), atol=0.03)
        np.testing.assert_allclose(np.cross(axes[:, 0], axes[:, 1]), axes[:, 2], atol=1e-5)
        np.testing.assert_allclose(face.size, size, atol=atol)


def test_box_fingers():
    found = find_mounts(two_fingers())
    check_two(found, 0.005, (0.06, 0.02))
    assert [m.replaces for m in found.mounts] == [(0,), (0,)]
    assert [f.opposite for f in found.faces] == [("right",), ("left",)]
    assert all(f.flatness < 1e-6 and f.fill > 0.9 for f in found.faces)


def test_report_says_what_was_done():
    report = find_mounts(two_fingers()).report
    assert "left: from 0 to 0.04" in report
    assert "right: from 0 to -0.04" in report
    assert "left opposes right" in report
    assert "80.0 mm apart when open" in report
    assert "face of 60.0 x 20.0 mm" in report
    assert "switches off left/0" in report


def test_poses_for_drawing():
    found = find_mounts(two_fingers())
    np.testing.assert_allclose(found.open_qpos, 0, atol=1e-3)
    assert np.all(np.abs(found.grasp_qpos) > 0.03)
    assert found.model.nq == 2


def test_deterministic():
    assert find_mounts(two_fingers()).faces == find_mounts(two_fingers()).faces


def test_turning_the_gripper_changes_nothing():
    plain = find_mounts(two_fingers())
    turned = find_mounts(two_fingers(palm='pos="0.3 -0.2 1" quat="0.5 0.1 -0.7 0.3"'))
    for a, b in zip(plain.mounts, turned.mounts, strict=True):
        assert a.body == b.body
        np.testing.assert_allclose(a.pos, b.pos, atol=1e-5)
        np.testing.assert_allclose(frame(a), frame(b), atol=1e-4)


def test_free_gripper():
    xml = two_fingers().replace('<geom name="palm"', '<freejoint/><geom name="palm"').replace('qpos="0 0"', "")
    check_two(find_mounts(xml), 0.005, (0.06, 0.02))


def test_spec_is_left_as_it_is():
    spec = mujoco.MjSpec.from_string(two_fingers())
    before = spec.to_xml()
    found = find_mounts(spec)
    assert spec.to_xml() == before
    assert found.faces == find_mounts(two_fingers()).faces


def test_path(tmp_path):
    path = tmp_path / "gripper.xml"
    path.write_text(two_fingers())
    assert find_mounts(path).faces == find_mounts(str(path)).faces == find_mounts(two_fingers()).faces


def test_capsule_fingers():
    # within 1 mm of its foremost line a capsule of radius 8 mm is 7.7 mm wide
    capsule = '<geom name="{}" type="capsule" size="0.008 0.03" mass="0.05"/>'
    found = find_mounts(two_fingers(capsule.format("l"), capsule.format("r")))
    check_two(found, 0.008, (0.067, 0.0077), atol=1.5e-3)
    assert [m.replaces for m in found.mounts] == [("l",), ("r",)]
    np.testing.assert_allclose([m.pos[0] for m in found.mounts], (0.008, -0.008), atol=5e-5)


@pytest.mark.parametrize(
    ("shape", "width"),
    [('type="cylinder" size="0.008 0.03"', 0.0077), ('type="ellipsoid" size="0.008 0.01 0.03"', 0.01)],
)
def test_round_fingers(shape, width):
    found = find_mounts(two_fingers(f'<geom {shape} mass="0.05"/>', f'<geom {shape} mass="0.05"/>'))
    for mount, side in zip(found.mounts, (1, -1), strict=True):
        np.testing.assert_allclose(mount.pos, (side * 0.008, 0, 0), atol=1e-3)
        np.testing.assert_allclose(frame(mount)[:, 2], (-side, 0, 0), atol=0.05)
    assert found.faces[0].size[1] == pytest.approx(width, abs=2e-3)


def test_mesh_fingers():
    # wedges: the inner face is 40 x 20 mm, the back is narrower
    points = [(0.005, y, z) for y in (-0.01, 0.01) for z in (-0.02, 0.02)]
    points += [(-0.005, y, z) for y in (-0.005, 0.005) for z in (-0.01, 0.015)]

    def text(sign):
        return " ".join(f"{sign * x} {y} {z}" for x, y, z in points)

    asset = f'<mesh name="l" vertex="{text(1)}"/><mesh name="r" vertex="{text(-1)}"/>'
    finger = '<geom name="{0}" type="mesh" mesh="{0}" mass="0.05"/>'
    found = find_mounts(two_fingers(finger.format("l"), finger.format("r"), asset=asset))
    check_two(found, 0.005, (0.04, 0.02), atol=2e-4)


def test_pad_in_front_of_a_finger():
    # the face is the pad, 0.5 mm proud of the finger; the finger is replaced too because it would shadow taxels
    left = BOX + '<geom name="lp" type="box" pos="0.003 0 0.02" size="0.0025 0.008 0.008" mass="0"/>'
    right = BOX + '<geom name="rp" type="box" pos="-0.003 0 0.02" size="0.0025 0.008 0.008" mass="0"/>'
    found = find_mounts(two_fingers(left, right))
    check_two(found, 0.0055, (0.016, 0.016), centre=0.02)
    assert [m.replaces for m in found.mounts] == [(0, "lp"), (0, "rp")]
    assert "beyond the face" in found.report


def test_geoms_behind_the_gel_stay():
    left = '<geom name="back" type="box" pos="-0.004 0 0" size="0.005 0.01 0.03" mass="0.05"/>'
    left += '<geom name="lp" type="box" pos="0.0035 0 0" size="0.0015 0.01 0.03" mass="0"/>'
    found = find_mounts(two_fingers(left))
    assert found.mounts[0].replaces == ("lp",)


def test_pad_on_a_body_of_its_own():
    left = BOX.replace("<geom", '<geom name="l"') + (
        '<body name="left_pad" pos="0.01 0 0"><geom name="lp" type="box" pos="-0.007 0 0.02" '
        'size="0.0025 0.008 0.008" mass="0.01"/></body>'
    )
    mount = find_mounts(two_fingers(left)).mounts[0]
    assert (mount.body, mount.replaces) == ("left_pad", ("l", "lp"))
    np.testing.assert_allclose(mount.pos, (-0.0045, 0, 0.02), atol=1e-4)


@pytest.mark.parametrize("setting", ["discardvisual", "fusestatic"])
def test_unnamed_geoms_count_as_in_the_file_whatever_the_compiler_leaves_out(setting):
    looks = '<geom type="box" size="0.006 0.011 0.031" contype="0" conaffinity="0"/>'
    tip = f'<body name="{{0}}_tip" pos="0 0 0.05">{looks}{BOX}</body>'
    link = '<geom type="box" size="0.003 0.003 0.003" mass="0.01"/>'
    plain = two_fingers(link + tip.format("left"), link + tip.format("right"))
    text = plain.replace("<asset>", f'<compiler {setting}="true"/><asset>')
    found = find_mounts(text)
    assert found.mounts == find_mounts(plain).mounts
    assert [(mount.body, mount.replaces) for mount in found.mounts] == [("left_tip", (1,)), ("right_tip", (1,))]
    spec = attach(text, TaxelLayout(3, 2, 5e-3)).spec
    for side in ("left", "right"):
        assert [geom.contype for geom in spec.body(side).geoms] == [1]
        assert [geom.contype for geom in spec.body(f"{side}_tip").geoms] == [0, 0]


MOTORS = '<motor name="left" joint="left" {0}/><motor name="right" joint="right" {0}/>'


@pytest.mark.parametrize("limits", ['ctrlrange="-1 1"', 'forcerange="-2 2"', ""])
def test_motors(limits):
    found = find_mounts(two_fingers(actuators=MOTORS.format(limits)))
    check_two(found, 0.005, (0.06, 0.02))
    assert found.report.count("to 1" if "force" not in limits else "to 2") == 1


def test_servos_without_a_control_range():
    servos = '<position name="left" joint="left" kp="100"/><position name="right" joint="right" kp="100"/>'
    found = find_mounts(two_fingers(actuators=servos))
    check_two(found, 0.005, (0.06, 0.02))
    assert "left: from 0 to 0.04" in found.report


def test_one_actuator_that_moves_both():
    xml = two_fingers(actuators='<position name="grip" joint="left" kp="100" ctrlrange="0 0.04"/>')
    coupled = '<equality><joint joint1="right" joint2="left" polycoef="0 -1 0 0 0"/></equality><keyframe>'
    found = find_mounts(xml.replace("<keyframe>", coupled))
    check_two(found, 0.005, (0.06, 0.02))
    assert "grip: from 0 to 0.04" in found.report


def linkage(name, side):
    """Return a finger kept upright by its linkage, with a passive knuckle beside it; it closes towards -side."""
    return f"""
    <body name="{name}_outer" pos="{side * 0.05} 0 0.02">
      <joint name="{name}_outer" axis="0 {-side} 0" range="-0.6 0.9" damping="0.05"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.04" size="0.004" mass="0.02"/>
      <body name="{name}_finger" pos="0 0 0.05">
        <joint name="{name}_finger" axis="0 {-side} 0" range="-1 1" damping="0.05"/>
        <geom name="{name}_finger" type="box" pos="0 0 0.03" size="0.004 0.01 0.025" mass="0.02"/>
      </body>
    </body>
    <body name="{name}_knuckle" pos="{side * 0.03} 0 0.02">
      <joint name="{name}_knuckle" axis="0 {-side} 0" range="-0.6 0.9" damping="0.05"/>
      <geom type="capsule" fromto="0 0 0.01 0 0 0.05" size="0.004" mass="0.02"/>
    </body>
    """


def test_linkage():
    couplings = "".join(
        f'<joint joint1="{name}_finger" joint2="{name}_outer" polycoef="0 -1 0 0 0"/>'
        f'<joint joint1="{name}_knuckle" joint2="{name}_outer" polycoef="0 1 0 0 0"/>'
        for name in ("left", "right")
    )
    xml = f"""
    <mujoco><compiler angle="radian"/><worldbody><body name="palm"><geom type="box" size="0.07 0.02 0.01"/>
      {linkage("left", -1)} {linkage("right", 1)}
    </body></worldbody>
    <equality>{couplings}<joint joint1="right_outer" joint2="left_outer"/></equality>
    <actuator><position name="grip" joint="left_outer" kp="2" ctrlrange="-0.6 0.9"/></actuator></mujoco>
    """
    found = find_mounts(xml)
    assert [m.body for m in found.mounts] == ["left_finger", "right_finger"]
    for mount, side in zip(found.mounts, (1, -1), strict=True):
        np.testing.assert_allclose(mount.pos, (side * 0.004, 0, 0.03), atol=1e-4)
        np.testing.assert_allclose(frame(mount)[:, 1:].T, ((0, 0, 1), (-side, 0, 0)), atol=1e-3)
    assert "grip: from -0.6 to 0.9" in found.report


def test_three_fingers_around_a_centre():
    fingers = "".join(
        f"""
        <body name="arm{i}" euler="0 0 {np.radians(120 * i)}"><body name="finger{i}" pos="0.06 0 0">
          <joint name="finger{i}" axis="0 -1 0" range="-0.4 0.7" damping="0.05"/>
          <geom name="finger{i}" type="box" pos="0 0 0.04" size="0.004 0.008 0.03" mass="0.03"/>
        </body></body>
        """
        for i in range(3)
    )
    servos = "".join(f'<position joint="finger{i}" kp="2" ctrlrange="-0.4 0.7"/>' for i in range(3))
    xml = f"""<mujoco><compiler angle="radian"/><worldbody><body name="palm">
        <geom type="cylinder" size="0.07 0.01" pos="0 0 -0.03"/>
        {fingers}</body></worldbody><actuator>{servos}</actuator></mujoco>"""
    found = find_mounts(xml)
    assert [m.body for m in found.mounts] == ["finger0", "finger1", "finger2"]
    for face in found.faces:
        np.testing.assert_allclose(face.mount.pos, (-0.004, 0, 0.04), atol=1e-4)
        np.testing.assert_allclose(frame(face.mount)[:, 1:].T, ((0, 0, 1), (1, 0, 0)), atol=1e-3)
        assert len(face.opposite) == 2


def test_one_jaw_against_a_fixed_one():
    xml = """
    <mujoco><compiler angle="radian"/><worldbody><body name="base">
      <geom name="fixed" type="box" pos="0.05 0 0" size="0.05 0.01 0.004"/>
      <body name="jaw" pos="0 0 0.03">
        <joint name="jaw" axis="0 1 0" range="-1 0.3" damping="0.1"/>
        <geom name="jaw" type="box" pos="0.06 0 0" size="0.03 0.01 0.004" mass="0.05"/>
      </body>
    </body></worldbody>
    <actuator><position name="jaw" joint="jaw" kp="5" ctrlrange="-1 0.3"/></actuator></mujoco>
    """
    found = find_mounts(xml)
    base, jaw = found.mounts
    assert (base.body, base.replaces, jaw.body, jaw.replaces) == ("base", ("fixed",), "jaw", ("jaw",))
    # the outer part of the jaw, which reaches from 30 to 90 mm
    np.testing.assert_allclose(jaw.pos, (0.072, 0, -0.004), atol=1e-3)
    np.testing.assert_allclose(frame(jaw)[:, 1:].T, ((1, 0, 0), (0, 0, 1)), atol=1e-3)
    np.testing.assert_allclose(frame(base)[:, 1:].T, ((1, 0, 0), (0, 0, -1)), atol=1e-3)
    assert base.pos[2] == pytest.approx(0.004, abs=1e-4)
    assert found.faces[1].opposite == ("base",)


def test_actuator_that_does_not_close_is_held():
    spread = '<joint name="spread" axis="0 1 0" type="slide" range="-0.01 0.01" damping="5"/>'
    servo = '<position name="spread" joint="spread" kp="100" ctrlrange="-0.01 0.01"/>'
    found = find_mounts(two_fingers(left=spread + BOX, actuators=SERVOS + servo).replace('qpos="0 0"', ""))
    check_two(found, 0.005, (0.06, 0.02))
    assert "spread: held at 0, neither opens nor closes" in found.report


def test_without_actuators():
    with pytest.raises(InvalidValueError, match=r"no actuators.*by hand"):
        find_mounts(two_fingers(actuators=""))


def test_without_collision_geoms():
    xml = two_fingers().replace("<geom", '<geom contype="0" conaffinity="0"')
    with pytest.raises(InvalidValueError, match="no geom that can touch"):
        find_mounts(xml)


def test_nothing_moves():
    with pytest.raises(InvalidValueError, match="moves nothing"):
        find_mounts(
            two_fingers(
                actuators=SERVOS.replace('ctrlrange="0 0.04"', 'ctrlrange="0 0.0000001"').replace(
                    'ctrlrange="-0.04 0"', 'ctrlrange="-0.0000001 0"'
                )
            )
        )


def test_nothing_opposes():
    # the finger approaches the block but passes it
    xml = """
    <mujoco><worldbody><geom type="box" size="0.01 0.01 0.01" pos="0.1 0.08 0"/><body name="finger">
      <joint name="finger" type="slide" axis="1 0 0" damping="5"/><geom size="0.01" mass="0.1"/>
    </body></worldbody>
    <actuator><position name="finger" joint="finger" kp="100" ctrlrange="0 0.08"/></actuator></mujoco>
    """
    with pytest.raises(InvalidValueError, match=r"no jaw closes on the link that carries it.*by hand"):
        find_mounts(xml)


def test_a_finger_without_a_name():
    with pytest.raises(InvalidValueError, match=r"a pad would go on body 3 \(its parent is palm\), which has no name"):
        find_mounts(two_fingers().replace('<body name="right"', "<body"))


def test_choose_mounts_finds_for_an_unknown_gripper(tmp_path):
    mounts, report, grips = choose_mounts(load_spec(two_fingers()))
    assert len(grips) == 1
    assert (mounts, report) == (find_mounts(two_fingers()).mounts, find_mounts(two_fingers()).report)
    # the file name of a known gripper is not enough
    path = tmp_path / "panda_gripper.xml"
    path.write_text(two_fingers())
    assert choose_mounts(load_spec(path), str(path))[0] == mounts
