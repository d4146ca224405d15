"""`squeeze`: which share of the load the pads of right and wrong mounts carry."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import paxisim

LAYOUT = paxisim.TaxelLayout(4, 3, 4e-3)
HANDS = Path(__file__).parents[2].parent / "shared" / "data" / "hands"
slow = pytest.mark.slow

# two fingers on slides along x, 60 mm apart when open; their inner faces are 5 mm from their bodies' origins
TWO_FINGERS = """
<mujoco>
  <default><geom contype="1" conaffinity="1" margin="0.001"/><joint damping="5" frictionloss="0.01"/></default>
  <worldbody>
    {before}
    <body name="palm" pos="{x} 0 0.3">
      {joint}
      <geom name="palm" type="box" size="0.05 0.02 0.01" pos="0 0 -0.05"/>
      <body name="left" pos="-0.035 0 0"><joint name="left" type="slide" axis="1 0 0" range="0 0.03"/>{left}</body>
      <body name="right" pos="0.035 0 0"><joint name="right" type="slide" axis="1 0 0" range="-0.03 0"/>{right}</body>
    </body>
  </worldbody>
  <actuator>
    {actuators}
    <position name="left" joint="left" kp="1000" ctrlrange="0 0.03"/>
    <position name="right" joint="right" kp="1000" ctrlrange="-0.03 0"/>
  </actuator>
  <keyframe><key name="rest"/></keyframe>
</mujoco>"""
BLOCK = '<geom type="box" size="0.005 0.01 0.02" mass="0.05"/>'


def two_fingers(left=BLOCK, right=BLOCK, *, joint="", before="", actuators="", x=0.0):
    return TWO_FINGERS.format(left=left, right=right, joint=joint, before=before, actuators=actuators, x=x)


def quat_of(inward):
    """Return the orientation of a pad with z along `inward` and y along the link's z."""
    quat, y = np.zeros(4), np.array([0.0, 0, 1])
    mujoco.mju_mat2Quat(quat, np.stack([np.cross(y, inward), y, inward], axis=1).reshape(-1))
    return tuple(quat)


def mount(body, side, *, x=0.005, z=0.0, replaces=(0,)):
    """Return the mount on a finger's inner face, which is at +x of the left finger."""
    return paxisim.Mount(body, (side * x, 0, z), quat_of((-side, 0, 0)), replaces)


PAIR = (mount("left", 1), mount("right", -1))


def squeezed(gripper, mounts=None, openings=(0.5,)):
    return paxisim.squeeze(paxisim.attach(gripper, LAYOUT, mounts), openings=openings)


def test_the_pads_of_right_mounts_carry_everything_at_every_opening():
    result = paxisim.squeeze(paxisim.attach(two_fingers(), LAYOUT, PAIR))
    assert result.passed
    assert len(result.squeezes) == 6
    for one in result.squeezes:
        assert one.pads == ("left_pad", "right_pad")
        assert one.share == pytest.approx(1)
        assert not one.others
        assert one.read == pytest.approx(one.solver, rel=1e-6)
        assert one.read == pytest.approx([5, 5], rel=0.3)
        assert one.loaded.tolist() == [12, 12]
    thickness = [float(one.object.split()[1]) for one in result.squeezes[::2]]
    assert thickness == pytest.approx([0.2 * 60, 0.5 * 60, 0.8 * 60], abs=1)


# wrong mounts


def test_a_pad_between_corners_that_stick_out_does_not_pass_and_the_corners_are_named():
    corners = [("{side}_corner", 0.008, 0.01), ("", -0.008, 0.01), ("", 0.008, -0.01), ("", -0.008, -0.01)]
    text = BLOCK + "".join(
        f'<geom name="{name}" type="box" size="0.005 0.002 0.002" pos="{{x}} {y} {z}" mass="0"/>'
        for name, y, z in corners
    )
    result = squeezed(two_fingers(text.format(x=0.001, side="left"), text.format(x=-0.001, side="right")), PAIR)
    assert not result.passed
    assert max(result.shares.values()) < 0.9
    named = {name for one in result.squeezes for name in one.others}
    assert {"left_corner", "left/2", "right_corner", "right/4"} <= named
    assert "left_corner (" in str(result)
    assert "less than 95 %" in str(result)
    assert max(map(len, str(result).splitlines())) <= 100


@pytest.mark.filterwarnings("ignore:pads behind other geoms")
def test_a_geom_that_the_mount_forgot_to_replace_and_a_pad_that_faces_away():
    result = squeezed(two_fingers(), (mount("left", 1, replaces=()), mount("right", -1)))
    assert all("left/0" in one.others for one in result.squeezes)
    assert result.shares["left_pad"] < 0.6
    result = squeezed(two_fingers(), (mount("left", -1), mount("right", 1)))
    assert not result.passed
    assert set(result.shares.values()) == {0.0}


