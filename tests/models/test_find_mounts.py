"""`find_mounts` on grippers of two and three fingers: which faces it finds, what they replace, and what it refuses."""

from __future__ import annotations

import functools

import mujoco
import numpy as np
import pytest
from fingers import BOX, box, check_two, on_arm, one_jaw, robot, three_fingers, two_fingers
from scenes import axes_of

from paxisim import InvalidValueError, TaxelLayout, UnknownNameError, attach, find_mounts
from paxisim.models.find_mounts import choose_mounts
from paxisim.models.load import load_spec

PLAIN = robot(two_fingers())
find_once = functools.cache(find_mounts)


def test_box_fingers_and_the_report():
    found = find_once(PLAIN)
    check_two(found)
    assert [m.replaces for m in found.mounts] == [(0,), (0,)]
    assert [f.opposite for f in found.faces] == [("right",), ("left",)]
    assert all(f.flatness < 1e-6 and f.fill > 0.9 for f in found.faces)
    np.testing.assert_allclose(found.open_qpos, 0, atol=1e-3)
    assert np.all(np.abs(found.grasp_qpos) > 0.03)
    assert found.model.nq == 2
    for words in (
        "left: from 0 to 0.04",
        "right: from 0 to -0.04",
        "left opposes right",
        "80.0 mm apart when open",
        "face of 60.0 x 20.0 mm",
        "switches off left/0",
    ):
        assert words in found.report


def test_the_same_again_from_a_spec_or_a_file_turned_or_free(tmp_path):
    plain = find_once(PLAIN)
    spec = mujoco.MjSpec.from_string(PLAIN)
    before = spec.to_xml()
    path = tmp_path / "panda_gripper.xml"  # the file name of a known gripper is not enough
    path.write_text(PLAIN)
    for source in (spec, path, str(path)):
        assert find_mounts(source).faces == plain.faces
    assert spec.to_xml() == before
    mounts, report, grips = choose_mounts(load_spec(path), str(path))
    assert (mounts, report, len(grips)) == (plain.mounts, plain.report, 1)
    rest = '<keyframe><key name="rest" qpos="0 0"/></keyframe>'
    turned = find_mounts(robot(two_fingers(pose='pos="0.3 -0.2 1" quat="0.5 0.1 -0.7 0.3"'), extra=rest))
    for a, b in zip(plain.mounts, turned.mounts, strict=True):
        assert a.body == b.body
        np.testing.assert_allclose(a.pos, b.pos, atol=1e-5)
        np.testing.assert_allclose(axes_of(a.quat), axes_of(b.quat), atol=1e-4)
    check_two(find_mounts(PLAIN.replace('<body name="palm" >', '<body name="palm"><freejoint/>')))


# shapes of fingers


@pytest.mark.parametrize(
    ("shape", "width"),
    [
        ('type="capsule" size="0.008 0.03"', 0.0077),  # within 1 mm of its foremost line
        ('type="cylinder" size="0.008 0.03"', 0.0077),
        ('type="ellipsoid" size="0.008 0.01 0.03"', 0.01),
    ],
)
def test_round_fingers(shape, width):
    found = find_mounts(robot(two_fingers("", *(f'<geom name="{side}" {shape} mass="0.05"/>' for side in "lr"))))
    assert [m.replaces for m in found.mounts] == [("l",), ("r",)]
    for mount, side in zip(found.mounts, (1, -1), strict=True):
        np.testing.assert_allclose(mount.pos, (side * 0.008, 0, 0), atol=1e-3)
        np.testing.assert_allclose(axes_of(mount.quat)[:, 2], (-side, 0, 0), atol=0.05)
    assert found.faces[0].size[1] == pytest.approx(width, abs=2e-3)


def test_mesh_fingers():
    # wedges: the inner face is 40 x 20 mm, the back is narrower
    points = [(0.005, y, z) for y in (-0.01, 0.01) for z in (-0.02, 0.02)]
    points += [(-0.005, y, z) for y in (-0.005, 0.005) for z in (-0.01, 0.015)]
    texts = {name: " ".join(f"{sign * x} {y} {z}" for x, y, z in points) for name, sign in (("l", 1), ("r", -1))}
    meshes = "".join(f'<mesh name="{name}" vertex="{text}"/>' for name, text in texts.items())
    left, right = (f'<geom type="mesh" mesh="{name}" mass="0.05"/>' for name in texts)
    found = find_mounts(robot(two_fingers(left=left, right=right), extra=f"<asset>{meshes}</asset>"))
    check_two(found, size=(0.04, 0.02), atol=2e-4)


