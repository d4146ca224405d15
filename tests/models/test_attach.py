"""`attach`: what a gripper keeps, where its pads are, how pads and gripper are given, and what is refused."""

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scenes import GRIPPER, INTO_FINGER, OWN_GRIPPER, POOLED, TIP_SURFACE, fingertips

import paxisim
from paxisim import Gel, InvalidValueError, Mount, Pad, TaxelLayout, UnknownNameError, attach, find_pads

LEFT = Mount("left_finger", TIP_SURFACE, INTO_FINGER, ("left_tip",))
RIGHT = Mount("right_finger", TIP_SURFACE, INTO_FINGER, (1,))  # its geom has no name
MOUNTS = (LEFT, RIGHT)
PAD = Pad(POOLED, mass=8e-3)
BITS = ("geom_contype", "geom_conaffinity")

# fields of each kind of element that stay as they were
KEPT = {
    "body": "pos quat mass inertia ipos",
    "jnt": "type axis pos range limited stiffness solref",
    "geom": "pos quat size type friction rgba condim solref solimp margin group",
    "site": "pos quat size rgba",
    "cam": "pos quat fovy",
    "mat": "rgba",
    "exclude": "",
    "eq": "type data solref active0",
    "tendon": "",
    "actuator": "gainprm biasprm ctrlrange ctrllimited gear trntype dyntype",
    "sensor": "type objtype dim adr noise",
    "key": "time qpos qvel ctrl",
}


def names_of(model: mujoco.MjModel, kind: str) -> list[str]:
    """Return the names of all elements of a kind that have one."""
    count = getattr(model, "nu" if kind == "actuator" else f"n{kind}")
    return [name for i in range(count) if (name := getattr(model, kind)(i).name)]


@pytest.fixture(scope="module")
def bare() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(GRIPPER)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return attach(GRIPPER, PAD, MOUNTS).compile()


# what the gripper keeps


@pytest.mark.parametrize("kind", KEPT)
def test_every_named_element_stays_as_it_was_and_new_names_are_the_pads(bare, model, kind):
    before, after = names_of(bare, kind), names_of(model, kind)
    assert before
    assert [name for name in after if name in before] == before
    assert all(name.startswith(("left_finger_pad", "right_finger_pad")) for name in set(after) - set(before))
    for name in before:
        old, new = (getattr(one, kind)(name) for one in (bare, model))
        for field in KEPT[kind].split():
            np.testing.assert_array_equal(getattr(new, field), getattr(old, field), err_msg=f"{name} {field}")


def test_nothing_that_moves_or_drives_is_added(bare, model):
    for count in ("nq", "nv", "nu", "njnt", "ntendon", "neq", "nsensor", "nkey", "ncam"):
        assert getattr(model, count) == getattr(bare, count)
    assert model.nbody == bare.nbody + 2
    assert model.ngeom == bare.ngeom + 2 * 31
    for name in ("dof_damping", "dof_armature", "tendon_num", "tendon_range", "tendon_stiffness", "tendon_damping"):
        np.testing.assert_array_equal(getattr(model, name), getattr(bare, name), err_msg=name)


def test_default_classes_stay_and_still_work():
    gripper = attach(GRIPPER, PAD, MOUNTS)
    assert all(gripper.spec.find_default(name) for name in ("main", "finger", "tip", "drive"))
    tip = gripper.spec.find_default("tip")
    gripper.spec.body("left_finger").add_geom(tip, name="nail", size=[0.001, 0.001, 0.001])
    nail = gripper.compile().geom("nail")
    assert nail.friction[0] == pytest.approx(0.8)
    assert int(nail.type[0]) == int(mujoco.mjtGeom.mjGEOM_BOX)


ODD = 'margin="0.004" gap="0.001" condim="6" group="3" solmix="7" conaffinity="8" material="black"'


def odd_defaults(text: str) -> str:
    """Give a gripper defaults, for all and of the fingers' class, that would spoil a pad."""
    text = text.replace('<geom friction="0.7 0.01 0.001"/>', f'<geom friction="0.7 0.01 0.001" {ODD} type="capsule"/>')
    text = text.replace('rgba="0.3 0.3 0.3 1"/>', f'rgba="0.3 0.3 0.3 1" {ODD} friction="0.1 0 0"/>')
    return text.replace('<site rgba="1 0 0 1"/>', '<site rgba="1 0 0 1" type="ellipsoid" size="0.1 0.1 0.1"/>')


