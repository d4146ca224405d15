"""`attach` warns of implausible mounts: once for each kind of problem, with the pads and the amounts."""

import dataclasses
import warnings

import pytest
from scenes import INTO_FINGER, OWN_GRIPPER, fingertips

import paxisim
from paxisim.models.grippers import mounts_for, robosuite_gripper_path

LAYOUT = paxisim.TaxelLayout(6, 5, (4.35e-3, 4.52e-3))
SMALL = paxisim.TaxelLayout(3, 3, (4e-3, 4e-3))


def said(gripper, pad, mounts, *, but=("sound MJCF", "no longer collide")):
    """Return the warnings of `attach` without those that have one of the phrases `but` in them."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        paxisim.attach(gripper, pad, mounts)
    return [text for text in (str(one.message) for one in caught) if not any(phrase in text for phrase in but)]


# places


def test_of_good_mounts_nothing_is_said():
    assert said(OWN_GRIPPER, LAYOUT, fingertips()) == []
    assert said(OWN_GRIPPER, LAYOUT, None) == []
    stands_out = paxisim.TaxelLayout(6, 5, (4.35e-3, 6e-3))  # by a row
    assert said(OWN_GRIPPER, stands_out, fingertips()) == []
    bench = "<mujoco><worldbody><body name='bench'/></worldbody></mujoco>"
    assert said(bench, LAYOUT, [paxisim.Mount("bench")]) == [], "no finger to compare with"


def test_a_pad_off_its_body_and_one_larger_than_its_finger_and_a_pitch_of_400_mm():
    (warning,) = said(OWN_GRIPPER, LAYOUT, fingertips(pos=(0.5, 0, -0.019)))
    assert "pads away from the body" in warning
    assert "'left_finger_pad' on 'left_finger', 500 mm" in warning
    assert "'right_finger_pad'" in warning
    (warning,) = said(OWN_GRIPPER, paxisim.TaxelLayout(6, 5, (8e-3, 8e-3)), fingertips())
    assert "larger than what they sit on: 'left_finger_pad' on 'left_finger', 50% of its 48 x 40 mm" in warning
    warning, *_ = said(OWN_GRIPPER, paxisim.TaxelLayout(2, 2, (0.4, 0.4)), fingertips())
    assert warning == "taxels larger than those of any sensor (lengths are in m): 400 x 400 mm"


def test_curved_pads_on_flat_fingers():
    finger = """<mujoco><worldbody><body name="finger"><geom name="tip" {}/></body></worldbody></mujoco>"""
    cylinder = finger.format('type="cylinder" size="0.02 0.03" euler="90 0 0"')
    mount = paxisim.Mount("finger", (0, 0, 0.02), (0, 1, 0, 0), ("tip",))
    flat = paxisim.TaxelLayout(4, 4, (6e-3, 8e-3))
    laid = paxisim.conform(flat, paxisim.finger_surface(cylinder, mount))
    assert said(cylinder, laid, [mount]) == []
    (warning,) = said(finger.format('type="box" size="0.02 0.03 0.02"'), laid, [mount])
    assert "curved pads that do not follow the surface" in warning
    assert "'finger_pad' on 'finger', by up to" in warning


def test_pads_inside_one_another_on_one_finger():
    both = [fingertips()[0], paxisim.Mount("left_finger", (0, 0, -0.01), INTO_FINGER, name="upper")]
    (warning,) = said(OWN_GRIPPER, SMALL, both)
    assert "pads inside one another" in warning
    assert "'left_finger_pad' and 'upper_pad'" in warning
    # side by side
    wide = OWN_GRIPPER.replace('size="0.004 0.012 0.014"', 'size="0.004 0.03 0.014"')
    places = {"near": -6e-3, "far": 6e-3}
    both = [dataclasses.replace(fingertips(pos=(0, y, -0.019))[0], name=name) for name, y in places.items()]
    assert said(wide, SMALL, both) == []
    # where the gripper is closed, they are meant to meet
    closed = OWN_GRIPPER.replace('pos="-0.05 0 -0.05"', 'pos="-0.0005 0 -0.05"').replace('"0 0.04"', '"-0.04 0"')
    closed = closed.replace('pos="0.05 0 -0.05"', 'pos="0.0005 0 -0.05"')
    assert said(closed, LAYOUT, fingertips(pos=(0.001, 0, -0.019))) == []


@pytest.mark.robosuite
def test_three_pairs_of_the_paper_s_pads_on_a_hand():
    mounts = mounts_for("inspire_right")
    large, inside = said(robosuite_gripper_path("inspire_right"), LAYOUT, mounts)
    assert "larger" in large
    assert inside.count(" and ") == 3


# what no longer collides

BARE = """<mujoco><worldbody><body name="finger"><joint axis="1 0 0"/>
  <geom name="bone" type="box" size=".01 .04 .005" pos="0 .04 0"/>{}
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("end", "replaces", "length"),
    [
        (0.075, ("bone",), "70"),
        (0.02, ("bone",), "55"),
        (0.04, ("bone",), "35"),
        (0.04, (), ""),  # nothing is switched off
        (0.075, ("bone", "behind"), "70"),
    ],
)
def test_a_pad_that_replaces_a_finger_longer_than_itself(end, replaces, length):
    behind = '<geom name="behind" type="box" size=".01 .04 .001" pos="0 .04 -.004"/>' if "behind" in replaces else ""
    mount = paxisim.Mount("finger", (0, end, 0.005), (0, 1, 0, 0), replaces)  # the pad is 10 mm long
    found = [text for text in said(BARE.format(behind), paxisim.TaxelLayout(2, 2, 5e-3), [mount], but=())
             if "no longer collide" in text]  # fmt: skip
    assert len(found) == bool(length)
    assert all(f"'finger_pad' on 'finger', {length} mm, and the pad is 10 mm long" in text for text in found)