def test_pads_in_front_of_a_finger_and_geoms_behind_the_gel():
    # the face is the pad, 0.5 mm proud of the finger; the finger is replaced too because it would shadow taxels
    pads = [f'<geom name="{n}" type="box" pos="{x} 0 0.02" size="0.0025 0.008 0.008"/>' for n, x in
            (("lp", 0.003), ("rp", -0.003))]  # fmt: skip
    found = find_mounts(robot(two_fingers(left=BOX + pads[0], right=BOX + pads[1])))
    check_two(found, 0.0055, (0.016, 0.016), centre=0.02)
    assert [m.replaces for m in found.mounts] == [(0, "lp"), (0, "rp")]
    behind = box(-0.004, 0, 0, 0.005, 0.01, 0.03)
    front = '<geom name="lp" type="box" pos="0.0035 0 0" size="0.0015 0.01 0.03" mass="0"/>'
    assert find_mounts(robot(two_fingers(left=behind + front))).mounts[0].replaces == ("lp",)
    # a pad on a body of its own
    own = BOX.replace("<geom", '<geom name="l"') + (
        '<body name="left_pad" pos="0.01 0 0"><geom name="lp" type="box" pos="-0.007 0 0.02" '
        'size="0.0025 0.008 0.008" mass="0.01"/></body>'
    )
    mount = find_mounts(robot(two_fingers(left=own))).mounts[0]
    assert (mount.body, mount.replaces) == ("left_pad", ("l", "lp"))
    np.testing.assert_allclose(mount.pos, (-0.0045, 0, 0.02), atol=1e-4)


def test_boxes_in_one_plane_are_one_face():
    corners = "".join(box("{x}", y, z, 0.002, 0.003, 0.003) for y in (-0.0055, 0.0055) for z in (-0.0055, 0.0055))
    left, right = (box(0, 0, 0, 0.006, 0.0085, 0.0085) + corners.format(x=x) for x in (0.0055, -0.0055))
    found = find_mounts(robot(two_fingers(left=left, right=right)))
    check_two(found, 0.0075, (0.017, 0.017), atol=5e-4)
    # the large box is within the thickness of the gel behind the pad
    assert [m.replaces for m in found.mounts] == [(0, 1, 2, 3, 4)] * 2
    stacked = "".join(box(0, 0, z, 0.005, 0.01, 0.01) for z in (-0.02, 0, 0.02))
    short = box(0, 0, 0.02, 0.005, 0.01, 0.01)
    found = find_mounts(robot(two_fingers(left=stacked, right=short)))
    assert found.mounts[0].replaces == (0, 1, 2)
    np.testing.assert_allclose(found.faces[0].size, (0.06, 0.02), atol=5e-4)
    np.testing.assert_allclose([m.pos[2] for m in found.mounts], 0.02, atol=1e-3, err_msg="not in line")


@pytest.mark.parametrize("setting", ["discardvisual", "fusestatic"])
def test_unnamed_geoms_count_as_in_the_file_whatever_the_compiler_leaves_out(setting):
    looks = '<geom type="box" size="0.006 0.011 0.031" contype="0" conaffinity="0"/>'
    link = '<geom type="box" size="0.003 0.003 0.003" mass="0.01"/>'
    left, right = (f'{link}<body name="{n}_tip" pos="0 0 0.05">{looks}{BOX}</body>' for n in ("left", "right"))
    plain = robot(two_fingers(left=left, right=right))
    text = plain.replace("<compiler", f'<compiler {setting}="true"')
    found = find_mounts(text)
    assert found.mounts == find_once(plain).mounts
    assert [(mount.body, mount.replaces) for mount in found.mounts] == [("left_tip", (1,)), ("right_tip", (1,))]
    spec = attach(text, TaxelLayout(3, 2, 5e-3)).spec
    for side in ("left", "right"):
        assert [geom.contype for geom in spec.body(side).geoms] == [1]
        assert [geom.contype for geom in spec.body(f"{side}_tip").geoms] == [0, 0]


# how fingers are driven


