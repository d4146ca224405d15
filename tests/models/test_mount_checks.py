"""`attach` warns of implausible mounts: once for each kind of problem, with the pads and the amounts."""

import dataclasses
import warnings
from importlib.resources import files

import mujoco
import pytest

import paxisim
from paxisim.models.grippers import mounts_for, robosuite_gripper_path

GRIPPER = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
LAYOUT = paxisim.TaxelLayout(6, 5, (4.35e-3, 4.52e-3))
FLAT = {"quat": (0.5, -0.5, -0.5, 0.5)}


def said(gripper, pad, mounts):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        paxisim.attach(gripper, pad, mounts)
    return [str(warning.message) for warning in caught if "sound MJCF" not in str(warning.message)]


def fingertips(**changed):
    return [
        paxisim.Mount(f"{side}_finger", **{"pos": (0, 0, -0.019), **FLAT, **changed}, replaces=(f"{side}_fingertip",))
        for side in ("left", "right")
    ]


def test_of_good_mounts_nothing_is_said():
    assert said(GRIPPER, LAYOUT, fingertips()) == []
    assert said(GRIPPER, LAYOUT, None) == []


def test_a_pad_half_a_metre_off_its_body():
    (warning,) = said(GRIPPER, LAYOUT, fingertips(pos=(0.5, 0, -0.019)))
    assert "pads away from the body" in warning
    assert "'left_finger_pad' on 'left_finger', 500 mm" in warning
    assert "'right_finger_pad'" in warning


def test_a_pad_larger_than_its_finger():
    (warning,) = said(GRIPPER, paxisim.TaxelLayout(6, 5, (8e-3, 8e-3)), fingertips())
    assert "larger than what they sit on: 'left_finger_pad' on 'left_finger', 50% of its 48 x 40 mm" in warning


def test_a_pad_that_stands_out_by_a_row_is_not_worth_a_word():
    assert said(GRIPPER, paxisim.TaxelLayout(6, 5, (4.35e-3, 6e-3)), fingertips()) == []


def test_a_pitch_of_400_mm():
    warning, *_ = said(GRIPPER, paxisim.TaxelLayout(2, 2, (0.4, 0.4)), fingertips())
    assert warning == "taxels larger than those of any sensor (lengths are in m): 400 x 400 mm"


def test_a_curved_fingertip_on_a_flat_finger():
    pytest.importorskip("paxini_sdk")
    curved = paxisim.sensor("paxini-gen3-dp-s2015").layout
    (warning,) = said(GRIPPER, curved, fingertips())
    assert "curved pads that do not follow the surface" in warning
    assert "'left_finger_pad' on 'left_finger', by up to" in warning


def test_a_pad_that_was_laid_onto_its_finger():
    finger = """<mujoco><worldbody><body name="finger">
      <geom name="tip" type="cylinder" size="0.02 0.03" euler="90 0 0"/>
    </body></worldbody></mujoco>"""
    mount = paxisim.Mount("finger", (0, 0, 0.02), (0, 1, 0, 0), ("tip",))
    flat = paxisim.TaxelLayout(4, 4, (6e-3, 8e-3))
    laid = paxisim.conform(flat, paxisim.finger_surface(finger, mount))
    assert said(finger, laid, [mount]) == []
    flat_finger = finger.replace('type="cylinder" size="0.02 0.03" euler="90 0 0"', 'type="box" size="0.02 0.03 0.02"')
    (warning,) = said(flat_finger, laid, [mount])
    assert "do not follow the surface" in warning


def test_pads_inside_one_another_on_one_finger():
    both = [*fingertips()[:1], paxisim.Mount("left_finger", (0, 0, -0.01), **FLAT, name="upper")]
    (warning,) = said(GRIPPER, paxisim.TaxelLayout(3, 3, (4e-3, 4e-3)), both)
    assert "pads inside one another" in warning
    assert "'left_finger_pad' and 'upper_pad'" in warning


def test_pads_side_by_side_are_not_inside_one_another():
    wide = GRIPPER.replace('size="0.004 0.012 0.014"', 'size="0.004 0.03 0.014"')
    both = [
        paxisim.Mount("left_finger", (0, y, -0.019), **FLAT, replaces=("left_fingertip",), name=name)
        for name, y in (("near", -0.006), ("far", 0.006))
    ]
    assert said(wide, paxisim.TaxelLayout(3, 3, (4e-3, 4e-3)), both) == []


def test_pads_that_meet_where_the_gripper_is_closed_are_meant():
    closed = GRIPPER.replace('pos="-0.05 0 -0.05"', 'pos="-0.0005 0 -0.05"').replace('"0 0.04"', '"-0.04 0"')
    closed = closed.replace('pos="0.05 0 -0.05"', 'pos="0.0005 0 -0.05"')
    assert said(closed, LAYOUT, fingertips(pos=(0.001, 0, -0.019))) == []


