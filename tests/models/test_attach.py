"""`attach`: what a gripper keeps, what it gains, and what it reads on an arm."""

import hashlib
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from scenes import ARM, GRIPPER, INTO_FINGER, POOLED, TIP_SURFACE, set_options

import paxisim
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.models.attach import TactileGripper, attach
from paxisim.models.gel import Gel
from paxisim.models.mount import Mount
from paxisim.models.pad import Pad
from paxisim.models.pads import find_pads, set_surface
from paxisim.models.readout import TactileReadout
from paxisim.models.surface import flat

LEFT = Mount("left_finger", TIP_SURFACE, INTO_FINGER, ("left_tip",))
RIGHT = Mount("right_finger", TIP_SURFACE, INTO_FINGER, (1,))  # its geom has no name
MOUNTS = (LEFT, RIGHT)
PAD = Pad(POOLED, mass=8e-3)

KINDS = {
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "jnt": mujoco.mjtObj.mjOBJ_JOINT,
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "site": mujoco.mjtObj.mjOBJ_SITE,
    "cam": mujoco.mjtObj.mjOBJ_CAMERA,
    "mat": mujoco.mjtObj.mjOBJ_MATERIAL,
    "mesh": mujoco.mjtObj.mjOBJ_MESH,
    "exclude": mujoco.mjtObj.mjOBJ_EXCLUDE,
    "eq": mujoco.mjtObj.mjOBJ_EQUALITY,
    "tendon": mujoco.mjtObj.mjOBJ_TENDON,
    "u": mujoco.mjtObj.mjOBJ_ACTUATOR,
    "sensor": mujoco.mjtObj.mjOBJ_SENSOR,
    "key": mujoco.mjtObj.mjOBJ_KEY,
}


def names_of(model: mujoco.MjModel) -> dict[str, list[str]]:
    found = {}
    for kind, code in KINDS.items():
        count = getattr(model, f"n{kind}")
        found[kind] = [mujoco.mj_id2name(model, code, i) for i in range(count)]
    return found


def same_by_name(before, after, kind, fields):
    """Check that the fields of every named object of a kind are unchanged."""
    prefix = {"u": "actuator"}.get(kind, kind)
    names = [name for name in names_of(before)[kind] if name]
    assert names
    for name in names:
        old, new = (mujoco.mj_name2id(model, KINDS[kind], name) for model in (before, after))
        assert new >= 0, name
        for field in fields:
            np.testing.assert_array_equal(
                getattr(after, f"{prefix}_{field}")[new], getattr(before, f"{prefix}_{field}")[old], err_msg=name
            )


@pytest.fixture(scope="module")
def bare() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(GRIPPER)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return attach(GRIPPER, PAD, MOUNTS).compile()


# what the gripper keeps


def test_every_name_stays_and_new_ones_are_the_pads(bare, model):
    for kind, before in names_of(bare).items():
        after = names_of(model)[kind]
        assert [name for name in after if name in before and name] == [name for name in before if name], kind
        new = {name for name in after if name} - set(before)
        assert all(name.startswith(("left_finger_pad", "right_finger_pad")) for name in new), kind


def test_nothing_that_moves_or_drives_is_added_or_changed(bare, model):
    for count in ("nq", "nv", "nu", "njnt", "ntendon", "neq", "nsensor", "nkey", "ncam"):
        assert getattr(model, count) == getattr(bare, count)
    assert model.nbody == bare.nbody + 2
    assert model.ngeom == bare.ngeom + 2 * 31
    same_by_name(bare, model, "jnt", ["type", "axis", "pos", "range", "limited", "stiffness", "solref"])
    same_by_name(bare, model, "u", ["gainprm", "biasprm", "ctrlrange", "ctrllimited", "gear", "trntype", "dyntype"])
    same_by_name(bare, model, "eq", ["type", "data", "solref", "active0"])
    same_by_name(bare, model, "tendon", ["num", "range", "stiffness", "damping"])
    same_by_name(bare, model, "sensor", ["type", "objtype", "dim", "adr", "noise"])
    same_by_name(bare, model, "cam", ["pos", "quat", "fovy"])
    same_by_name(bare, model, "site", ["pos", "quat", "size", "rgba"])
    same_by_name(bare, model, "body", ["pos", "quat", "mass", "inertia", "ipos"])
    np.testing.assert_array_equal(model.dof_damping, bare.dof_damping)
    np.testing.assert_array_equal(model.dof_armature, bare.dof_armature)
    kept = ["pos", "quat", "size", "type", "friction", "rgba", "condim", "solref", "solimp", "margin", "group"]
    same_by_name(bare, model, "geom", kept)


def test_keyframes_keep_their_values(bare, model):
    assert bare.key_qpos.any()
    for field in ("time", "qpos", "qvel", "ctrl"):
        np.testing.assert_array_equal(getattr(model, f"key_{field}"), getattr(bare, f"key_{field}"), err_msg=field)