def test_the_grippers_defaults_do_not_reach_the_pads(model):
    """Nor do they after saving, where the defaults are written out again."""
    other = attach(odd_defaults(GRIPPER), PAD, MOUNTS)
    bits = {bit: getattr(other.compile(), bit)[find_pads(other.compile()).geoms] for bit in BITS}  # those of the tips
    expected = find_pads(model)
    for found in (other.compile(), mujoco.MjModel.from_xml_string(other.to_xml())):
        pads = find_pads(found)
        for field in ("margin", "gap", "condim", "group", "solmix", "type", "size", "friction", "solref", "solimp"):
            values = (getattr(m, f"geom_{field}")[p.geoms] for m, p in ((found, pads), (model, expected)))
            np.testing.assert_allclose(*values, rtol=1e-5, err_msg=field)  # MuJoCo writes six digits
        for bit, values in bits.items():
            np.testing.assert_array_equal(getattr(found, bit)[pads.geoms], values)
        assert pads.thickness == pytest.approx(expected.thickness)
        assert pads.layout.pitch == pytest.approx(POOLED.pitch)


def test_a_hand_whose_class_lost_its_material_to_a_prefix_is_saved():
    """MuJoCo's prefixing renames a material, but not in the default class of the geoms that have it."""
    text = GRIPPER.replace('rgba="0.3 0.3 0.3 1"/>', 'rgba="0.3 0.3 0.3 1" material="black"/>')
    hand, arm = mujoco.MjSpec.from_string(text), mujoco.MjSpec.from_string("<mujoco/>")
    for key in list(hand.keys):
        hand.delete(key)
    arm.attach(hand, prefix="h_", frame=arm.worldbody.add_frame())
    mounts = [replace(m, body=f"h_{m.body}", name="", replaces=(1,)) for m in MOUNTS]
    saved = mujoco.MjModel.from_xml_string(attach(arm, PAD, mounts).to_xml())
    assert saved.mat(int(saved.geom("h_left_link").matid[0])).name == "h_black"
    assert set(saved.geom_matid[find_pads(saved).geoms].flat) == {-1}


@pytest.mark.parametrize("layout", [POOLED, TaxelLayout(1, 2, 5e-3, normals=[[-0.1, 0, -1], [0.1, 0, -1]])])
def test_the_pads_mass_is_added_under_every_compiler_setting(layout):
    for setting in ("", 'inertiafromgeom="true"', 'inertiafromgeom="auto"', 'discardvisual="true"'):
        text = GRIPPER.replace("<compiler ", f"<compiler {setting} ")
        before = mujoco.MjModel.from_xml_string(text)
        gripper = attach(text, Pad(layout, mass=8e-3), MOUNTS)
        after, saved = gripper.compile(), mujoco.MjModel.from_xml_string(gripper.to_xml())
        assert after.body_mass.sum() - before.body_mass.sum() == pytest.approx(2 * 8e-3, rel=1e-7), setting
        assert after.body("left_finger_pad").mass[0] == pytest.approx(8e-3, rel=1e-7)
        for field in ("mass", "inertia", "ipos", "iquat"):
            values = (getattr(m, f"body_{field}") for m in (saved, after))
            np.testing.assert_allclose(*values, rtol=1e-5, atol=1e-12, err_msg=f"{setting} {field}")


def test_the_callers_spec_stays_as_it_was_also_where_attach_fails():
    spec = mujoco.MjSpec.from_string(GRIPPER)
    before = spec.to_xml()
    result = attach(spec, PAD, MOUNTS)
    result.spec.body("hand").pos = [1, 2, 3]
    for mounts in ([LEFT, Mount("none")], [LEFT, LEFT]):
        with pytest.raises((InvalidValueError, UnknownNameError)):
            attach(spec, PAD, mounts)
    assert spec.to_xml() == before
    assert len(find_pads(result.compile())) == 2


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


@pytest.mark.filterwarnings("ignore:pads")  # the mounts are no sensible places for a pad
def test_fusestatic_does_not_swallow_the_pads():
    for inner, body in (("", "finger"), ("<body name='tip'><geom name='g' size='0.01'/></body>", "tip")):
        text = f"""<mujoco><compiler fusestatic='true'/><worldbody><body name='finger'>
          <joint name='j' type='slide' axis='1 0 0'/><geom size='0.01'/>{inner}</body></worldbody></mujoco>"""
        gripper = attach(text, PAD, [Mount(body, pos=(0, 0, 0.1))])
        assert gripper.bind(gripper.compile()).names == (f"{body}_pad",)


# the pads that bind returns