def test_a_pad_off_centre_still_reads_and_only_a_large_object_finds_the_bare_part():
    # the finger is longer than the pad, and only the upper half of its face is replaced
    halves = (
        '<geom type="box" size="0.005 0.01 0.01" pos="0 0 0.01" mass="0.05"/>'
        '<geom name="{}_lower" type="box" size="0.005 0.01 0.01" pos="0 0 -0.01" mass="0.05"/>'
    )
    mounts = (mount("left", 1, z=0.008), mount("right", -1, z=0.008))
    result = squeezed(two_fingers(halves.format("left"), halves.format("right")), mounts)
    small, large = result.squeezes[::2], result.squeezes[1::2]
    assert all(one.share == pytest.approx(1) for one in small)
    assert all(one.share < 0.9 and {"left_lower", "right_lower"} <= set(one.others) for one in large)
    assert not result.passed


# other grippers

JAW = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="fixed"><geom type="box" size="0.005 0.01 0.02" pos="-0.005 0 0.06"/></body>
    <body name="jaw" pos="0.01 0 0">
      <joint name="jaw" type="hinge" axis="0 -1 0" range="-0.7 0.2" damping="0.05"/>
      <geom type="box" size="0.005 0.01 0.02" pos="0.005 0 0.06" mass="0.05"/>
    </body>
  </worldbody>
  <actuator><position name="jaw" joint="jaw" kp="5" ctrlrange="-0.7 0.2"/></actuator>
