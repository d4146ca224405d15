"""`compose_scene`: an arm, a hand, a table and objects in one file that MuJoCo reads as it was composed."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh
from fingers import BOX, on_arm, robot, two_fingers
from scenes import axes_of

import paxisim
from paxisim import InvalidValueError, UnknownNameError, compose_scene, find_mounts

HANDS = Path(__file__).parents[2].parent / "shared" / "data" / "hands"
LAYOUT = paxisim.TaxelLayout(4, 3, 4e-3)
HAND = robot(two_fingers())
TURNED = '<site name="tool" pos="0.02 0.03 0.05" quat="0.6 0.3 -0.5 0.2"/>'
FLANGE = '<site name="flange" pos="0 0 0.15"/>'
ARM = robot(on_arm(("", ""))).replace('size="0.02" mass="0.5"/></body>', f'size="0.02" mass="0.5"/>{TURNED}</body>', 1)

# what a file of a model must hold
FIELDS = {
    "body": "pos quat mass inertia ipos iquat",
    "jnt": "type limited pos axis stiffness range margin",
    "dof": "frictionloss armature damping",
    "geom": "type contype conaffinity condim group priority solmix solref solimp pos quat friction margin gap rgba",
    "site": "type pos quat rgba group",
    "tendon": "limited range width stiffness damping",
    "actuator": "trntype gainprm biasprm ctrlrange ctrllimited gear",
    "eq": "type data solref",
    "key": "qpos ctrl",
}


def part(name: str, compiler: str, defaults: str, last: str = "") -> str:
    """Return a link with one of everything, whose looks, contacts and masses come from defaults and settings."""
    return f"""<mujoco model="{name}"><compiler {compiler}/>
      <default>{defaults}<default class="look">
        <geom material="paint" margin="0.003"/><site material="paint"/><tendon material="paint"/>
      </default></default>
      <asset><texture name="paint" type="2d" builtin="checker" width="8" height="8"/>
        <material name="paint" texture="paint" rgba="0.{len(name)} 0 0 1"/></asset>
      <worldbody><body name="{name}"><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>
        <joint name="{name}" type="hinge" range="-1 1"/><geom name="{name}" type="box" size="0.1 0.1 0.1"/>
        <body name="{name}_tip" childclass="look"><joint name="{name}_tip" type="slide"/>
          <geom name="{name}_tip" size="0.05" pos="0 0 0.3"/><site name="{name}_tip"/><site name="{name}_end"/>
          <body name="{name}_end" pos="0 0 0.5"/>
        </body>{last}</body><geom name="{name}_fixed" size="0.02" pos="0 0 -0.3"/></worldbody>
      <tendon><spatial name="{name}" class="look"><site site="{name}_tip"/><site site="{name}_end"/></spatial></tendon>
      <actuator><position name="{name}" joint="{name}"/></actuator>
      <keyframe><key name="home" qpos="0.{len(name)} 0.1{" 0.2" if last else ""}" ctrl="0.{len(name)}"/></keyframe>
      </mujoco>"""


ODD = """<geom margin="0.01" conaffinity="3" condim="4"/><joint damping="3" armature="1"/>
  <position kp="50" ctrlrange="-1 1"/><site size="0.02"/>"""


def read(scene: paxisim.ComposedScene) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(scene.to_xml())


def check_same(one: mujoco.MjModel, two: mujoco.MjModel) -> None:
    for kind, fields in FIELDS.items():
        for field in fields.split():
            values = (getattr(model, f"{kind}_{field}") for model in (one, two))
            np.testing.assert_allclose(*values, rtol=1e-4, atol=1e-6, err_msg=f"{kind} {field}")
    for kind in ("geom", "site", "tendon"):
        assert look(one, kind) == look(two, kind)


def look(model: mujoco.MjModel, kind: str, prefix: str = "") -> dict[str, str]:
    """Return the material of everything of a kind that has a name, without the prefix of both."""
    count, found = getattr(model, f"n{kind}"), {}
    for i in range(count):
        material = int(getattr(model, f"{kind}_matid")[i])
        name = getattr(model, kind)(i).name
        if name.startswith(prefix):
            found[name[len(prefix) :]] = "" if material < 0 else model.mat(material).name
    return found


@pytest.mark.filterwarnings("ignore:.*settotalmass.* is deprecated")  # from MuJoCo 4.0 on
@pytest.mark.parametrize("arm_is_odd", [False, True])
@pytest.mark.parametrize("hand_is_odd", [False, True])
@pytest.mark.parametrize("settings", ["", 'angle="radian" inertiafromgeom="true"', 'settotalmass="7"'])
def test_the_file_holds_the_hand_as_it_was_whatever_the_files_settings_and_defaults(arm_is_odd, hand_is_odd, settings):
    """Both files have the class look and the material paint; the mass of the hand is that of its own file."""
    arm = part("arm", 'inertiafromgeom="true"', ODD if arm_is_odd else "")
    hand = part("claw", settings, ODD if hand_is_odd else "")
    scene = compose_scene(arm, hand, at="body:arm_end")
    assert scene.prefix == "hand_"
    assert "names of the hand begin with 'hand_' in the scene, since both files have: default look" in scene.report
    composed, alone = scene.spec.copy().compile(), mujoco.MjModel.from_xml_string(hand)
    check_same(composed, read(scene))
    for body in ("claw", "claw_tip", "claw_end"):
        assert composed.body(f"hand_{body}").mass == pytest.approx(alone.body(body).mass)
        np.testing.assert_allclose(composed.body(f"hand_{body}").inertia, alone.body(body).inertia, rtol=1e-6)
    for geom in ("claw", "claw_tip", "claw_fixed"):
        for field in ("margin", "conaffinity", "condim", "size"):
            values = (getattr(composed.geom(f"hand_{geom}"), field), getattr(alone.geom(geom), field))
            np.testing.assert_array_equal(*values, err_msg=f"{geom} {field}")
    for kind in ("geom", "site", "tendon"):
        expected = {name: material and f"hand_{material}" for name, material in look(alone, kind).items()}
        assert look(composed, kind, "hand_") == expected
        assert set(expected.values()) - {""} == {"hand_paint"}
    assert composed.mat("hand_paint").rgba[0] != composed.mat("paint").rgba[0]
    np.testing.assert_allclose(composed.jnt_range[composed.joint("hand_claw").id], alone.jnt_range[0], rtol=1e-5)


@pytest.mark.filterwarnings("ignore:.* mm inside")
def test_names_that_only_one_file_has_stay():
    scene = compose_scene(ARM, HAND, at="site:tool")
    assert (scene.prefix, "names of" in scene.report) == ("", False)
    model = read(scene)
    assert [model.body(n).name for n in ("palm", "left", "right")] == ["palm", "left", "right"]
    assert {model.actuator(i).name for i in range(model.nu)} == {"j0", "j1", "j2", "j3", "left", "right"}
    # two hands on one arm: the second and the third get different prefixes
    twice = compose_scene(scene.spec, HAND, at="link1")
    thrice = compose_scene(twice.spec, HAND, at="link1", table=(0.5, 0, 0))
    assert (twice.prefix, thrice.prefix) == ("hand_", "hand2_")
    # also of two hands on one link
    assert [m.body for m in find_mounts(thrice.spec, under="hand2_palm").mounts] == ["hand2_left", "hand2_right"]
    assert read(thrice).nu == 4 + 3 * 2


@pytest.mark.filterwarnings("ignore:.* mm inside")
def test_keyframes_hold_each_part_at_rest_wherever_its_joints_are():
    """The hand is in the middle of the arm's tree, so its joints are between the arm's."""
    last = '<body name="last"><joint name="last" type="slide"/><geom size="0.01" pos="0 0 1"/></body>'
    arm = part("arm", "", "", last).replace("<worldbody>", '<worldbody><body name="mocap" mocap="true"/>')
    arm = arm.replace('ctrl="0.3"', 'ctrl="0.3" mpos="1 2 3"')
    for keys, expected in (((1, 1), ["home"]), ((0, 1), ["home"]), ((1, 0), ["home"]), ((0, 0), [])):
        texts = [arm, part("claw", "", "")]
        for i in (0, 1):
            texts[i] = texts[i] if keys[i] else re.sub("<keyframe>.*</keyframe>", "", texts[i])
        scene = compose_scene(*texts, at="body:arm_tip", table=(0.5, 0.6, 0.5), objects=["ball:40mm:0.1kg@0.5,0.6,0.7"])
        model = read(scene)
        assert [model.key(k).name for k in range(model.nkey)] == expected
        for k in range(model.nkey):
            at = {model.joint(j).name: model.key_qpos[k, model.jnt_qposadr[j]] for j in range(model.njnt)}
            assert at["arm"] == pytest.approx(0.3 * keys[0])
            assert (at["arm_tip"], at["last"]) == pytest.approx((0.1 * keys[0], 0.2 * keys[0]))
            assert at["hand_claw"] == pytest.approx(0.4 * keys[1])
            np.testing.assert_allclose(model.key_qpos[k, -7:], (0.5, 0.6, 0.7, 1, 0, 0, 0))
            np.testing.assert_allclose(model.key_mpos[k], np.array([1, 2, 3]) * keys[0])
            np.testing.assert_allclose(model.key_ctrl[k], (0.3 * keys[0], 0.4 * keys[1]))


def with_mesh(folder: Path, text: str, body: str, size: float) -> Path:
    """Write a robot that has a mesh and a texture in folders of its own, named as those of any other robot."""
    (folder / "assets").mkdir(parents=True)
    trimesh.creation.box([size] * 3).export(folder / "assets" / "part.stl")
    png = bytes.fromhex(
        "89504e470d0a1a0a0000000d49484452000000010000000108020000009077"
        "53de0000000c49444154789c63f8cfc0000003010100c9fe92ef0000000049454e44ae426082"
    )
    (folder / "assets" / "paint.png").write_bytes(png)
    assets = """<compiler meshdir="assets" texturedir="assets"/><asset><mesh file="part.stl"/>
      <texture name="paint" type="2d" file="paint.png"/><material name="paint" texture="paint"/></asset><worldbody>"""
    text = text.replace("<worldbody>", assets, 1).replace(
        f'<body name="{body}"',
        f'<body name="{body}_mesh"><geom type="mesh" mesh="part" material="paint"/></body><body name="{body}"',
        1,
    )
    (folder / "robot.xml").write_text(text)
    return folder / "robot.xml"


@pytest.mark.filterwarnings("ignore:pads")  # the mount is no sensible place for a pad
def test_a_saved_scene_finds_the_meshes_of_both_files_from_anywhere(tmp_path, monkeypatch):
    arm = with_mesh(tmp_path / "arm", ARM, "link0", 0.1)
    hand = with_mesh(tmp_path / "hand", HAND, "palm", 0.02)
    scene = compose_scene(arm, hand, at="site:tool")
    out = tmp_path / "scenes" / "deep"
    out.mkdir(parents=True)
    (out / "scene.xml").write_text(scene.to_xml(out))
    assert str(tmp_path) not in (out / "scene.xml").read_text(), "paths are relative, so the folder may move"
    gripper = paxisim.attach(out / "scene.xml", LAYOUT, [paxisim.Mount("hand_left")])
    (out / "pads.xml").write_text(gripper.to_xml(out))
    monkeypatch.chdir(tmp_path.parent)
    moved = tmp_path.rename(tmp_path.with_name(f"{tmp_path.name}_moved"))
    for name in ("scene.xml", "pads.xml"):
        model = mujoco.MjModel.from_xml_path(str(moved / "scenes" / "deep" / name))
        assert model.nmesh == model.ntex == 2
        extents = sorted(model.geom_aabb[model.geom_type == int(mujoco.mjtGeom.mjGEOM_MESH), 3])
        assert extents == pytest.approx([0.01, 0.05], rel=1e-3)


# the robot, the table and the objects


def test_pads_on_a_hand_are_the_same_alone_and_on_a_link_that_is_long_and_turned():
    hands = [HAND, robot(two_fingers(name="h_"))]
    for hand, name in zip(hands, ("", "h_"), strict=True):
        scene = compose_scene(ARM, hand, at="site:tool", table=(0.6, 0, 0), objects=["box:30x30x60mm:0.2kg"])
        for alone, there in zip(find_mounts(hand).mounts, find_mounts(scene.spec).mounts, strict=True):
            assert there.body == alone.body
            np.testing.assert_allclose(there.pos, alone.pos, atol=1e-4)
            np.testing.assert_allclose(axes_of(there.quat), axes_of(alone.quat), atol=1e-3)
        data = mujoco.MjData(read(scene))
        mujoco.mj_forward(data.model, data)
        np.testing.assert_allclose(data.body(f"{name}palm").xpos, data.site("tool").xpos, atol=1e-6)
        np.testing.assert_allclose(data.body(f"{name}palm").xmat, data.site("tool").xmat, atol=1e-5)


def test_a_composed_scene_gets_pads_on_the_hand_alone_and_they_carry_the_load():
    """The bits of the fingers are unusual, and still they and their pads touch the table and the objects."""
    fingers = BOX.replace("<geom", '<geom contype="4" conaffinity="2"')
    hand = robot(two_fingers(left=fingers, right=fingers), extra='<option cone="elliptic" impratio="10"/>')
    objects = ["box:30x30x60mm:0.2kg", "cylinder:20x50mm:0.1kg", "ball:40mm:0.3kg@0.5,0.2,0.3"]
    scene = compose_scene(
        ARM.replace(TURNED, FLANGE),
        hand.replace('kp="200"', 'kp="1000"'),
        at="flange",
        table=(0.5, 0.1, 0.2),
        objects=objects,
    )
    assert "options as in the hand: elliptic cone, impratio 10" in scene.report
    gripper = paxisim.attach(scene.spec, LAYOUT)
    assert [mount.body for mount in gripper.mounts] == ["left", "right"]
    model = mujoco.MjModel.from_xml_string(gripper.to_xml())
    assert (model.opt.cone, model.opt.impratio) == (int(mujoco.mjtCone.mjCONE_ELLIPTIC), 10)
    paxisim.Gel().apply(model, pads := paxisim.find_pads(model))
    assert paxisim.TactileReadout(model, pads).read(mujoco.MjData(model)).shape == (2, 3, 4, 3)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)
    for name, (x, y, z), mass in (("box", (0.5, 0.08, 0.23), 0.2), ("cylinder", (0.5, 0.133, 0.225), 0.1)):
        np.testing.assert_allclose(data.body(name).xpos, (x, y, z), atol=3e-3)
        assert model.body(name).mass[0] == pytest.approx(mass)
    assert data.body("ball").xpos[2] == pytest.approx(0.22, abs=2e-3), "it fell onto the table"
    assert paxisim.squeeze(gripper, openings=(0.5,)).passed


def test_a_hand_inside_the_arm_gives_a_warning():
    """Its fingers would hold the arm's own link, which is two links away from them."""
    flipped = ARM.replace(TURNED, FLANGE.replace("/>", ' quat="0 1 0 0"/>')).replace('size="0.02"', 'size="0.06"')
    bent = HAND.replace("</body></body>", '<body><joint/><geom size="0.04" mass="0.1"/></body></body></body>')
    with pytest.warns(UserWarning, match="of the hand is .* mm inside link. of the arm: check the place and the or"):
        compose_scene(flipped, bent, at="flange")