def both(actuator: str) -> str:
    return actuator.format("left") + actuator.format("right")


@pytest.mark.parametrize(
    ("actuators", "extra", "said"),
    [
        (both('<motor name="{0}" joint="{0}" ctrlrange="-1 1"/>'), "", "to 1"),
        (both('<motor name="{0}" joint="{0}" forcerange="-2 2"/>'), "", "to 2"),
        (both('<motor name="{0}" joint="{0}"/>'), "", "to 1"),
        (both('<position name="{0}" joint="{0}" kp="100"/>'), "", "left: from 0 to 0.04"),
        (
            '<position name="grip" joint="left" kp="100" ctrlrange="0 0.04"/>',
            '<equality><joint joint1="right" joint2="left" polycoef="0 -1 0 0 0"/></equality>',
            "grip: from 0 to 0.04",
        ),
    ],
    ids=["motors", "force range", "no limits", "no control range", "coupled"],
)
def test_kinds_of_actuators(actuators, extra, said):
    found = find_mounts(robot((two_fingers()[0], actuators), extra=extra))
    check_two(found)
    assert found.report.count(said) == 1


def test_an_actuator_that_does_not_close_is_held():
    spread = '<joint name="spread" axis="0 1 0" type="slide" range="-0.01 0.01" damping="5"/>'
    servo = '<position name="spread" joint="spread" kp="100" ctrlrange="-0.01 0.01"/>'
    found = find_mounts(robot(two_fingers(left=spread + BOX), ("", servo)))
    check_two(found)
    assert "spread: held still at 0: does not move the fingers together" in found.report


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


def test_a_four_bar_linkage():
    couplings = "".join(
        f'<joint joint1="{name}_finger" joint2="{name}_outer" polycoef="0 -1 0 0 0"/>'
        f'<joint joint1="{name}_knuckle" joint2="{name}_outer" polycoef="0 1 0 0 0"/>'
        for name in ("left", "right")
    )
    bodies = f"""<body name="palm"><geom type="box" size="0.07 0.02 0.01"/>
      {linkage("left", -1)} {linkage("right", 1)}</body>"""
    actuator = '<position name="grip" joint="left_outer" kp="2" ctrlrange="-0.6 0.9"/>'
    extra = f'<equality>{couplings}<joint joint1="right_outer" joint2="left_outer"/></equality>'
    found = find_mounts(robot((bodies, actuator), extra=extra))
    assert [m.body for m in found.mounts] == ["left_finger", "right_finger"]
    for mount, side in zip(found.mounts, (1, -1), strict=True):
        np.testing.assert_allclose(mount.pos, (side * 0.004, 0, 0.03), atol=1e-4)
        np.testing.assert_allclose(axes_of(mount.quat)[:, 1:].T, ((0, 0, 1), (-side, 0, 0)), atol=1e-3)
    assert "grip: from -0.6 to 0.9" in found.report


def test_three_fingers_around_a_centre():
    found = find_mounts(robot(three_fingers()))
    assert [m.body for m in found.mounts] == ["finger0", "finger1", "finger2"]
    for face in found.faces:
        np.testing.assert_allclose(face.mount.pos, (-0.004, 0, 0.04), atol=1e-4)
        np.testing.assert_allclose(axes_of(face.mount.quat)[:, 1:].T, ((0, 0, 1), (1, 0, 0)), atol=1e-3)
        assert len(face.opposite) == 2


def test_one_jaw_against_a_fixed_one():
    found = find_mounts(robot(one_jaw()))
    base, jaw = found.mounts
    assert (base.body, base.replaces, jaw.body, jaw.replaces) == ("base", ("fixed",), "jaw", ("jaw",))
    # the outer part of the jaw, which reaches from 30 to 90 mm
    np.testing.assert_allclose(jaw.pos, (0.072, 0, -0.004), atol=1e-3)
    np.testing.assert_allclose(axes_of(jaw.quat)[:, 1:].T, ((1, 0, 0), (0, 0, 1)), atol=1e-3)
    np.testing.assert_allclose(axes_of(base.quat)[:, 1:].T, ((1, 0, 0), (0, 0, -1)), atol=1e-3)
    assert base.pos[2] == pytest.approx(0.004, abs=1e-4)
    assert found.faces[1].opposite == ("base",)


# what stands beside the robot

