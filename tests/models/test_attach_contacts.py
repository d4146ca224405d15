"""What an attached pad touches in place of the geoms that it replaces, and what pads read on an arm and from a file."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from fingers import on_arm, robot
from scenes import GRIPPER, POOLED, set_options
from test_attach import MOUNTS, PAD

import paxisim
from paxisim import Mount, Pad, TactileGripper, TactileReadout, attach, find_pads, flat, set_surface


def bits_on(model, body):
    """Return the contact bits of the geoms of a body, as (contype, conaffinity)."""
    first, count = int(model.body(body).geomadr[0]), int(model.body(body).geomnum[0])
    geoms = slice(first, first + count)
    return list(zip(model.geom_contype[geoms].tolist(), model.geom_conaffinity[geoms].tolist(), strict=True))


# replaced geoms


def test_replaced_geoms_and_their_pairs_are_off_and_others_are_not():
    """MuJoCo lets the geoms of an explicit pair collide regardless of their contact bits."""
    pairs = '<pair geom1="left_tip" geom2="palm"/><pair geom1="left_link" geom2="right_link"/>'
    text = GRIPPER.replace("<contact>", "<contact>" + pairs)
    model = attach(text, PAD, MOUNTS).compile()
    assert bits_on(model, "left_finger") == bits_on(model, "right_finger") == [(1, 1), (0, 0)]
    assert bits_on(model, "hand") == [(1, 1)]
    assert [model.geom(geom).name for geom in model.pair_geom1] == ["left_link"]
    model = attach(GRIPPER, PAD, [Mount("hand", replaces=("left_tip", "palm"))]).compile()
    assert bits_on(model, "left_finger") == [(1, 1), (0, 0)], "also on another body"
    assert bits_on(model, "hand") == [(0, 0)]
    with pytest.warns(UserWarning, match="pads"):  # the mount is no sensible place for a pad
        model = attach(GRIPPER, PAD, [Mount("left_finger")]).compile()
    assert bits_on(model, "left_finger") == [(1, 1), (1, 1)]


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


def test_unnamed_geoms_of_other_bodies_are_switched_off_by_body_and_index():
    gripper = attach(WELDED, POOLED, [Mount("tip", replaces=("tip/0", "rig/link/1"))])
    assert bits_on(gripper.compile(), "rig/link") == [(0, 0), (0, 0), (4, 4)]
    for model in (gripper.compile(), mujoco.MjModel.from_xml_string(gripper.to_xml())):
        assert sorted(bits_on(model, "rig/link")) == [(0, 0), (0, 0), (4, 4)], "MuJoCo saves a frame's geoms last"
        assert bits_on(model, "tip") == [(0, 0)]
        assert model.npair == 0, "the pair named a geom that was given by its index"
        assert set(model.geom_conaffinity[find_pads(model).geoms].flat) == {4}


def test_a_geom_whose_name_looks_like_body_and_index_comes_first():
    text = WELDED.replace('"root"', '"rig/link/1"')
    with pytest.warns(UserWarning, match="pads behind other geoms"):
        model = attach(text, POOLED, [Mount("tip", replaces=("tip", "rig/link/1"))]).compile()
    assert bits_on(model, "rig/link") == [(0, 0), (4, 4), (4, 4)]
    assert bits_on(model, "arm") == [(0, 0)]
    assert paxisim.finger_surface(text, Mount("tip", replaces=("rig/link/1",))).extents == pytest.approx([0.02] * 3)


def test_touch_sensors_that_will_not_feel_the_pads_are_named():
    text = GRIPPER.replace("<sensor>", '<sensor><touch name="of_hand" site="grip_site"/>')
    assert attach(text, PAD, MOUNTS).compile().sensor("of_hand").type[0] == int(mujoco.mjtSensor.mjSENS_TOUCH)
    text = text.replace("<sensor>", '<sensor><touch name="of_finger" site="left_site"/>')
    with pytest.warns(UserWarning, match=r"touch sensor 'of_finger' on 'left_finger' .*TactileReadout") as told:
        attach(text, PAD, MOUNTS)
    assert len(told) == 1
    assert told[0].filename == __file__


# what pads touch


@pytest.mark.parametrize(
    ("bits", "pad", "expected"),
    [
        ("", {}, (0, 1)),
        ('contype="2" conaffinity="1"', {}, (2, 1)),
        ('contype="3" conaffinity="1"', {}, (2, 1)),
        ('contype="4" conaffinity="4"', {}, (0, 4)),
        ('contype="0" conaffinity="6"', {}, (0, 6)),
        ('contype="1" conaffinity="0"', {}, (1, 0)),
        ("", {"contype": 8, "conaffinity": 16}, (8, 16)),
        ("", {"contype": 8}, (8, 1)),
    ],
)
def test_pads_meet_what_the_replaced_geoms_met_unless_their_bits_are_given(bits, pad, expected):
    text = GRIPPER.replace('<geom friction="0.8 0.01 0.001"', f'<geom friction="0.8 0.01 0.001" {bits}')
    model = attach(text, Pad(POOLED, **pad), MOUNTS).compile()
    geoms = find_pads(model).geoms
    assert set(zip(model.geom_contype[geoms].flat, model.geom_conaffinity[geoms].flat, strict=True)) == {expected}


def test_pads_share_the_exclusions_of_their_bodies_and_do_not_meet_each_other():
    """Many grippers have a bracket in front of the pad that is excluded from contact with the finger."""
    block = '<geom type="box" size="0.05 0.05 0.05"/>'
    bracket = f'<body name="bracket" pos="0 0 -0.06"><joint type="slide"/>{block}</body>'
    text = GRIPPER.replace('<body name="left_finger"', f'{bracket}<body name="left_finger"', 1)
    text = re.sub("<keyframe>.*</keyframe>", "", text, flags=re.DOTALL)

    def touched(text, fingers=0.0):
        model = attach(text, PAD, MOUNTS).compile()
        data = mujoco.MjData(model)
        for side in ("left", "right"):
            data.joint(f"{side}_slide").qpos[0] = fingers
        mujoco.mj_forward(model, data)
        return [bool(np.isin(data.contact.geom, geoms).any()) for geoms in find_pads(model).geoms]

    assert touched(text) == [True, True]
    for finger, expected in (("left_finger", [False, True]), ("right_finger", [True, False])):
        exclude = f'<contact><exclude body1="bracket" body2="{finger}"/>'
        assert touched(text.replace("<contact>", exclude)) == expected
    assert touched(GRIPPER, 0.0305) == [False, False], "half a millimetre into each other"


# saving


def mesh_gripper(folder: Path, suffix: str) -> Path:
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
    gripper = attach(mesh_gripper(tmp_path, suffix), PAD, MOUNTS)
    out = tmp_path / "elsewhere" / "deep"
    out.mkdir(parents=True)
    (out / "saved.xml").write_text(gripper.to_xml(out))
    (out / "absolute.xml").write_text(gripper.to_xml())
    assert str(tmp_path) not in (out / "saved.xml").read_text(), "paths are relative, so the folder may move"
    reference = gripper.compile()
    monkeypatch.chdir(out.parent)
    for name in ("saved.xml", "absolute.xml"):
        model = mujoco.MjModel.from_xml_path(str(out / name))
        np.testing.assert_allclose(model.body_mass, reference.body_mass, rtol=1e-6)
        np.testing.assert_allclose(model.key_qpos, reference.key_qpos)
        assert find_pads(model).names == gripper.pad_names
    moved = tmp_path.with_name(tmp_path.name + "_moved")
    tmp_path.rename(moved)
    assert mujoco.MjModel.from_xml_path(str(moved / "elsewhere" / "deep" / "saved.xml")).nmesh == 1
    assert not re.search("meshdir|texturedir", attach(GRIPPER, PAD, MOUNTS).to_xml()), "no files, no folders"


# on an arm


def arm_with(gripper: TactileGripper, prefixes=("a_", "b_"), extra="") -> mujoco.MjSpec:
    """Return an arm with a gripper for each prefix at its end."""
    without_keyframes = gripper.spec.copy()
    for key in list(without_keyframes.keys):
        without_keyframes.delete(key)
    text = robot(on_arm(("", ""), joints=2), world=extra)
    text = text.replace('damping="1"', 'damping="50" armature="5"').replace('kp="100"', 'kp="20000"')  # stiff
    arm = mujoco.MjSpec.from_string(text)
    for place, prefix in zip([(0, -0.2, -0.02), (0, 0.2, -0.02)], prefixes, strict=False):
        frame = arm.body("link1").add_frame(pos=place, quat=(0.9, 0.1, 0.1, 0.3))
        arm.attach(without_keyframes.copy(), prefix=prefix, frame=frame)
    return arm


def test_attached_twice_to_an_arm_each_handle_is_its_own():
    gripper = attach(GRIPPER.replace('name="grip_site"', 'name="grip_site" material="black"'), PAD, MOUNTS[::-1])
    # MuJoCo loses materials of sites when a compiled spec is attached, so `attach` compiles a copy
    gripper.bind(gripper.compile())
    gripper.to_xml()
    model = arm_with(gripper).compile()
    handles = {prefix: gripper.bind(model, prefix=prefix) for prefix in ("a_", "b_")}
    for prefix, pads in handles.items():
        assert model.mat(int(model.site(f"{prefix}grip_site").matid[0])).name == f"{prefix}black"
        assert pads.names == (f"{prefix}left_finger_pad", f"{prefix}right_finger_pad")
        assert find_pads(model, prefix=prefix).names == pads.names
        for pad in range(2):
            assert model.body(int(pads.bodies[pad])).name == pads.names[pad]
            expected = [f"{pads.names[pad]}_taxel_{r}_{c}" for r in range(6) for c in range(5)]
            assert [model.geom(int(g)).name for g in pads.geoms[pad]] == expected
    assert len(find_pads(model)) == 4
    assert (model.nu, model.nsensor, model.ntendon, model.neq) == (4, 6, 2, 2)
    # a surface for one hand leaves the other alone
    set_surface(model, handles["a_"], flat(POOLED, 2e-3))
    assert set(model.geom_size[handles["a_"].geoms, 2].flat) == {1e-3}
    np.testing.assert_allclose(model.geom_size[handles["b_"].geoms, 2], 0.5e-3)


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("pose", [(0.0, 0.0), (-0.5, 0.3)], ids=["upright", "turned"])
def test_a_squeezed_box_is_in_balance(cone, pose):
    """The box loads the pads with its weight, and each pad carries the motor's force."""
    gripper = attach(GRIPPER, PAD, MOUNTS)
    mass, squeeze = 0.2, 8.0
    box = f"<body name='box'><freejoint/><geom type='box' size='0.02 0.02 0.03' mass='{mass}'/></body>"
    model = arm_with(gripper, prefixes=("a_",), extra=box).compile()
    set_options(model, cone=cone, impratio=10, gravity=(0, 0, -9.81))
    pads = gripper.bind(model, prefix="a_")
    data = mujoco.MjData(model)
    for joint, angle in zip(("j0", "j1"), pose, strict=True):
        data.joint(joint).qpos[0] = data.actuator(joint).ctrl[0] = angle
    mujoco.mj_forward(model, data)
    at_box = model.jnt_qposadr[model.body("box").jntadr[0]]
    data.qpos[at_box : at_box + 3] = data.site("a_grip_site").xpos
    data.qpos[at_box + 3 : at_box + 7] = data.body("a_hand").xquat
    for side in ("left", "right"):
        data.joint(f"a_{side}_slide").qpos[0] = 0.0101
    data.actuator("a_close").ctrl[0] = squeeze
    mujoco.mj_step(model, data, 500)
    force = TactileReadout(model, pads).read_exact(data)
    assert force.shape == (2, 3, 6, 5)
    axes = data.xmat[pads.bodies].reshape(-1, 3, 3)
    total = np.einsum("pij,pjrc->i", axes, force)
    np.testing.assert_allclose(total, [0, 0, -mass * 9.81], atol=0.01 * mass * 9.81)
    np.testing.assert_allclose(force[:, 2].sum(axis=(1, 2)), squeeze, rtol=0.15)
    assert np.mean(force[:, 2] > 0.01) > 0.9, "a flat box loads most taxels"