def test_what_stands_beside_a_hand_file_stays_out_of_the_arm_and_a_hand_may_stand_alone():
    floor = '<geom type="plane" size="1 1 0.1"/><light pos="0 0 3"/>'
    scene = compose_scene(ARM, robot(two_fingers(), world=floor), at="link2")
    assert "the floor of the hand is left out" in scene.report
    assert (read(scene).nlight, np.any(read(scene).geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE))) == (0, False)
    alone = compose_scene(hand=robot(two_fingers(), world=floor), objects=["box:20x20x20mm:0.1kg@0,0,0.3"])
    assert read(alone).nlight == 1
    with pytest.warns(UserWarning, match="nothing is below box, so it falls"):
        compose_scene(hand=HAND, objects=["box:20x20x20mm:0.1kg@1,0,0.3"])


# meshes

BRICK = trimesh.creation.box((0.03, 0.02, 0.05))
CUP = trimesh.creation.annulus(0.02, 0.025, 0.08)


@pytest.mark.parametrize("scale", [1, 1000])
def test_an_object_from_a_mesh_is_as_one_from_numbers_whatever_the_file_s_unit(tmp_path, scale):
    BRICK.copy().apply_translation((1, 2, 3)).apply_scale(scale).export(tmp_path / "my brick.stl")
    text = f"mesh:{tmp_path}/my brick.stl:0.1kg"
    scene = compose_scene(hand=HAND, table=(0, 0, -0.3), objects=[text, text, "box:30x20x50mm:0.1kg"])
    assert f"my_brick: 30 x 20 x 50 mm, read in {'m' if scale == 1 else 'mm'}; convex" in scene.report
    data = mujoco.MjData(model := read(scene))
    mujoco.mj_step(model, data, 500)
    for name in ("my_brick", "my_brick2"):
        np.testing.assert_allclose(model.body(name).mass, 0.1, rtol=1e-5)
        np.testing.assert_allclose(np.sort(model.body(name).inertia), np.sort(model.body("box").inertia), rtol=1e-4)
        np.testing.assert_allclose(data.body(name).xpos[2], data.body("box").xpos[2], atol=2e-4)