def test_what_still_collides_or_is_shorter_than_the_pad_is_only_a_note():
    # another geom in its place still collides
    lower = '<geom name="lower" type="box" size=".01 .04 .0055" pos="0 .04 -.0005"/>'
    on_it = paxisim.Mount("finger", (0, 0.04, 0.005), (0, 1, 0, 0), ("bone",))
    assert not any("collide" in t for t in said(BARE.format(lower), paxisim.TaxelLayout(2, 2, 5e-3), [on_it], but=()))
    # fingers of 28 x 24 mm under pads of 19 x 19 mm, at whose tips they are found
    report = paxisim.attach(OWN_GRIPPER, paxisim.TaxelLayout(4, 4, 4.7e-3)).report
    assert (
        "note: beyond the edges of their pads, fingers no longer collide: left_finger 5 mm, right_finger 5 mm" in report
    )


# geoms that take the load of a pad


def test_a_mount_that_replaces_nothing():
    bare = [dataclasses.replace(mount, replaces=()) for mount in fingertips()]
    (warning,) = said(OWN_GRIPPER, LAYOUT, bare)
    assert warning == (
        "pads behind other geoms, or level with them, which take their load (add these to replaces of the mount): "
        "'left_finger_pad' on 'left_finger' by 'left_fingertip'; 'right_finger_pad' on 'right_finger' by "
        "'right_fingertip'"
    )


ON_A_LINK = """<mujoco><worldbody><body name="hand"><body name="finger">
  <joint type="slide" axis="0 0 1" range="0 0.03"/>
  <geom name="bone" type="box" size="0.02 0.02 0.005" pos="0 0 0.015"/>
  <body name="pulp"><geom name="pulp" type="box" size="0.02 0.02 0.005" pos="0 0 0.005"/>{on_pulp}</body>
  {on_finger}</body>{elsewhere}</body>{free}</worldbody></mujoco>"""
BOX = '<geom type="box" size="0.02 0.02 0.002" pos="0 0 {}"/>'


def on_a_link(*replaces, on_pulp="", on_finger="", elsewhere="", free=""):
    """Return what is said of a pad on a finger's pulp, with bodies or geoms added to that part of the hand."""
    text = ON_A_LINK.format(on_pulp=on_pulp, on_finger=on_finger, elsewhere=elsewhere, free=free)
    return said(text, SMALL, [paxisim.Mount("pulp", replaces=("pulp", *replaces))])


@pytest.mark.parametrize(("front", "hides"), [(-0.03, False), (-0.008, True), (0.0, True), (3e-3, True), (4e-3, False)])
def test_an_unnamed_geom_of_a_body_welded_to_the_pad(front, hides):
    """It counts from 10 mm in front of the pad (here its front is 4 mm before its back) to 3.5 mm behind."""
    welded = f'<body name="nail"><geom size="0.001" contype="0" conaffinity="0"/>{BOX.format(front + 2e-3)}</body>'
    assert on_a_link("nail/1", on_finger=welded) == []
    warned = on_a_link(on_finger=welded)
    assert [word.split(" by ")[1] for word in warned] == ["'nail/1'"] * hides


@pytest.mark.parametrize(("axis", "hides"), [("1 0 0", True), ("0 0 1", False)])
def test_another_link_hides_a_pad_if_it_is_level_with_it_in_every_pose(axis, hides):
    link = f'<body name="cap"><joint type="slide" axis="{axis}" range="0 0.02"/>{BOX.format(0.002)}</body>'
    assert on_a_link("cap/0", on_finger=link) == []
    warned = on_a_link(on_finger=link)
    assert len(warned) == hides
    assert all("by 'cap/0'" in warning for warning in warned)


def test_what_else_hides_a_pad_and_what_does_not():
    assert on_a_link(on_pulp='<geom type="sphere" size="0.05"/>')[0].endswith("by 'pulp/1'"), "deep inside a geom"
    (warning,) = on_a_link(on_finger=f"<body>{BOX.format(0.002)}</body>")
    assert warning.endswith("by a geom that has no name, nor has its body: name it")
    beside = '<geom type="box" size="0.005 0.005 0.005" pos="0.0115 0 0.005"/>'
    assert on_a_link(on_pulp=beside) == [], "it takes none of the pad's area"
    assert on_a_link(elsewhere=f'<body name="jaw">{BOX.format(-0.002)}</body>') == [], "the finger meets it"
    assert on_a_link(free=f'<body name="peg"><freejoint/>{BOX.format(0.0)}</body>') == []