def test_a_mount_that_replaces_nothing():
    """Its fingertip is level with the pad, and takes most of the load."""
    mounts = fingertips()
    bare = [dataclasses.replace(mount, replaces=()) for mount in mounts]
    (warning,) = said(GRIPPER, LAYOUT, bare)
    assert warning == (
        "pads behind other geoms, or level with them, which take their load (add these to replaces of the mount): "
        "'left_finger_pad' on 'left_finger' by 'left_fingertip'; 'right_finger_pad' on 'right_finger' by "
        "'right_fingertip'"
    )
    assert share_of_pads(mounts) == pytest.approx(1, abs=1e-3)
    with pytest.warns(UserWarning, match="pads behind"):
        assert share_of_pads(bare) < 0.3


def share_of_pads(mounts):
    """Return the share of the gripper's force on a peg that its pads read."""
    gripper = paxisim.attach(GRIPPER, LAYOUT, mounts)
    peg = gripper.spec.worldbody.add_body(name="peg", pos=[0, 0, -0.07])
    peg.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.012, 0.009, 0.03])
    model = gripper.compile()
    readout = paxisim.TactileReadout(model, gripper.bind(model))
    data = mujoco.MjData(model)
    data.ctrl[0] = 3
    mujoco.mj_step(model, data, 800)
    return readout.read(data)[:, 2].sum() / 6


ON_A_LINK = """<mujoco><worldbody><body name="hand"><body name="finger">
  <joint type="slide" axis="0 0 1" range="0 0.03"/>
  <geom name="bone" type="box" size="0.02 0.02 0.005" pos="0 0 0.015"/>
  <body name="pulp"><geom name="pulp" type="box" size="0.02 0.02 0.005" pos="0 0 0.005"/>{welded}</body>
  {welded_to_finger}</body>{elsewhere}</body></worldbody></mujoco>"""
BOX = '<geom type="box" size="0.02 0.02 0.002" pos="0 0 {}"/>'


def on_a_link(*replaces, welded="", welded_to_finger="", elsewhere=""):
    text = ON_A_LINK.format(welded=welded, welded_to_finger=welded_to_finger, elsewhere=elsewhere)
    pads = paxisim.TaxelLayout(3, 3, (4e-3, 4e-3))
    return said(text, pads, [paxisim.Mount("pulp", replaces=("pulp", *replaces))])


@pytest.mark.parametrize(("front", "hides"), [(-0.03, False), (-0.008, True), (0.0, True), (3e-3, True), (4e-3, False)])
def test_an_unnamed_geom_of_a_body_welded_to_the_pad(front, hides):
    """It counts from 10 mm in front of the pad (here its front is 4 mm before its back) to 3.5 mm behind."""
    welded = f'<body name="nail"><geom size="0.001" contype="0" conaffinity="0"/>{BOX.format(front + 2e-3)}</body>'
    assert on_a_link("nail/1", welded_to_finger=welded) == []
    warned = on_a_link(welded_to_finger=welded)
    assert [word.split(" by ")[1] for word in warned] == ["'nail/1'"] * hides


def test_a_pad_deep_inside_a_geom():
    assert on_a_link(welded='<geom type="sphere" size="0.05"/>')[0].endswith("by 'pulp/1'")


def test_a_geom_without_a_name_on_a_body_without_one():
    (warning,) = on_a_link(welded_to_finger=f"<body>{BOX.format(0.002)}</body>")
    assert warning.endswith("by a geom that has no name, nor has its body: name it")


def test_a_geom_beside_the_pad_takes_none_of_its_area():
    assert on_a_link(welded='<geom type="box" size="0.005 0.005 0.005" pos="0.0115 0 0.005"/>') == []


@pytest.mark.parametrize(("axis", "hides"), [("1 0 0", True), ("0 0 1", False)])
def test_another_link_hides_a_pad_if_it_is_level_with_it_in_every_pose(axis, hides):
    link = f'<body name="cap"><joint type="slide" axis="{axis}" range="0 0.02"/>{BOX.format(0.002)}</body>'
    assert on_a_link("cap/0", welded_to_finger=link) == []
    warned = on_a_link(welded_to_finger=link)
    assert len(warned) == hides
    assert all("by 'cap/0'" in warning for warning in warned)


def test_what_the_finger_meets_when_it_closes_does_not_hide_its_pad():
    assert on_a_link(elsewhere=f'<body name="jaw">{BOX.format(-0.002)}</body>') == []
    text = ON_A_LINK.format(welded="", welded_to_finger="", elsewhere="")
    text = text.replace("</worldbody>", f'<body name="peg"><freejoint/>{BOX.format(0.0)}</body></worldbody>')
    mount = paxisim.Mount("pulp", replaces=("pulp",))
    assert said(text, paxisim.TaxelLayout(3, 3, (4e-3, 4e-3)), [mount]) == []


@pytest.mark.robosuite
def test_three_pairs_of_the_paper_s_pads_on_a_hand():
    mounts = mounts_for("inspire_right")
    large, inside = said(robosuite_gripper_path("inspire_right"), LAYOUT, mounts)
    assert "larger" in large
    assert inside.count(" and ") == 3
    assert said(robosuite_gripper_path("inspire_right"), paxisim.TaxelLayout(4, 3, (4e-3, 4e-3)), mounts) == []


def test_a_body_without_geoms_has_no_finger_to_compare_with():
    assert said("<mujoco><worldbody><body name='bench'/></worldbody></mujoco>", LAYOUT, [paxisim.Mount("bench")]) == []
