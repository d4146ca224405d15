"""`attach` warns of implausible mounts: once for each kind of problem, with the pads and the amounts."""

import warnings
from importlib.resources import files

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


@pytest.mark.robosuite
def test_three_pairs_of_the_paper_s_pads_on_a_hand():
    mounts = mounts_for("inspire_right")
    large, inside = said(robosuite_gripper_path("inspire_right"), LAYOUT, mounts)
    assert "larger" in large
    assert inside.count(" and ") == 3
    assert said(robosuite_gripper_path("inspire_right"), paxisim.TaxelLayout(4, 3, (4e-3, 4e-3)), mounts) == []


def test_a_body_without_geoms_has_no_finger_to_compare_with():
    assert said("<mujoco><worldbody><body name='bench'/></worldbody></mujoco>", LAYOUT, [paxisim.Mount("bench")]) == []