def test_default_classes_stay_and_still_work():
    gripper = attach(GRIPPER, PAD, MOUNTS)
    assert all(gripper.spec.find_default(name) for name in ("main", "finger", "tip", "drive"))
    tip = gripper.spec.find_default("tip")
    gripper.spec.body("left_finger").add_geom(tip, name="nail", size=[0.001, 0.001, 0.001])
    nail = gripper.compile().geom("nail")
    assert nail.friction[0] == pytest.approx(0.8)
    assert int(nail.type[0]) == int(mujoco.mjtGeom.mjGEOM_BOX)


def test_the_grippers_defaults_do_not_reach_the_pads(tmp_path):
    """Nor do they after saving, where the defaults are written out again."""
    text = GRIPPER.replace(
        '<geom friction="0.7 0.01 0.001"/>',
        '<geom friction="0.7 0.01 0.001" margin="0.004" gap="0.001" condim="6" group="3" solmix="7" type="capsule"/>',
    ).replace('<site rgba="1 0 0 1"/>', '<site rgba="1 0 0 1" type="ellipsoid" size="0.1 0.1 0.1"/>')
    plain, other = attach(GRIPPER, PAD, MOUNTS), attach(text, PAD, MOUNTS)
    (tmp_path / "saved.xml").write_text(other.to_xml())
    reference = plain.compile()
    expected = find_pads(reference)
    for model in (other.compile(), mujoco.MjModel.from_xml_path(str(tmp_path / "saved.xml"))):
        pads = find_pads(model)
        for field in ("margin", "gap", "condim", "group", "solmix", "type", "size", "friction", "solref", "solimp"):
            np.testing.assert_allclose(
                getattr(model, f"geom_{field}")[pads.geoms],
                getattr(reference, f"geom_{field}")[expected.geoms],
                rtol=1e-5,  # MuJoCo writes six digits
                err_msg=field,
            )
        assert pads.thickness == pytest.approx(expected.thickness)
        assert pads.layout.pitch == pytest.approx(POOLED.pitch)


def test_the_pads_mass_is_added_exactly(bare, model):
    assert model.body_mass.sum() - bare.body_mass.sum() == pytest.approx(2 * 8e-3, abs=1e-12)
    assert model.body("left_finger_pad").mass[0] == pytest.approx(8e-3, abs=1e-12)


@pytest.mark.parametrize("setting", ['inertiafromgeom="true"', 'inertiafromgeom="auto"', 'discardvisual="true"'])
@pytest.mark.parametrize("layout", [POOLED, TaxelLayout(1, 2, 5e-3, normals=[[-0.1, 0, -1], [0.1, 0, -1]])])
def test_the_pads_mass_is_added_under_every_compiler_setting(setting, layout):
    text = GRIPPER.replace("<compiler ", f"<compiler {setting} ")
    before = mujoco.MjModel.from_xml_string(text)
    gripper = attach(text, Pad(layout, mass=8e-3), MOUNTS)
    after, saved = gripper.compile(), mujoco.MjModel.from_xml_string(gripper.to_xml())
    assert after.body_mass.sum() - before.body_mass.sum() == pytest.approx(2 * 8e-3, rel=1e-7)
    for field in ("mass", "inertia", "ipos", "iquat"):
        values = (getattr(model, f"body_{field}") for model in (saved, after))
        np.testing.assert_allclose(*values, rtol=1e-5, atol=1e-12)


def test_the_callers_spec_stays_as_it_was():
    spec = mujoco.MjSpec.from_string(GRIPPER)
    before = spec.to_xml()
    result = attach(spec, PAD, MOUNTS)
    result.spec.body("hand").pos = [1, 2, 3]
    assert spec.to_xml() == before
    assert len(find_pads(result.compile())) == 2
    assert spec.body("left_finger_pad") is None


# where the pads are