@pytest.mark.parametrize("cut", [False, True])
def test_a_hollow_mesh_is_cut_into_convex_parts_or_its_hull_is_named(tmp_path, monkeypatch, cut):
    if cut:
        pytest.importorskip("vhacdx")
    else:
        monkeypatch.setitem(sys.modules, "vhacdx", None)  # as if it were not installed
    CUP.export(tmp_path / "cup.obj")
    scene = compose_scene(hand=HAND, table=(0, 0, -0.3), objects=[f"mesh:{tmp_path}/cup.obj:0.2kg"])
    model = read(scene)
    assert model.body("cup").mass == pytest.approx(0.2, rel=1e-5)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    above = data.body("cup").xpos + [0, 0, 0.1]
    fell = mujoco.mj_ray(model, data, above, [0, 0, -1.0], None, 1, -1, np.zeros(1, dtype=np.int32))
    expected = "convex parts" if cut else "its convex hull, 178 % larger than the mesh, since vhacdx is not installed"
    assert expected in scene.report
    assert fell == pytest.approx(0.14 if cut else 0.06, abs=2e-3), "the table is seen through the hole"


@pytest.mark.parametrize(
    ("name", "mesh", "message"),
    [
        ("far.stl", BRICK.copy().apply_scale(1e5), "the lengths of an object must lie between 1 and 1000 mm"),
        ("flat.stl", trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), "flat.stl has no volume"),
        ("junk.stl", b"\0" * 80 + b"\xff\xff\xff\x7f" + b"junk", "junk.stl is not a mesh that can be read"),
        ("junk.obj", b"f 1 2 3\n" * 3, "junk.obj is not a mesh that can be read"),
        ("cup.xml", b"<mujoco/>", "must be a file .stl, .obj, .ply, got"),
    ],
)
def test_a_file_that_is_no_object_is_refused(tmp_path, name, mesh, message):
    path = tmp_path / name
    path.write_bytes(mesh) if isinstance(mesh, bytes) else mesh.export(path)
    with pytest.raises(InvalidValueError, match=re.escape(message)) as caught:
        compose_scene(hand=HAND, table=(0, 0, -0.3), objects=[f"mesh:{path}:1kg"])
    assert "\n" not in str(caught.value)
    with pytest.raises(FileNotFoundError):
        compose_scene(hand=HAND, objects=["mesh:none.stl:1kg@0,0,1"])


