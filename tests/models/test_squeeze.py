"""`squeeze`: which share of the load the pads of right and wrong mounts carry."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from fingers import BOX, bending_hand, on_arm, one_jaw, robot, three_fingers, two_fingers

import paxisim
from paxisim.models import bench

LAYOUT = paxisim.TaxelLayout(4, 3, 4e-3)
HANDS = Path(__file__).parents[2].parent / "shared" / "data" / "hands"
slow = pytest.mark.slow

# of geoms and joints as public grippers have them
SETTINGS = """<default><geom margin="0.001"/><joint frictionloss="0.01"/></default>
  <keyframe><key name="rest"/></keyframe>"""


def gripper_of(left=BOX, right=BOX):
    """Return two fingers whose servos are strong enough for 5 N at any opening."""
    return robot(two_fingers(left=left, right=right), extra=SETTINGS).replace('kp="200"', 'kp="1000"')


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
    result = paxisim.squeeze(paxisim.attach(gripper_of(), LAYOUT, PAIR))
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
    assert thickness == pytest.approx([0.2 * 80, 0.5 * 80, 0.8 * 80], abs=1)


def test_the_result_prints_a_line_for_each_pad_and_names_few_taxels():
    result = paxisim.squeeze(paxisim.attach(gripper_of(), LAYOUT, PAIR))
    head, *pads, verdict = str(result).splitlines()
    assert head.split("  ")[-1] == "taxels touched, of 12"
    assert [line.split()[:4] for line in pads] == [[f"{side}_pad", "6", "boxes", "100"] for side in ("left", "right")]
    assert all(line.endswith(" 12") for line in pads)
    assert verdict == "the pads carry all of the load"
    assert repr(result) == "SqueezeResult(6 objects, passed)"
    edge = dataclasses.replace(result.squeezes[0], loaded=np.array([12, 1]))
    result = dataclasses.replace(result, squeezes=(edge, *result.squeezes[1:]))
    assert result.touched == {"left_pad": 12, "right_pad": 1}
    assert str(result).splitlines()[2].endswith(" 1..12")
    assert str(result).endswith("the pads carry all of the load, but some objects touch few taxels: right_pad 1 of 12")


@pytest.mark.parametrize(("note", "said"), [(bench._SLIPPED, "it was ejected"), (bench._UNSTABLE, "unstable")])
def test_of_an_object_that_is_ejected_no_force_is_told(monkeypatch, note, said):
    drive, read = bench.Bench._drive, bench.Bench._read

    def ejecting(self, actuators, ramp, *, limit=np.inf, **options):
        return drive(self, actuators, ramp, limit=limit, **options) or ("" if limit == np.inf else note)

    def huge(self, data, note):
        loads = read(self, data, note)
        return dataclasses.replace(loads, normal=1e5 * loads.normal, read=1e5 * loads.read, solver=1e5 * loads.solver)

    monkeypatch.setattr(bench.Bench, "_drive", ejecting)
    monkeypatch.setattr(bench.Bench, "_read", huge)
    result = squeezed(gripper_of(), PAIR)
    assert not result.passed
    assert str(result).count(said) == len(result.squeezes)
    assert max(float(word) for word in re.findall(r"(\S+) N", str(result))) == 0


# wrong mounts


def test_a_pad_between_corners_that_stick_out_does_not_pass_and_the_corners_are_named():
    corners = [("{side}_corner", 0.008, 0.01), ("", -0.008, 0.01), ("", 0.008, -0.01), ("", -0.008, -0.01)]
    text = BOX + "".join(
        f'<geom name="{name}" type="box" size="0.005 0.002 0.002" pos="{{x}} {y} {z}" mass="0"/>'
        for name, y, z in corners
    )
    result = squeezed(gripper_of(text.format(x=0.001, side="left"), text.format(x=-0.001, side="right")), PAIR)
    assert not result.passed
    assert max(result.shares.values()) < 0.9
    named = {name for one in result.squeezes for name in one.others}
    assert {"left_corner", "left/2", "right_corner", "right/4"} <= named
    assert "left_corner (" in str(result)
    assert "less than 95 %" in str(result)
    assert max(map(len, str(result).splitlines())) <= 100


@pytest.mark.filterwarnings("ignore:pads behind other geoms")
def test_a_geom_that_the_mount_forgot_to_replace_and_a_pad_that_faces_away():
    result = squeezed(gripper_of(), (mount("left", 1, replaces=()), mount("right", -1)))
    assert all("left/0" in one.others for one in result.squeezes)
    assert result.shares["left_pad"] < 0.6
    result = squeezed(gripper_of(), (mount("left", -1), mount("right", 1)))
    assert not result.passed
    assert set(result.shares.values()) == {0.0}


def test_a_pad_off_centre_still_reads_and_only_a_large_object_finds_the_bare_part():
    # the finger is longer than the pad, and only the upper half of its face is replaced
    halves = (
        '<geom type="box" size="0.005 0.01 0.01" pos="0 0 0.01" mass="0.05"/>'
        '<geom name="{}_lower" type="box" size="0.005 0.01 0.01" pos="0 0 -0.01" mass="0.05"/>'
    )
    mounts = (mount("left", 1, z=0.008), mount("right", -1, z=0.008))
    result = squeezed(gripper_of(halves.format("left"), halves.format("right")), mounts)
    small, large = result.squeezes[::2], result.squeezes[1::2]
    assert all(one.share == pytest.approx(1) for one in small)
    assert all(one.share < 0.9 and {"left_lower", "right_lower"} <= set(one.others) for one in large)
    assert not result.passed


# other grippers


@pytest.mark.parametrize(
    ("hand", "opening", "pads"), [(one_jaw(), 0.8, 2), (three_fingers(), 0.5, 3)], ids=["one jaw", "three fingers"]
)
def test_jaws_that_turn_hold_a_cylinder(hand, opening, pads):
    mounts = paxisim.find_mounts(robot(hand)).mounts
    result = squeezed(robot(hand), mounts, openings=(0.2, opening))
    assert result.passed, str(result)
    assert result.squeezes[-1].object.startswith("cylinder")
    assert all(len(one.pads) == pads and one.read.min() > 2 for one in result.squeezes)


def pressed(ridge=""):
    """Press a plate with each finger of a bending hand, whose last links carry pads; two fingers may have a ridge."""
    bodies, servos = bending_hand()
    tip = '<geom type="capsule" fromto="0 0 0 0.03 0 0" size="0.008" mass="0.02"/>'
    text = robot((bodies.replace(tip, tip + ridge, 2), servos.replace('kp="1"', 'kp="3"')))
    mounts = [paxisim.Mount(f"f{i}_2", (0.015, 0, -0.008), (1, 0, 0, -1), (0,)) for i in range(2)]
    mounts.append(paxisim.Mount("thumb_2", (0.015, 0, 0.008), (0, 1, 1, 0), (0,)))
    gripper = paxisim.attach(text, paxisim.TaxelLayout(3, 2, 5e-3), mounts)
    model = gripper.compile()
    low, high = model.actuator_ctrlrange.T.copy()
    qpos = np.linspace(model.qpos0, model.jnt_range[:, 1], 20)
    grip = paxisim.Grip((0, 1, 2), tuple(range(model.nu)), low, high, qpos, ((), (), ()))
    return paxisim.squeeze(gripper, [grip], openings=(0.5, 0.8))


def test_each_finger_of_a_hand_presses_a_plate_by_itself_and_a_ridge_beside_the_pulp_is_named():
    result = pressed()
    assert result.passed, str(result)
    assert [one.pads for one in result.squeezes[::4]] == [("f0_2_pad",), ("f1_2_pad",), ("thumb_2_pad",)]
    assert all(one.object.startswith("plate") for one in result.squeezes)
    assert all(one.read[0] == pytest.approx(5, rel=0.3) for one in result.squeezes)
    result = pressed('<geom type="box" size="0.002 0.007 0.002" pos="0.025 0 -0.008" mass="0"/>')
    assert result.shares["f0_2_pad"] < 0.9
    assert result.shares["thumb_2_pad"] == pytest.approx(1)
    assert any("f0_2/1" in one.others for one in result.squeezes)


def test_the_joints_of_an_arm_hold_still():
    floor = '<geom name="floor" type="plane" size="1 1 1"/>'
    gripper = paxisim.attach(robot(on_arm(two_fingers(), joints=2), extra=SETTINGS, world=floor), LAYOUT, PAIR)
    # the arm's servos would turn it back to 0
    qpos = np.linspace([0.1, 0.4, 0, 0], [0.1, 0.4, 0.04, -0.04], 9)
    grip = paxisim.Grip((0, 1), (2, 3), np.zeros(4), np.array([0, 0, 0.04, -0.04]), qpos, ((1,), (0,)))
    result = paxisim.squeeze(gripper, [grip], openings=(0.5,))
    assert result.passed, str(result)
    assert all(one.read == pytest.approx([5, 5], rel=0.3) for one in result.squeezes)


@pytest.mark.filterwarnings("ignore:pads behind other geoms")
def test_pads_that_nothing_closes_are_reported_and_what_cannot_be_squeezed_is_refused():
    gripper = paxisim.attach(gripper_of(), LAYOUT, (*PAIR, paxisim.Mount("palm", quat=(0, 1, 0, 0))))
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
