"""Warnings about what takes the gel or the load away from the pads of a compiled model."""

import warnings

import mujoco
import numpy as np
import pytest
from scenes import OWN_GRIPPER, POOLED, fingertips

import paxisim


def gripper_with(objects="", joint="<freejoint/>", **geom):
    """Return the two-finger gripper with pads, and a peg between them in the same scene."""
    bits = " ".join(f'{key}="{value}"' for key, value in geom.items())
    peg = f"""<body name="peg" pos="0 0 0.93">{joint}
      <geom name="peg" type="box" size="0.012 0.009 0.03" mass="0.05" {bits}/></body>"""
    scene = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{objects}{peg if joint else ''}</worldbody></mujoco>")
    tactile = paxisim.attach(OWN_GRIPPER, POOLED, fingertips())
    scene.attach(tactile.spec, frame=scene.worldbody.add_frame(pos=(0, 0, 1)), prefix="g/")
    return tactile, scene


def said(act, *args):
    """Return the warnings of a call, which all point at this file."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        act(*args)
    assert {warning.filename for warning in caught} <= {__file__}
    return [str(warning.message) for warning in caught]


def bound(tactile, scene):
    return said(tactile.bind, scene.compile(), "g/")


# the priority of taxels

CLOTH = """<flexcomp name="cloth" type="grid" dim="2" count="3 3 1" spacing="0.01 0.01 0.01" radius="0.001"
  mass="1"><edge equality="true"/><contact priority="5"/></flexcomp>"""


@pytest.mark.parametrize(
    ("objects", "peg", "priority"),
    [
        ("", {"priority": 3, "condim": 6, "solref": "0.01 1"}, 4),
        (CLOTH, {"joint": ""}, 6),
        ('<geom size="0.1" priority="9" contype="4" conaffinity="4"/>', {}, 1),  # cannot touch the pads
    ],
    ids=["object", "cloth", "apart"],
)
def test_objects_with_a_priority_still_meet_the_gel(objects, peg, priority):
    tactile, scene = gripper_with(objects, **peg)
    model = scene.compile()
    for _ in range(2):  # the second time as well
        assert set(model.geom_priority[tactile.bind(model, "g/").geoms].flat) == {priority}


# objects that pass through pads


def test_nothing_is_said_of_ordinary_objects_robots_and_ghosts():
    others = """<body name="arm" pos="1 0 0"><joint name="lift"/>
        <geom size="0.1" contype="4" conaffinity="4"/></body>
      <body name="ghost"><freejoint/><geom size="0.1" mass="1" contype="0" conaffinity="0"/></body>
      <geom name="floor" type="plane" size="1 1 1" contype="8" conaffinity="8"/>"""
    tactile, scene = gripper_with(others)
    scene.add_actuator(name="lift", target="lift", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    assert bound(tactile, scene) == []
    assert bound(*gripper_with(joint="")) == []
    # one geom that meets the pads is enough
    tactile, scene = gripper_with(contype=2, conaffinity=2)
    scene.body("peg").add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.01, 0, 0])
    assert bound(tactile, scene) == []


@pytest.mark.parametrize(
    ("contype", "conaffinity", "joint", "added"),
    [
        (2, 2, "<freejoint/>", {"contype": 3}),
        (0, 1, '<joint type="slide" axis="1 0 0"/>', {"contype": 1}),
        (4, 0, "<freejoint/>", {"contype": 5}),
    ],
)
def test_an_object_whose_bits_miss_the_taxels(contype, conaffinity, joint, added):
    bits = {"contype": contype, "conaffinity": conaffinity}
    (warning,) = bound(*gripper_with(joint=joint, **bits))
    assert warning == (
        f"objects pass through pads, which read 0: 'peg' (contype {contype}, conaffinity {conaffinity}) through "
        "'g/left_finger_pad', 'g/right_finger_pad' (contype 0, conaffinity 1); add 1 to the contype of their geoms"
    )
    assert bound(*gripper_with(joint=joint, **bits | added)) == []


def test_an_object_that_mocap_moves_and_robots_driven_through_tendons_and_sites():
    mocap = '<body name="probe" mocap="true"><geom size="0.01" contype="2" conaffinity="0"/></body>'
    assert "'probe' (contype 2, conaffinity 0)" in bound(*gripper_with(mocap))[0]
    robots = "".join(
        f"""<body name="{name}" pos="{x} 0 0"><joint name="{name}"/><site name="{name}"/>
          <geom size="0.1" contype="4" conaffinity="4"/></body>"""
        for x, name in enumerate(("by_tendon", "by_site", "by_body", "free"))
    )
    tactile, scene = gripper_with(robots)
    scene.add_tendon(name="string").wrap_joint("by_tendon", 1)
    kinds = mujoco.mjtTrn
    for target, kind in (("string", kinds.mjTRN_TENDON), ("by_site", kinds.mjTRN_SITE), ("by_body", kinds.mjTRN_BODY)):
        scene.add_actuator(name=target, target=target, trntype=kind)
    (warning,) = bound(tactile, scene)
    assert warning.startswith("objects pass through pads, which read 0: 'free' (contype 4, conaffinity 4) through")


# what takes the gel, the friction or the load away


def test_pads_whose_bits_or_friction_were_taken():
    tactile, scene = gripper_with()
    model = scene.compile()
    pads = paxisim.find_pads(model)
    model.geom_condim[pads.geoms[1]] = 1
    (warning,) = said(tactile.bind, model, "g/")
    assert warning == "pads feel no shear, since taxels have condim 1 instead of 3: 'g/right_finger_pad'"
    model = scene.compile()
    model.geom_contype[pads.geoms] = model.geom_conaffinity[pads.geoms] = 0
    (warning,) = said(tactile.bind, model, "g/")
    assert warning.endswith("(contype 0, conaffinity 0); give the pads contact bits")


def test_the_override_flag():
    tactile, scene = gripper_with()
    scene.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_OVERRIDE)
    (warning,) = bound(tactile, scene)
    assert warning.startswith('the pads have no gel: <flag override="enable"/> gives all contacts')
    assert "remove it" in warning


def test_explicit_pairs_that_name_taxels_or_bring_a_replaced_geom_back():
    tactile, scene = gripper_with(contype=0, conaffinity=0)
    for col in range(5):
        scene.add_pair(geomname1="peg", geomname2=f"g/left_finger_pad_taxel_0_{col}")
    replaced, passing = bound(tactile, scene)
    assert replaced == (
        "explicit contact pairs replace the gel and friction of the taxels that they name; remove "
        "'g/left_finger_pad_taxel_0_0' with 'peg', 'g/left_finger_pad_taxel_0_1' with 'peg', "
        "'g/left_finger_pad_taxel_0_2' with 'peg' and 2 more"
    )
    assert "through 'g/right_finger_pad'" in passing
    assert "left_finger_pad" not in passing
    tactile, scene = gripper_with()
    scene.add_pair(geomname1="peg", geomname2="g/left_fingertip")
    scene.add_pair(geomname1="peg", geomname2="g/left_finger_link")  # not in front of the pad
    scene.add_pair(geomname1="g/palm", geomname2="g/right_fingertip")  # no object
    (warning,) = bound(tactile, scene)
    assert warning == (
        "explicit contact pairs let geoms in front of a pad, or level with it, take its load; remove "
        "'g/left_fingertip' with 'peg'"
    )


def test_a_saved_model_that_is_read_without_a_gel():
    """`find_pads` says nothing, `TactileReadout` does, and nothing is left to say once the gel is applied."""
    _, scene = gripper_with(priority=2)
    model = scene.compile()
    assert said(paxisim.find_pads, model) == []
    pads = paxisim.find_pads(model)
    (warning,) = said(paxisim.TactileReadout, model, pads)
    assert warning.startswith("the pads lose their gel on objects of priority 2, since their taxels have priority 1")
    assert said(paxisim.Gel().apply, model, pads) == []
    assert said(paxisim.TactileReadout, model, pads) == []


def test_warnings_do_not_keep_the_gel_away():
    tactile, scene = gripper_with(contype=2, conaffinity=2)
    model = scene.compile()
    with pytest.raises(UserWarning, match="objects pass through pads"):
        tactile.bind(model, "g/")
    assert np.all(model.body_invweight0[paxisim.find_pads(model).bodies, 0] > 1000)