def test_a_mesh_opens_no_file_that_it_names(tmp_path, monkeypatch):
    opened = []
    own = open
    monkeypatch.setattr("builtins.open", lambda path, *rest, **more: opened.append(path) or own(path, *rest, **more))
    (tmp_path / "paint.mtl").write_text("newmtl paint\n")
    (tmp_path / "brick.obj").write_text("mtllib paint.mtl\nusemtl paint\n" + BRICK.export(file_type="obj"))
    scene = compose_scene(hand=HAND, table=(0, 0, -0.3), objects=[f"mesh:{tmp_path}/brick.obj:1kg"])
    assert "brick: 30 x 20 x 50 mm, read in m; convex" in scene.report
    assert {Path(path).name for path in opened if isinstance(path, (str, Path))} == {"brick.obj"}


# bad input

TABLE = (0.6, 0, 0)
BOXES = ["box:300x300x10mm:1kg"] * 2


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"table": TABLE}, InvalidValueError, "nothing that could touch an object: expected an arm, a hand, or both"),
        ({"arm": ARM, "hand": "<mujoco/>", "at": "tool"}, InvalidValueError, "the hand has no geoms"),
        ({"arm": ARM, "hand": HAND, "at": 3}, InvalidValueError, "at must be the name of a body or site, got 3"),
        (
            {"arm": ARM, "objects": "ball:3mm:1kg"},
            InvalidValueError,
            "objects must be a list of texts, got 'ball:3mm:1kg'",
        ),
        ({"hand": HAND, "at": "tool"}, InvalidValueError, "expected an arm and a hand with it"),
        (
            {"arm": ARM, "hand": HAND},
            InvalidValueError,
            "expected at .--at., the body or site of the arm .*link3, tool",
        ),
        (
            {"arm": ARM, "hand": HAND, "at": "tol"},
            UnknownNameError,
            "body or site of the arm 'tol'; did you mean 'tool'",
        ),
        (
            {"arm": ARM.replace('name="tool"', 'name="link3"'), "hand": HAND, "at": "link3"},
            InvalidValueError,
            "has a body and a site 'link3': name one, body:link3 or site:link3",
        ),
        (
            {"arm": ARM, "hand": HAND.replace('"palm" >', '"palm"><freejoint/>'), "at": "tool"},
            InvalidValueError,
            "palm of the hand moves freely",
        ),
        ({"arm": "none.xml"}, InvalidValueError, "no such model file: none.xml"),
        (
            {"arm": HAND.replace('joint="left"', 'joint="x"')},
            InvalidValueError,
            "cannot compile the arm",
        ),
        (
            {"arm": ARM, "table": "here"},
            InvalidValueError,
            "a place must be X,Y,Z, three numbers up to 100 m, got 'here'",
        ),
        ({"arm": ARM, "table": (0, 0, np.nan)}, InvalidValueError, "a place must be X,Y,Z"),
        ({"arm": ARM, "table": (0, 0, 0.35)}, InvalidValueError, "link2 and table would overlap by"),
        ({"arm": ARM, "objects": ["ball:30mm:1kg"]}, InvalidValueError, "ball:30mm:1kg needs a place: give a table"),
        (
            {"arm": ARM, "table": TABLE, "objects": BOXES},
            InvalidValueError,
            "the objects need 0.87 m on a table of 0.6",
        ),
        (
            {"arm": ARM, "table": TABLE, "objects": ["ball:30mm:1kg@0.6,0,-0.01"]},
            InvalidValueError,
            "ball and table would overlap by 25 mm at the start",
        ),
        *(
            ({"arm": ARM, "table": TABLE, "objects": [text]}, InvalidValueError, message)
            for text, message in {
                "box": "an object must be box:AxBxCmm:MASSkg, .*got 'box'",
                "box:30x30mm:1kg": "an object must be",
                "ball:30x30mm:1kg": "an object must be",
                "cone:30x30mm:1kg": "an object must be",
                "box:30x30x30:1kg": "an object must be",
                "box:30x30x30mm:1kg@": "a place must be X,Y,Z.* got 'box:30x30x30mm:1kg@'",
                "box:30x30x30mm:1kg@1,2,inf": "a place must be X,Y,Z",
                "box:30x30x30mm:0kg": "the mass of an object must lie between 0.0001 and 100 kg",
                "ball:9999999mm:1kg": "the lengths of an object must lie between 1 and 1000 mm",
                "box:-30x30x30mm:1kg": "an object must be",
                "x" * 10_000: "an object must be .{150,250}$",
            }.items()
        ),
    ],
)
def test_what_cannot_be_composed(arguments, error, message):
    with pytest.raises(error, match=message):
        compose_scene(**arguments)