def test_bind_and_find_pads_agree_whatever_the_order_of_the_mounts():
    layout = TaxelLayout(2, 2, 4e-3, vendor_order=(3, 1, 2, 0))
    for mounts in (MOUNTS, MOUNTS[::-1]):
        gripper = attach(GRIPPER, layout, mounts)
        assert [mount.body for mount in gripper.mounts] == ["left_finger", "right_finger"]
        model, saved = gripper.compile(), mujoco.MjModel.from_xml_string(gripper.to_xml())
        bound = gripper.bind(model)
        names = [[model.geom(int(geom)).name for geom in row] for row in bound.geoms]
        for one in (model, saved):
            found = find_pads(one)
            assert bound.names == found.names == gripper.pad_names == ("left_finger_pad", "right_finger_pad")
            assert [[one.geom(int(geom)).name for geom in row] for row in found.geoms] == names
            assert bound.layouts == found.layouts == (layout, layout)


def test_fingertips_and_palm_in_two_calls(bare):
    tips = attach(GRIPPER, PAD, MOUNTS)
    palm = attach(tips.spec, Pad(TaxelLayout(4, 4, 4e-3), mass=5e-3), [Mount("hand", (0, 0, -0.02), name="palm")])
    model = palm.compile()
    with pytest.raises(InvalidValueError, match="different shapes"):
        find_pads(model)
    for gripper, names, shape in ((tips, tips.pad_names, (2, 3, 6, 5)), (palm, ("palm_pad",), (1, 3, 4, 4))):
        pads = gripper.bind(model)
        assert (pads.names, pads.shape) == (names, shape)
    assert len(find_pads(tips.compile())) == 2, "the first result has no palm"
    assert model.body_mass.sum() - bare.body_mass.sum() == pytest.approx(2 * 8e-3 + 5e-3, abs=1e-12)


# input types


def test_a_spec_a_file_and_text_give_the_same_bytes(tmp_path):
    path = tmp_path / "gripper.xml"
    path.write_text(GRIPPER)
    sources = (GRIPPER, GRIPPER, "\n  " + GRIPPER, mujoco.MjSpec.from_string(GRIPPER), path, str(path))
    assert len({attach(source, PAD, MOUNTS).to_xml() for source in sources}) == 1


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


def test_a_pad_a_layout_and_a_catalogue_name_and_any_iterable_of_mounts():
    assert find_pads(attach(GRIPPER, POOLED, (m for m in MOUNTS)).compile()).shape == (2, 3, 6, 5)
    gripper = attach(GRIPPER, "xela-uspa44", [RIGHT])
    model = gripper.compile()
    assert gripper.bind(model).shape == (1, 3, 4, 4)
    assert model.body("right_finger_pad").mass[0] == pytest.approx(paxisim.sensor("xela-uspa44").mass)


def digest() -> str:
    """Return a hash of the text of pads of several kinds and of a gripper with pads."""
    heights = np.linspace(0.8e-3, 1.2e-3, 30).reshape(6, 5)
    options = {"contact": {"gel": Gel(modulus=1e5), "mass": 1 / 3}, "touch_grid": {"name": "tip", "contype": 2}}
    pads = [Pad(POOLED, heights=heights, sensors=kind, **more) for kind, more in options.items()]
    texts = [pad.to_xml() for pad in pads] + [attach(GRIPPER, PAD, MOUNTS).to_xml()]
    return hashlib.sha256("".join(texts).encode()).hexdigest()


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
    assert done.stdout.strip() == digest() == digest()


# bad input


@pytest.mark.parametrize(
    ("mounts", "error", "message"),
    [
        ([Mount("left_fingr")], UnknownNameError, "unknown body 'left_fingr'; did you mean 'left_finger'"),
        ([Mount("left_finger", replaces=("left_tp",))], UnknownNameError, "'left_tp'; did you mean 'left_tip'"),
        ([Mount("left_finger", replaces=(2,))], InvalidValueError, "has 2 geoms, there is no geom 2: the last is 1"),
        ([Mount("left_finger", replaces=(-1,))], InvalidValueError, "there is no geom -1"),
        ([Mount("left_finger", replaces=("hand/1",))], InvalidValueError, "1 geom, there is no geom 1: the last is 0"),
        (
            [Mount("left_finger", replaces=("left_fingr/0",))],
            UnknownNameError,
            "unknown body 'left_fingr'; did you mean 'left_finger'.*'left_fingr/0' in replaces is geom 0 of that body",
        ),
        ([Mount("left_finger", replaces=("left_finger/-1",))], UnknownNameError, "unknown geom 'left_finger/-1'"),
        ([Mount("left_finger", replaces=("left_finger/" + "9" * 5000,))], UnknownNameError, "unknown geom 'left_"),
        ([LEFT, LEFT], InvalidValueError, "two bodies named 'left_finger_pad': give each mount its own name"),
        ([Mount("hand", name="x"), Mount("left_finger", name="x")], InvalidValueError, "two bodies named 'x_pad'"),
        ([], InvalidValueError, "at least one mount"),
    ],
)
def test_mounts_that_do_not_fit(mounts, error, message):
    with pytest.raises(error, match=message):
        attach(GRIPPER, PAD, mounts)