TABLE = '<geom name="table" type="box" size="0.3 0.3 0.01" pos="0 0 -0.05"/>'
AROUND = f"""{TABLE}<body name="block" pos="0 0 0.05"><freejoint/><geom size="0.02" mass="0.1"/></body>
  <body name="mocap" mocap="true" pos="0 0.2 0"><geom type="box" size="0.02 0.02 0.002"/></body>"""


def sliding(name: str, z: float, reach: str, inner: tuple[str, str] = ("", "")) -> tuple[str, str]:
    """Return a plate that its actuator moves up and down, with something on it, and all actuators."""
    bodies, actuators = inner
    return (
        f"""<body name="{name}" pos="0 0 {z}">
          <joint name="{name}" type="slide" axis="0 0 1" range="{reach}" damping="9"/>
          <geom type="box" size="0.2 0.2 0.01" pos="0 0 -0.02" mass="1"/>{bodies}</body>""",
        f'<position name="{name}" joint="{name}" kp="500" ctrlrange="{reach}"/>{actuators}',
    )


LIFT = sliding("lift", -0.18, "-0.1 0.1")  # from below the table up to it
PRESS = sliding("press", 0.1, "-0.15 0.1")


@pytest.mark.parametrize(
    ("parts", "fingers"),
    [
        ((two_fingers(),), ["left", "right"]),
        ((two_fingers(), LIFT), ["left", "right"]),
        ((on_arm(two_fingers(), at="0 1 0"), LIFT, PRESS), ["left", "right"]),
        ((sliding("carriage", 0.2, "-0.1 0.1", two_fingers()), LIFT), ["left", "right"]),
        ((one_jaw(), LIFT), ["base", "jaw"]),
        ((on_arm(one_jaw(), at="0 1 0"), LIFT, PRESS), ["base", "jaw"]),
    ],
)
def test_tables_lifts_and_objects_get_no_pads(parts, fingers):
    assert [mount.body for mount in find_mounts(robot(*parts, world=AROUND)).mounts] == fingers


def test_a_jaw_that_closes_on_the_world_may_be_a_lift_until_it_is_named():
    text = robot(LIFT, world=AROUND)
    with pytest.raises(
        InvalidValueError, match=r"lift closes on the world, as a jaw or as a lift .*--fingers world lift"
    ):
        find_mounts(text)
    assert {mount.body for mount in find_mounts(text, fingers=["world", "lift"]).mounts} == {"world", "lift"}


# what is refused

# the finger approaches the block but passes it
PASSING = """
<mujoco><worldbody><geom type="box" size="0.01 0.01 0.01" pos="0.1 0.08 0"/><body name="finger">
  <joint name="finger" type="slide" axis="1 0 0" damping="5"/><geom size="0.01" mass="0.1"/></body></worldbody>
<actuator><position name="finger" joint="finger" kp="100" ctrlrange="0 0.08"/></actuator></mujoco>
"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (robot((two_fingers()[0], "")), r"no actuators.*--close left right,.*by hand"),
        (PLAIN.replace("<geom", '<geom contype="0" conaffinity="0"'), "no geom that can touch"),
        (PLAIN.replace('ctrlrange="0 0.04', 'ctrlrange="0 1e-7').replace('e="-0.04 0', 'e="-1e-7 0'), "moves nothing"),
        (PASSING, r"no jaw closes on the link that carries it.*by hand"),
        (PLAIN.replace('<body name="right"', "<body"), r"on body 3 \(its parent is palm\), which has no name"),
    ],
    ids=["no actuators", "no geoms", "no motion", "nothing opposes", "no name"],
)
def test_grippers_without_a_grip(text, message):
    with pytest.raises(InvalidValueError, match=message):
        find_mounts(text)


def test_names_that_are_not_there_and_a_file_that_is_a_part(tmp_path):
    for options, message in (
        ({"fingers": ["lefft", "right"]}, "did you mean 'left'"),
        ({"close": ["grip"]}, "actuator or joint"),
        ({"under": "wrist"}, "body 'wrist'"),
    ):
        with pytest.raises(UnknownNameError, match=message):
            find_mounts(PLAIN, **options)
    (tmp_path / "part.xml").write_text("<mujocoinclude><worldbody/></mujocoinclude>")
    with pytest.raises(InvalidValueError, match="give the file that includes it"):
        find_mounts(tmp_path / "part.xml")