# public hands


@pytest.mark.skipif(not HANDS.is_dir(), reason="the public hands are not here")
@pytest.mark.parametrize(
    ("arm", "hand", "at", "bodies"),
    [
        ("ufactory_xarm7/xarm7.xml", None, "", ["left_finger", "right_finger"]),
        (None, "franka_emika_panda/hand.xml", "", ["left_finger", "right_finger"]),
        (ARM, "robotiq_2f85/2f85.xml", "tool", ["right_pad", "left_pad"]),
        (ARM, "ufactory_xarm7/hand.xml", "tool", ["left_finger", "right_finger"]),
    ],
)
def test_scenes_of_public_hands_get_pads_on_the_fingers_alone(tmp_path, monkeypatch, arm, hand, at, bodies):
    paths = [HANDS / name if name and name != ARM else name for name in (arm, hand)]
    table = (0.5, 0, -0.4 if arm is None else 0.05)
    scene = compose_scene(*paths, at=at, table=table, objects=["box:30x30x60mm:0.2kg", "ball:30mm:0.1kg"])
    check_same(scene.spec.copy().compile(), read(scene))
    gripper = paxisim.attach(scene.spec, LAYOUT)
    assert [mount.body for mount in gripper.mounts] == bodies
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "pads.xml").write_text(gripper.to_xml(tmp_path / "out"))
    monkeypatch.chdir(tmp_path)
    model = mujoco.MjModel.from_xml_path("out/pads.xml")
    pads, data = paxisim.find_pads(model), mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0) if model.nkey else None
    mujoco.mj_step(model, data, 100)
    assert len(pads) == 2
    assert np.isfinite(data.qpos).all()
    assert data.body("box").xpos[2] == pytest.approx(table[2] + 0.03, abs=2e-3)