</mujoco>"""


def test_a_jaw_squeezes_a_cylinder_against_a_fixed_one():
    mounts = (mount("fixed", 1, x=0.0, z=0.06), mount("jaw", -1, x=0.0, z=0.06))
    result = squeezed(JAW, mounts, openings=(0.2, 0.8))
    assert result.passed, str(result)
    assert result.squeezes[-1].object.startswith("cylinder")
    assert result.squeezes[-1].read.min() > 2


def test_three_fingers_hold_a_cylinder():
    bodies = servos = ""
    for i, angle in enumerate((0, 120, 240)):
        x, y = 0.045 * np.cos(np.radians(angle)), 0.045 * np.sin(np.radians(angle))
        bodies += f"""<body name="finger{i}" pos="{x} {y} 0" euler="0 0 {angle}">
          <joint name="f{i}" type="slide" axis="-1 0 0" range="0 0.03" damping="5"/>{BLOCK}</body>"""
        servos += f'<position name="f{i}" joint="f{i}" kp="1000" ctrlrange="0 0.03"/>'
    text = f"<mujoco><worldbody>{bodies}</worldbody><actuator>{servos}</actuator></mujoco>"
    result = squeezed(text, [mount(f"finger{i}", -1) for i in range(3)])
    assert result.passed, str(result)
    assert all(one.object.startswith("cylinder") and len(one.pads) == 3 for one in result.squeezes)
    assert all(one.read == pytest.approx(5, rel=0.3) for one in result.squeezes)


def joint(name, axis="1 0 0", end=1.0):
    return f'<joint name="{name}" axis="{axis}" range="0 {end}" damping="0.02" armature="0.0002"/>'


def pressed(ridge=""):
    """Press a plate with a thumb and with two fingers of two joints each, whose last links carry pads."""
    fingers = "".join(
        f"""<body name="{name}" pos="{x} 0 0">{joint(f"{name}_1", end=1.2)}
          <geom type="box" size="0.007 0.005 0.018" pos="0 0 0.018" mass="0.02"/>
          <body name="{name}_tip" pos="0 0 0.04">{joint(f"{name}_2")}
            <geom type="box" size="0.007 0.005 0.01" pos="0 0 0.01" mass="0.01"/>{ridge}</body></body>"""
        for name, x in (("index", -0.012), ("middle", 0.012))
    )
    thumb = f"""<body name="thumb" pos="0 -0.06 -0.02">{joint("thumb", "-1 0 0")}
      <geom type="box" size="0.007 0.005 0.02" pos="0 0 0.02" mass="0.02"/></body>"""
    joints = ("index_1", "index_2", "middle_1", "middle_2", "thumb")
    servos = "".join(f'<position name="{j}" joint="{j}" kp="3" ctrlrange="0 1"/>' for j in joints)
    text = f"""<mujoco><compiler angle="radian"/><worldbody><body name="palm">
      <geom type="box" size="0.03 0.005 0.03" pos="0 0.005 -0.03"/>{fingers}{thumb}</body></worldbody>
      <actuator>{servos}</actuator></mujoco>"""
    mounts = [paxisim.Mount(f"{n}_tip", (0, -0.005, 0.01), quat_of((0, 1, 0)), (0,)) for n in ("index", "middle")]
    mounts.append(paxisim.Mount("thumb", (0, 0.005, 0.03), quat_of((0, -1, 0)), (0,)))
    gripper = paxisim.attach(text, paxisim.TaxelLayout(3, 2, 5e-3), mounts)
    model = gripper.compile()
    low, high = model.actuator_ctrlrange.T.copy()
    qpos = np.linspace(model.qpos0, model.jnt_range[:, 1], 20)
    grip = paxisim.Grip((0, 1, 2), tuple(range(model.nu)), low, high, qpos, ((), (), ()))
    return paxisim.squeeze(gripper, [grip], openings=(0.5, 0.8))


def test_each_finger_of_a_hand_presses_a_plate_by_itself_and_a_ridge_beside_the_pulp_is_named():
    result = pressed()
    assert result.passed, str(result)
    assert [one.pads for one in result.squeezes[::4]] == [("index_tip_pad",), ("middle_tip_pad",), ("thumb_pad",)]
    assert all(one.object.startswith("plate") for one in result.squeezes)
    assert all(one.read[0] == pytest.approx(5, rel=0.3) for one in result.squeezes)
    result = pressed('<geom type="box" size="0.008 0.007 0.002" pos="0 0 0.02" mass="0"/>')
    assert result.shares["index_tip_pad"] < 0.9
    assert result.shares["thumb_pad"] == pytest.approx(1)
    assert any("index_tip/1" in one.others for one in result.squeezes)


def test_the_joints_of_an_arm_hold_still():
    joints = """<joint name="lift" type="slide" axis="0 0 1"/><joint name="turn" axis="0 1 0" damping="0.1"/>
      <geom type="sphere" size="0.01" pos="0 0 -0.2" mass="1"/>"""
    servos = '<motor name="lift" joint="lift"/><position name="turn" joint="turn" kp="50"/>'
    floor = '<geom name="floor" type="plane" size="1 1 1"/>'
    gripper = paxisim.attach(two_fingers(joint=joints, actuators=servos, x=0.2, before=floor), LAYOUT, PAIR)
    # the arm's servo would turn it back to 0 and nothing lifts it
    qpos = np.linspace([0.1, 0.4, 0, 0], [0.1, 0.4, 0.03, -0.03], 9)
    grip = paxisim.Grip((0, 1), (2, 3), np.zeros(4), np.array([0, 0, 0.03, -0.03]), qpos, ((1,), (0,)))
    result = paxisim.squeeze(gripper, [grip], openings=(0.5,))
    assert result.passed, str(result)
    assert all(one.read == pytest.approx([5, 5], rel=0.3) for one in result.squeezes)


@pytest.mark.filterwarnings("ignore:pads behind other geoms")
def test_pads_that_nothing_closes_are_reported_and_what_cannot_be_squeezed_is_refused():
    gripper = paxisim.attach(two_fingers(), LAYOUT, (*PAIR, paxisim.Mount("palm", (0, 0, -0.04), (0, 1, 0, 0))))
    palm, left, right = (gripper.pad_names.index(f"{name}_pad") for name in ("palm", "left", "right"))
    (closing,) = gripper.grips
    ctrl = (closing.open_ctrl, closing.close_ctrl, closing.qpos)
    for pads, partners in (((left, right), ((right,), (left,))), ((left, right, palm), ((right,), (left,), ()))):
        result = paxisim.squeeze(gripper, [paxisim.Grip(pads, (0, 1), *ctrl, partners)], openings=(0.5,))
        assert list(result.untested) == ["palm_pad"]
        assert not result.passed
        assert "palm_pad: not tested" in str(result)
    for arguments, message in (
        ({"grips": []}, "nothing to squeeze with"),
        ({"openings": (20,)}, "shares between 0 and 1"),
        ({"force": 0}, "force must be positive"),
    ):
        with pytest.raises(paxisim.InvalidValueError, match=message):
            paxisim.squeeze(gripper, **arguments)


@pytest.mark.skipif(not HANDS.is_dir(), reason="the public hands are not here")
@pytest.mark.parametrize("file", ["robotiq_2f85/2f85.xml", pytest.param("ufactory_xarm7/hand.xml", marks=slow)])
def test_public_grippers_with_right_mounts_pass(file):
    result = squeezed(HANDS / file)
    assert result.passed, str(result)


@slow
@pytest.mark.skipif(not HANDS.is_dir(), reason="the public hands are not here")
@pytest.mark.filterwarnings("ignore:pads behind other geoms")
@pytest.mark.parametrize(("replaces", "passes"), [((3, 4, 5, 6, 7), True), ((3, 4), False)])
def test_the_panda_passes_only_if_all_boxes_of_its_fingertips_are_replaced(replaces, passes):
    mounts = [paxisim.Mount(f"{n}_finger", (0, 0, 0.0445), quat_of((0, 1, 0)), replaces) for n in ("left", "right")]
    result = squeezed(HANDS / "franka_emika_panda" / "hand.xml", mounts)
    assert result.passed == passes, str(result)