def test_grippers_that_cannot_be_used():
    with pytest.raises(InvalidValueError, match="two bodies named 'left_finger_pad'"):
        attach(GRIPPER.replace('"hand"', '"left_finger_pad"'), PAD, MOUNTS)
    without_mesh = GRIPPER.replace("<asset>", '<asset><mesh name="tip" file="tip.stl"/>')
    with pytest.raises(InvalidValueError, match=r"cannot compile .*pads: .*tip\.stl"):
        attach(without_mesh, PAD, MOUNTS)
    with pytest.raises(UnknownNameError, match=r"unknown sensor 'xela-uspa4'; did you mean .*'xela-uspa44'"):
        attach(GRIPPER, "xela-uspa4", MOUNTS)


def test_a_mount_has_a_pose_and_by_default_its_bodys_name():
    mount = Mount("tip", (1, 2, 3), (0, 0, 0, 2), replaces=["a", 1])
    assert mount.quat == (0.0, 0.0, 0.0, 1.0)
    assert mount == Mount("tip", (1.0, 2.0, 3.0), (0, 0, 0, 1), ("a", 1), "tip")
    assert hash(mount) == hash(Mount("tip", (1.0, 2.0, 3.0), (0, 0, 0, 1), ("a", 1)))
    for value in ((1, 2), (1, 2, 3, 4, 5), (np.nan,) * 4, (np.nan,) * 3, (np.inf, 0, 0), "abc"):
        for field in ("pos", "quat"):
            with pytest.raises(InvalidValueError, match=f"a mount's {field} must be . finite numbers, got"):
                Mount("b", **{field: value})
    with pytest.raises(InvalidValueError, match="quat must not be zero"):
        Mount("b", quat=(0, 0, 0, 0))


def test_what_attach_and_bind_return_print_as_one_line():
    gripper = paxisim.attach(OWN_GRIPPER, paxisim.TaxelLayout(4, 3, 4e-3), fingertips())
    assert repr(gripper) == "TactileGripper(2 pads of 4x3 taxels: left_finger, right_finger)"
    assert repr(gripper.bind(gripper.compile())) == "Pads(2 pads of 4x3 taxels: left_finger_pad, right_finger_pad)"
    assert repr(gripper.mounts[0]) == (
        "Mount('left_finger', pos=(0, 0, -0.019), quat=(0.5, -0.5, -0.5, 0.5), replaces=('left_fingertip',))"
    )
    assert repr(paxisim.Mount("jaw", name="upper")) == "Mount('jaw', pos=(0, 0, 0), quat=(1, 0, 0, 0), name='upper')"
    assert repr(gripper.grips[0]).startswith("Grip(pads=(0, 1), actuators=(0,), ")
    assert repr(paxisim.find_mounts(OWN_GRIPPER)) == "FoundMounts(2 faces: left_finger, right_finger)"
    fingers = [f'<body name="f{i}" pos="{0.1 * i} 0 0"><geom size=".01"/></body>' for i in range(5)]
    many = paxisim.attach(
        f"<mujoco><worldbody>{''.join(fingers)}</worldbody></mujoco>",
        paxisim.TaxelLayout(1, 1, 4e-3),
        [paxisim.Mount(f"f{i}", replaces=(0,)) for i in range(5)],
    )
    assert repr(many) == "TactileGripper(5 pads of 1x1 taxels: f0, f1, f2, f3, ...)"


def test_a_pad_on_a_body_that_is_called_a_pad_has_no_doubled_word_in_its_name():
    xml = OWN_GRIPPER.replace('"left_finger"', '"left_pad"').replace('"right_finger"', '"pad"')
    mounts = [replace(mount, body=body, name="") for mount, body in zip(fingertips(), ("left_pad", "pad"), strict=True)]
    gripper = attach(xml, POOLED, mounts)
    assert gripper.pad_names == ("left_tactile_pad", "tactile_pad")
    again = attach(xml, POOLED, gripper.mounts)
    assert again.pad_names == gripper.pad_names
    named = attach(OWN_GRIPPER, POOLED, replace(fingertips()[0], name="my_pad"))
    assert named.pad_names == ("my_pad_pad",), "a name that the caller gives stays"