def test_a_pad_sits_at_its_mount_and_faces_the_other_finger(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for pad, finger in (("left_finger_pad", "left_finger"), ("right_finger_pad", "right_finger")):
        assert model.body(int(model.body(pad).parentid[0])).name == finger
        frame = data.body(finger).xmat.reshape(3, 3)
        np.testing.assert_allclose(data.body(pad).xpos, data.body(finger).xpos + frame @ TIP_SURFACE, atol=1e-12)
        axes = data.body(pad).xmat.reshape(3, 3)
        np.testing.assert_allclose(axes[:, 2], -frame[:, 0], atol=1e-9, err_msg="z into the finger")
        np.testing.assert_allclose(axes[:, 1], -frame[:, 2], atol=1e-9, err_msg="y down the finger")


def test_quaternions_are_normalised_and_mounts_have_their_bodys_name():
    mount = Mount("tip", (1, 2, 3), (0, 0, 0, 2), replaces=["a", 1])
    assert mount.quat == (0.0, 0.0, 0.0, 1.0)
    assert mount.name == "tip"
    assert mount.replaces == ("a", 1)
    assert mount == Mount("tip", (1.0, 2.0, 3.0), (0, 0, 0, 1), ("a", 1), "tip")
    assert hash(mount) == hash(Mount("tip", (1.0, 2.0, 3.0), (0, 0, 0, 1), ("a", 1)))


@pytest.mark.filterwarnings("ignore:pads")  # the mounts are no sensible places for a pad
def test_replaced_geoms_are_off_and_others_are_not(bare, model):
    def collides(which):
        return bool(which.contype[0] or which.conaffinity[0])

    for side in ("left", "right"):
        body = model.body(f"{side}_finger")
        geoms = [model.geom(int(body.geomadr[0]) + i) for i in range(int(body.geomnum[0]))]
        assert [collides(g) for g in geoms] == [True, False], side
    assert collides(model.geom("palm"))
    assert collides(bare.geom("left_tip"))
    nothing_replaced = attach(GRIPPER, PAD, [Mount("left_finger")]).compile()
    assert collides(nothing_replaced.geom("left_tip"))


def test_touch_sensors_that_will_not_feel_the_pads_are_named():
    text = GRIPPER.replace("<sensor>", '<sensor><touch name="of_hand" site="grip_site"/>')
    assert attach(text, PAD, MOUNTS).compile().sensor("of_hand").type[0] == int(mujoco.mjtSensor.mjSENS_TOUCH)
    text = text.replace("<sensor>", '<sensor><touch name="of_finger" site="left_site"/>')
    with pytest.warns(UserWarning, match=r"touch sensor 'of_finger' on 'left_finger' .*TactileReadout") as told:
        attach(text, PAD, MOUNTS)
    assert len(told) == 1
    assert told[0].filename == __file__


def test_explicit_pairs_of_replaced_geoms_are_removed_and_others_are_not():
    """MuJoCo lets the geoms of a pair collide regardless of their contact bits."""
    pairs = '<pair geom1="left_tip" geom2="palm"/><pair geom1="left_link" geom2="right_link"/>'
    model = attach(GRIPPER.replace("<contact>", "<contact>" + pairs), PAD, MOUNTS).compile()
    assert [model.geom(geom).name for geom in model.pair_geom1] == ["left_link"]


def test_a_replaced_geom_of_another_body_is_named():
    model = attach(GRIPPER, PAD, [Mount("hand", replaces=("left_tip", "palm"))]).compile()
    for name in ("left_tip", "palm"):
        assert model.geom(name).contype[0] == model.geom(name).conaffinity[0] == 0


# the pad is on the last of three welded bodies; the bits of the unnamed geoms come from a default class
WELDED = """
<mujoco>
  <default><default class="hull"><geom type="box" contype="4" conaffinity="4"/></default></default>
  <worldbody>
    <body name="arm">
      <joint type="slide"/>
      <geom name="root" size="0.01" pos="0 0 0.2"/>
      <body name="rig/link">
        <geom size="0.01 0.01 0.01" contype="0" conaffinity="0" type="box"/>
        <frame pos="0 0 0.001"><geom class="hull" size="0.02 0.02 0.003" pos="0 0 0.003"/></frame>
        <geom class="hull" size="0.02 0.02 0.003" pos="0 0 0.1"/>
        <body name="tip">
          <geom name="tip" class="hull" size="0.02 0.02 0.002" pos="0 0 0.002"/>
        </body>
      </body>
    </body>
  </worldbody>
  <contact><pair geom1="root" geom2="tip"/></contact>
</mujoco>
"""


def bits_on(model, body):
    first, count = int(model.body(body).geomadr[0]), int(model.body(body).geomnum[0])
    geoms = slice(first, first + count)
    return list(zip(model.geom_contype[geoms].tolist(), model.geom_conaffinity[geoms].tolist(), strict=True))


def test_unnamed_geoms_of_other_bodies_are_switched_off_by_body_and_index():
    gripper = attach(WELDED, POOLED, [Mount("tip", replaces=("tip/0", "rig/link/1"))])
    assert bits_on(gripper.compile(), "rig/link") == [(0, 0), (0, 0), (4, 4)]
    for model in (gripper.compile(), mujoco.MjModel.from_xml_string(gripper.to_xml())):
        assert sorted(bits_on(model, "rig/link")) == [(0, 0), (0, 0), (4, 4)], "MuJoCo saves a frame's geoms last"
        assert bits_on(model, "tip") == [(0, 0)]
        assert model.npair == 0, "the pair named a geom that was given by its index"
        pads = find_pads(model)
        assert set(model.geom_conaffinity[pads.geoms].flat) == {4}


def test_a_geom_whose_name_looks_like_body_and_index_comes_first():
    text = WELDED.replace('name="root"', 'name="rig/link/1"').replace('geom1="root"', 'geom1="rig/link/1"')
    mount = Mount("tip", replaces=("tip", "rig/link/1"))
    with pytest.warns(UserWarning, match="pads behind other geoms"):
        model = attach(text, POOLED, [mount]).compile()
    assert bits_on(model, "rig/link") == [(0, 0), (4, 4), (4, 4)]
    assert bits_on(model, "arm") == [(0, 0)]
    assert paxisim.finger_surface(text, Mount("tip", replaces=("rig/link/1",))).extents == pytest.approx([0.02] * 3)


@pytest.mark.parametrize(
    ("bits", "expected"),
    [
        ("", (0, 1)),
        ('contype="2" conaffinity="1"', (2, 1)),
        ('contype="3" conaffinity="1"', (2, 1)),
        ('contype="4" conaffinity="4"', (0, 4)),
        ('contype="0" conaffinity="6"', (0, 6)),
        ('contype="1" conaffinity="0"', (1, 0)),
    ],
)
def test_pads_meet_what_the_replaced_geoms_met_but_not_each_other(bits, expected):
    text = GRIPPER.replace('<geom friction="0.8 0.01 0.001"', f'<geom friction="0.8 0.01 0.001" {bits}')
    model = attach(text, PAD, MOUNTS).compile()
    pads = find_pads(model)
    assert set(model.geom_contype[pads.geoms].flat) == {expected[0]}
    assert set(model.geom_conaffinity[pads.geoms].flat) == {expected[1]}
    assert not expected[0] & expected[1]


def test_bits_given_for_the_pad_stay():
    model = attach(GRIPPER, Pad(POOLED, contype=8, conaffinity=16), MOUNTS).compile()
    pads = find_pads(model)
    assert set(model.geom_contype[pads.geoms].flat) == {8}
    assert set(model.geom_conaffinity[pads.geoms].flat) == {16}


def test_pads_that_close_on_each_other_make_no_contact(model):
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0305  # half a millimetre into each other
    mujoco.mj_forward(model, data)
    pads = find_pads(model)
    assert not np.isin(data.contact.geom, pads.geoms).any()


def test_pads_share_the_exclusions_of_their_bodies(model):
    def excluded(first, second):
        return {first, second} in pairs

    ids = [(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature]
    pairs = [{model.body(a).name, model.body(b).name} for a, b in ids]
    assert excluded("hand", "left_finger")
    assert excluded("hand", "left_finger_pad")
    assert excluded("hand", "right_finger_pad")
    assert not excluded("left_finger_pad", "right_finger")


def test_an_excluded_body_does_not_touch_the_pad():
    """Many grippers have a bracket in front of the pad that is excluded from contact with the finger."""
    block = '<geom type="box" size="0.05 0.05 0.05"/>'
    bracket = f'<body name="bracket" pos="0 0 -0.06"><joint type="slide"/>{block}</body>'
    text = GRIPPER.replace('<body name="left_finger"', f'{bracket}<body name="left_finger"', 1)
    text = re.sub("<keyframe>.*</keyframe>", "", text, flags=re.DOTALL)

    def touches(text):
        model = attach(text, PAD, MOUNTS).compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        return np.isin(data.contact.geom, find_pads(model).geoms[0]).any()

    assert touches(text)
    assert not touches(text.replace("<contact>", '<contact><exclude body1="bracket" body2="left_finger"/>'))


# input types


def test_a_spec_a_file_and_text_give_the_same(tmp_path):
    path = tmp_path / "gripper.xml"
    path.write_text(GRIPPER)
    texts = [
        attach(source, PAD, MOUNTS).to_xml()
        for source in (GRIPPER, "\n  " + GRIPPER, mujoco.MjSpec.from_string(GRIPPER), path, str(path))
    ]
    assert len(set(texts)) == 1


def test_a_pad_a_layout_and_a_catalogue_name():
    model = attach(GRIPPER, POOLED, MOUNTS).compile()
    assert find_pads(model).shape == (2, 3, 6, 5)
    gripper = attach(GRIPPER, "xela-uspa44", MOUNTS)
    model = gripper.compile()
    assert gripper.bind(model).shape == (2, 3, 4, 4)
    assert model.body("left_finger_pad").mass[0] == pytest.approx(paxisim.sensor("xela-uspa44").mass)
    with pytest.raises(UnknownNameError, match=r"unknown sensor 'xela-uspa4'; did you mean .*'xela-uspa44'"):
        attach(GRIPPER, "xela-uspa4", MOUNTS)


def test_mounts_may_be_any_iterable_and_one_will_do():
    assert len(attach(GRIPPER, PAD, (m for m in MOUNTS)).pad_names) == 2
    assert attach(GRIPPER, PAD, [RIGHT]).pad_names == ("right_finger_pad",)


def test_several_pads_on_one_body_under_names_of_their_own():
    mounts = [Mount("hand", (x, 0, -0.02), name=f"palm{i}") for i, x in enumerate([-0.03, 0.0, 0.03])]
    gripper = attach(GRIPPER, PAD, mounts)
    assert gripper.pad_names == ("palm0_pad", "palm1_pad", "palm2_pad")
    assert gripper.bind(gripper.compile()).shape == (3, 3, 6, 5)


def test_the_same_call_gives_the_same_bytes():
    assert attach(GRIPPER, PAD, MOUNTS).to_xml() == attach(GRIPPER, PAD, MOUNTS).to_xml()


def digest() -> str:
    return hashlib.sha256(attach(GRIPPER, PAD, MOUNTS).to_xml().encode()).hexdigest()


def test_the_same_bytes_in_every_process():
    roots = [str(Path(paxisim.__file__).parents[1]), str(Path(__file__).parent)]
    path = os.pathsep.join([*roots, *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", "import test_attach; print(test_attach.digest())"],
        env=os.environ | {"PYTHONPATH": path, "PYTHONHASHSEED": "5"},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert done.stdout.strip() == digest()


# the pads that bind returns


def test_bind_and_find_pads_agree_whatever_the_order_of_the_mounts(tmp_path):
    for mounts in (MOUNTS, MOUNTS[::-1]):
        gripper = attach(GRIPPER, PAD, mounts)
        model = gripper.compile()
        bound, found = gripper.bind(model), find_pads(model)
        assert bound.names == found.names == gripper.pad_names == ("left_finger_pad", "right_finger_pad")
        assert [mount.body for mount in gripper.mounts] == ["left_finger", "right_finger"]
        np.testing.assert_array_equal(bound.geoms, found.geoms)
        (tmp_path / "saved.xml").write_text(gripper.to_xml(tmp_path))
        saved = mujoco.MjModel.from_xml_path(str(tmp_path / "saved.xml"))
        again = find_pads(saved)
        assert again.names == bound.names
        assert [saved.geom(int(g)).name for g in again.geoms.flat] == [
            model.geom(int(g)).name for g in bound.geoms.flat
        ]
        assert again.layouts == bound.layouts


def test_bind_keeps_the_vendors_order_of_the_taxels():
    layout = TaxelLayout(2, 2, 4e-3, vendor_order=(3, 1, 2, 0))
    gripper = attach(GRIPPER, layout, MOUNTS)
    model = gripper.compile()
    assert gripper.bind(model).layouts == (layout, layout)
    assert find_pads(model).layout == layout


def test_bind_gives_the_gel():
    gel = Gel(modulus=80e3, friction=0.6)
    gripper = attach(GRIPPER, Pad(POOLED, gel=gel), MOUNTS)
    model, reference = gripper.compile(), gripper.compile()
    pads = gripper.bind(model)
    gel.apply(reference, find_pads(reference))
    np.testing.assert_array_equal(model.geom_solref, reference.geom_solref)
    np.testing.assert_array_equal(model.body_invweight0, reference.body_invweight0)
    assert set(model.geom_friction[pads.geoms, 0].flat) == {0.6}


def test_a_model_without_the_pads_cannot_be_bound(bare):
    with pytest.raises(InvalidValueError, match="no pad 'left_finger_pad' in the model; its pads: none"):
        attach(GRIPPER, PAD, MOUNTS).bind(bare)
    gripper = attach(GRIPPER, PAD, MOUNTS)
    with pytest.raises(InvalidValueError, match="no pad 'x_left_finger_pad' in the model; its pads: left_finger_pad, "):
        gripper.bind(gripper.compile(), prefix="x_")


@pytest.mark.filterwarnings("ignore:pads")  # the mounts are no sensible places for a pad
def test_fusestatic_does_not_swallow_the_pads():
    for inner, body in (("", "finger"), ("<body name='tip'><geom name='g' size='0.01'/></body>", "tip")):
        text = f"""<mujoco><compiler fusestatic='true'/><worldbody><body name='finger'>
          <joint name='j' type='slide' axis='1 0 0'/><geom size='0.01'/>{inner}</body></worldbody></mujoco>"""
        gripper = attach(text, PAD, [Mount(body, pos=(0, 0, 0.1))])
        pads = gripper.bind(gripper.compile())
        assert pads.names == (f"{body}_pad",)


def test_a_urdf_gripper(tmp_path):
    inertia = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    box = "<collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision>"
    path = tmp_path / "gripper.urdf"
    path.write_text(
        f"""<robot name="r"><link name="base">{inertia}</link><link name="jaw">{inertia}{box}</link>
        <joint name="j" type="prismatic"><parent link="base"/><child link="jaw"/><axis xyz="1 0 0"/>
        <limit lower="0" upper="0.1" effort="1" velocity="1"/></joint></robot>"""
    )
    gripper = attach(path, PAD, [Mount("jaw", replaces=(0,))])
    assert gripper.bind(gripper.compile()).names == ("jaw_pad",)


# saving


def mesh_gripper(folder: Path, suffix="stl") -> Path:
    """Write a gripper file whose fingertips are meshes in a separate folder, and return its path."""
    (folder / "gripper" / "parts").mkdir(parents=True)
    trimesh.creation.box([4e-3, 28e-3, 32e-3]).export(folder / "gripper" / "parts" / f"tip.{suffix}")
    text = GRIPPER.replace("<compiler ", '<compiler meshdir="parts" ')
    text = text.replace("<asset>", f'<asset><mesh name="tip" file="tip.{suffix}"/>')
    text = text.replace('class="tip" size="0.002 0.014 0.016"', 'class="tip" type="mesh" mesh="tip"')
    path = folder / "gripper" / "gripper.xml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("suffix", ["stl", "obj"])
def test_a_saved_gripper_finds_its_meshes_from_where_it_was_saved(tmp_path, suffix, monkeypatch):
    path = mesh_gripper(tmp_path, suffix)
    gripper = attach(path, PAD, MOUNTS)
    out = tmp_path / "elsewhere" / "deep"
    out.mkdir(parents=True)
    (out / "saved.xml").write_text(gripper.to_xml(out))
    (out / "absolute.xml").write_text(gripper.to_xml())
    assert str(tmp_path) not in (out / "saved.xml").read_text(), "paths are relative, so the folder may move"
    reference = gripper.compile()
    monkeypatch.chdir(out.parent)
    for name in ("saved.xml", "absolute.xml"):
        model = mujoco.MjModel.from_xml_path(str(out / name))
        assert names_of(model) == names_of(reference)
        np.testing.assert_allclose(model.body_mass, reference.body_mass, rtol=1e-6)
        np.testing.assert_allclose(model.key_qpos, reference.key_qpos)
        assert find_pads(model).names == gripper.pad_names
    moved = tmp_path.with_name(tmp_path.name + "_moved")
    tmp_path.rename(moved)
    assert mujoco.MjModel.from_xml_path(str(moved / "elsewhere" / "deep" / "saved.xml")).nmesh == 1


def test_a_saved_gripper_without_files_names_no_folders():
    root = ET.fromstring(attach(GRIPPER, PAD, MOUNTS).to_xml())
    assert all("dir" not in key for compiler in root.iter("compiler") for key in compiler.attrib)


def test_what_is_saved_behaves_as_what_was_compiled(tmp_path):
    """The forces of a squeeze agree to the precision of the saved file."""
    gripper = attach(GRIPPER, Pad(POOLED, heights=np.linspace(0.9e-3, 1.1e-3, 30).reshape(6, 5)), MOUNTS)
    saved = mujoco.MjModel.from_xml_string(gripper.to_xml())
    forces = []
    for model in (gripper.compile(), saved):
        gripper.bind(model)
        model.geom_contype[find_pads(model).geoms] = 1  # pads that press on each other suffice here
        model.body_contype[:] = 1
        set_options(model)
        data = mujoco.MjData(model)
        data.qpos[:], data.ctrl[:] = 0.03, 5
        for _ in range(300):
            mujoco.mj_step(model, data)
        forces.append(TactileReadout(model, find_pads(model)).read_exact(data))
    assert forces[0][0, 2].sum() == pytest.approx(5, rel=0.05)
    np.testing.assert_allclose(forces[0], forces[1], atol=1e-3)


# on an arm


def without_keyframes(gripper: TactileGripper) -> mujoco.MjSpec:
    spec = gripper.spec.copy()
    for key in list(spec.keys):
        spec.delete(key)
    return spec


def arm_with(gripper: TactileGripper, prefixes=("a_", "b_"), extra="") -> mujoco.MjSpec:
    arm = mujoco.MjSpec.from_string(ARM.replace("</worldbody>", f"{extra}</worldbody>"))
    for place, prefix in zip([(0, -0.2, -0.02), (0, 0.2, -0.02)], prefixes, strict=False):
        frame = arm.body("wrist").add_frame(pos=place, quat=(0.9, 0.1, 0.1, 0.3))
        arm.attach(without_keyframes(gripper), prefix=prefix, frame=frame)
    return arm


def test_attached_twice_to_an_arm_each_handle_is_its_own():
    gripper = attach(GRIPPER, PAD, MOUNTS[::-1])
    model = arm_with(gripper).compile()
    handles = {prefix: gripper.bind(model, prefix=prefix) for prefix in ("a_", "b_")}
    for prefix, pads in handles.items():
        assert pads.names == (f"{prefix}left_finger_pad", f"{prefix}right_finger_pad")
        assert find_pads(model, prefix=prefix).names == pads.names
        for pad in range(2):
            assert model.body(int(pads.bodies[pad])).name == pads.names[pad]
            expected = [f"{pads.names[pad]}_taxel_{r}_{c}" for r in range(6) for c in range(5)]
            assert [model.geom(int(g)).name for g in pads.geoms[pad]] == expected
    assert not np.isin(handles["a_"].geoms, handles["b_"].geoms).any()
    assert len(find_pads(model)) == 4
    assert model.nu == 4
    assert model.nsensor == 6
    assert model.ntendon == model.neq == 2
    assert handles["a_"].layouts[0].pitch == pytest.approx(POOLED.pitch)


def test_on_an_arm_sites_keep_their_materials():
    """MuJoCo loses them when a compiled spec is attached, so `attach` compiles a copy."""
    gripper = attach(GRIPPER.replace('name="grip_site"', 'name="grip_site" material="black"'), PAD, MOUNTS)
    gripper.bind(gripper.compile())
    gripper.to_xml()
    model = arm_with(gripper).compile()
    for prefix in ("a_", "b_"):
        assert model.mat(int(model.site(f"{prefix}grip_site").matid[0])).name == f"{prefix}black"


def test_a_surface_for_one_hand_leaves_the_other_alone():
    gripper = attach(GRIPPER, PAD, MOUNTS)
    model = arm_with(gripper).compile()
    first, second = (gripper.bind(model, prefix=prefix) for prefix in ("a_", "b_"))
    set_surface(model, first, flat(POOLED, 2e-3))
    assert set(model.geom_size[first.geoms, 2].flat) == {1e-3}
    np.testing.assert_allclose(model.geom_size[second.geoms, 2], 0.5e-3)


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("turned", [False, True], ids=["upright", "turned"])
def test_a_squeezed_box_is_in_balance(cone, turned):
    """The box loads the pads with its weight, and each pad carries the motor's force."""
    gripper = attach(GRIPPER, PAD, MOUNTS)
    mass, squeeze = 0.2, 8.0
    box = f"<body name='box'><freejoint/><geom type='box' size='0.02 0.02 0.03' mass='{mass}'/></body>"
    model = arm_with(gripper, prefixes=("a_",), extra=box).compile()
    set_options(model, cone=cone, impratio=10, gravity=(0, 0, -9.81))
    pads = gripper.bind(model, prefix="a_")
    data = mujoco.MjData(model)
    lift, turn = (0.3, -0.5) if turned else (0.0, 0.0)
    data.joint("lift").qpos[0] = data.actuator("lift").ctrl[0] = lift
    data.joint("turn").qpos[0] = data.actuator("turn").ctrl[0] = turn
    mujoco.mj_forward(model, data)
    at_box = model.jnt_qposadr[model.body("box").jntadr[0]]
    data.qpos[at_box : at_box + 3] = data.site("a_grip_site").xpos
    data.qpos[at_box + 3 : at_box + 7] = data.body("a_hand").xquat
    for side in ("left", "right"):
        data.joint(f"a_{side}_slide").qpos[0] = 0.0101
    data.actuator("a_close").ctrl[0] = squeeze
    for _ in range(500):
        mujoco.mj_step(model, data)
    force = TactileReadout(model, pads).read_exact(data)
    assert force.shape == (2, 3, 6, 5)
    axes = data.xmat[pads.bodies].reshape(-1, 3, 3)
    total = np.einsum("pij,pjrc->i", axes, force)
    np.testing.assert_allclose(total, [0, 0, -mass * 9.81], atol=0.01 * mass * 9.81)
    np.testing.assert_allclose(force[:, 2].sum(axis=(1, 2)), squeeze, rtol=0.15)
    assert np.mean(force[:, 2] > 0.01) > 0.9, "a flat box loads most taxels"
    if not turned:
        assert force[:, 2].sum() == pytest.approx(force[:, 2].sum(axis=(1, 2))[0] * 2, rel=0.2)


# two calls on one gripper


def test_fingertips_and_palm_in_two_calls():
    tips = attach(GRIPPER, PAD, MOUNTS)
    palm = attach(tips.spec, Pad(TaxelLayout(4, 4, 4e-3), mass=5e-3), [Mount("hand", (0, 0, -0.02), name="palm")])
    model = palm.compile()
    with pytest.raises(InvalidValueError, match="different shapes"):
        find_pads(model)
    assert find_pads(model, names=palm.pad_names).shape == (1, 3, 4, 4)
    assert find_pads(model, names=tips.pad_names).shape == (2, 3, 6, 5)
    assert tips.bind(model).names == ("left_finger_pad", "right_finger_pad")
    assert palm.bind(model).names == ("palm_pad",)
    assert len(find_pads(tips.compile())) == 2, "the first result has no palm"
    bare = mujoco.MjModel.from_xml_string(GRIPPER)
    assert model.body_mass.sum() - bare.body_mass.sum() == pytest.approx(2 * 8e-3 + 5e-3, abs=1e-12)


# bad input


@pytest.mark.parametrize(
    ("mounts", "error", "message"),
    [
        ([Mount("left_fingr")], UnknownNameError, "unknown body 'left_fingr'; did you mean 'left_finger'"),
        ([Mount("thumb_of_another")], UnknownNameError, "unknown body 'thumb_of_another'; "),
        ([Mount("left_finger", replaces=("left_tp",))], UnknownNameError, "'left_tp'; did you mean 'left_tip'"),
        (
            [Mount("left_finger", replaces=(2,))],
            InvalidValueError,
            "body 'left_finger' has 2 geoms, there is no geom 2: the last is 1",
        ),
        ([Mount("left_finger", replaces=(-1,))], InvalidValueError, "there is no geom -1"),
        (
            [Mount("left_finger", replaces=("hand/1",))],
            InvalidValueError,
            "body 'hand' has 1 geom, there is no geom 1: the last is 0",
        ),
        (
            [Mount("left_finger", replaces=("left_fingr/0",))],
            UnknownNameError,
            "unknown body 'left_fingr'; did you mean 'left_finger'.*'left_fingr/0' in replaces is geom 0 of that body",
        ),
        ([Mount("left_finger", replaces=("left_finger/-1",))], UnknownNameError, "unknown geom 'left_finger/-1'"),
        ([Mount("left_finger", replaces=("left_finger/" + "9" * 5000,))], UnknownNameError, "unknown geom 'left_"),
        ([LEFT, LEFT], InvalidValueError, "there would be two bodies named 'left_finger_pad': give each mount its"),
        ([Mount("hand", name="x"), Mount("left_finger", name="x")], InvalidValueError, "two bodies named 'x_pad'"),
        ([], InvalidValueError, "expected at least one mount, got none"),
    ],
)
def test_mounts_that_do_not_fit(mounts, error, message):
    with pytest.raises(error, match=message):
        attach(GRIPPER, PAD, mounts)


def test_a_name_that_the_gripper_has_already():
    text = GRIPPER.replace('name="hand"', 'name="left_finger_pad"').replace('body1="hand"', 'body1="left_finger_pad"')
    text = text.replace('body2="hand"', 'body2="left_finger_pad"')
    with pytest.raises(InvalidValueError, match="there would be two bodies named 'left_finger_pad'"):
        attach(text, PAD, [LEFT])


@pytest.mark.parametrize("field", ["pos", "quat"])
@pytest.mark.parametrize("value", [(1, 2), (1, 2, 3, 4, 5), (np.nan,) * 4, (np.inf, 0, 0), "abc"])
def test_bad_poses(field, value):
    with pytest.raises(InvalidValueError, match=f"a mount's {field} must be . finite numbers, got"):
        Mount("b", **{field: value})


def test_a_quaternion_of_zero_length():
    with pytest.raises(InvalidValueError, match="a mount's quat must not be zero"):
        Mount("b", quat=(0, 0, 0, 0))


def test_grippers_that_cannot_be_read(tmp_path):
    with pytest.raises(InvalidValueError, match=r"no such model file: .*nowhere\.xml"):
        attach(tmp_path / "nowhere.xml", PAD, MOUNTS)
    with pytest.raises(InvalidValueError, match=r"MuJoCo cannot parse the XML text: .*"):
        attach("<mujoco><worldbody><body></mujoco>", PAD, MOUNTS)
    with pytest.raises(InvalidValueError, match="no such model file"):
        attach(tmp_path, PAD, MOUNTS)


def test_a_gripper_that_does_not_compile_is_one_line(tmp_path):
    text = GRIPPER.replace("<asset>", '<asset><mesh name="tip" file="tip.stl"/>')
    with pytest.raises(InvalidValueError, match=r"MuJoCo cannot compile the gripper with pads: .*tip\.stl") as info:
        attach(text, PAD, MOUNTS)
    assert "\n" not in str(info.value)


def test_a_failed_attach_leaves_the_spec_alone():
    spec = mujoco.MjSpec.from_string(GRIPPER)
    before = spec.to_xml()
    for mounts in ([LEFT, Mount("none")], [LEFT, LEFT]):
        with pytest.raises((InvalidValueError, UnknownNameError)):
            attach(spec, PAD, mounts)
    assert spec.to_xml() == before


@pytest.mark.filterwarnings("ignore:curved pads")
@pytest.mark.parametrize("end", [-1, 1])  # the end of the layout, along its y, around which it curves
def test_the_curved_end_of_a_layout_goes_to_the_tip_of_the_finger(end):
    flat_grid = TaxelLayout(4, 3, 4e-3)
    normals = flat_grid.normals + np.outer(flat_grid.positions[:, 1] * end > 5e-3, [0, end, 0])
    curved = TaxelLayout(1, 12, 4e-3, flat_grid.positions, normals)
    frames = []
    for layout in (flat_grid, curved):
        gripper = attach(GRIPPER, layout)
        data = mujoco.MjData(gripper.compile())
        mujoco.mj_kinematics(data.model, data)
        frames.append([data.body(name).xmat.reshape(3, 3) for name in gripper.pad_names])
    assert ("turned the pads by 180 degrees" in gripper.report) == (end == -1)
    for plain, turned in zip(*frames, strict=True):  # y of a found mount points to the tip
        np.testing.assert_allclose(turned, plain * [end, end, 1], atol=1e-9)
    assert attach(GRIPPER, curved, MOUNTS).mounts == MOUNTS
