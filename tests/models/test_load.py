"""Loading a gripper: always a copy, two faults repaired with a warning, all others refused in one line."""

import mujoco
import pytest
import trimesh
from scenes import GRIPPER

from paxisim.errors import InvalidValueError
from paxisim.models.load import compile_spec, load_spec, one_line


def write(folder, text, name="gripper.xml"):
    path = folder / name
    path.write_text(text)
    return path


def test_text_may_begin_with_space_a_declaration_or_a_comment():
    for text in ("\n\t " + GRIPPER.strip(), '<?xml version="1.0"?>' + GRIPPER.strip(), "<!-- mine -->" + GRIPPER):
        assert load_spec(text).body("hand") is not None


def test_a_file_finds_its_meshes_and_includes_from_anywhere(tmp_path, monkeypatch):
    folder = tmp_path / "robot"
    (folder / "meshes").mkdir(parents=True)
    trimesh.creation.icosphere(radius=0.1).export(folder / "meshes" / "ball.stl")
    write(folder, "<mujoco><worldbody><body name='inner'/></worldbody></mujoco>", "inner.xml")
    path = write(
        folder,
        """<mujoco><compiler meshdir="meshes"/><include file="inner.xml"/>
        <asset><mesh name="ball" file="ball.stl"/></asset>
        <worldbody><geom type="mesh" mesh="ball"/></worldbody></mujoco>""",
    )
    monkeypatch.chdir(tmp_path)
    for source in (path, "robot/gripper.xml"):
        spec = load_spec(source)
        assert spec.body("inner") is not None
        assert compile_spec(spec, "it").nmesh == 1


# the two faults in grippers that robosuite ships and tolerates


def faulty(folder, *, repeated=False, attribute=False):
    """Write a file with a repeated mesh, or an attribute that a default class does not have."""
    (folder / "parts").mkdir(parents=True)
    for name, size in (("first", 0.1), ("second", 0.2)):
        trimesh.creation.box([size] * 3).export(folder / "parts" / f"{name}.stl")
    again = '<mesh name="m" file="second.stl"/><!-- a comment -->' if repeated else ""
    extra = 'group="3"' if attribute else ""
    return write(
        folder,
        f"""<mujoco model="faulty"><compiler meshdir="parts"/>
        <default><default class="visual" {extra}><geom group="1"/></default></default>
        <asset><mesh name="m" file="first.stl"/>{again}<material name="m" rgba="1 0 0 1"/></asset>
        <worldbody><body name="b"><geom name="g" class="visual" type="mesh" mesh="m" material="m"/></body></worldbody>
        </mujoco>""",
    )


@pytest.mark.parametrize("repeated", [True, False])
@pytest.mark.parametrize("attribute", [True, False])
def test_mujoco_refuses_them_and_we_do_not(tmp_path, monkeypatch, repeated, attribute):
    if not repeated and not attribute:
        load_spec(faulty(tmp_path))  # a warning would be an error
        return
    path = faulty(tmp_path / "robot", repeated=repeated, attribute=attribute)
    with pytest.raises(ValueError, match=r"."):
        mujoco.MjSpec.from_file(str(path)).compile()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    with pytest.warns(UserWarning, match=r"gripper.xml is not sound MJCF, read without") as caught:
        spec = load_spec(path)
    assert len(caught) == 1
    assert caught[0].filename == __file__, "it points at the caller"
    message = str(caught[0].message)
    assert ("the second mesh 'm'" in message) == repeated
    assert ("the attribute 'group' of default class 'visual'" in message) == attribute
    model = compile_spec(spec, "it")
    assert (model.nmesh, model.nmat) == (1, 1), "a material may share the name of a mesh"
    assert int(model.geom("g").group[0]) == 1, "the value of the class, not of the stray attribute"
    assert model.geom_aabb[0, 3:].max() == pytest.approx(0.05), "the first mesh"


# unreadable input

BROKEN = {
    "not xml": "my gripper",
    "empty": "",
    "not closed": "<mujoco><worldbody></mujoco>",
    "unknown element": "<mujoco><worldbody><bodie/></worldbody></mujoco>",
    "also a repeated asset": """<mujoco><asset><material name="m"/><material name="m"/></asset>
       <worldbody><bodie/></worldbody></mujoco>""",
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN.keys())
def test_what_cannot_be_parsed(tmp_path, text):
    sources = [(write(tmp_path, text), r"^MuJoCo cannot parse .*gripper\.xml: .+")]
    if text.startswith("<"):
        sources.append((text, r"^MuJoCo cannot parse the XML text: .+"))
    for source, message in sources:
        with pytest.raises(InvalidValueError, match=message) as info:
            load_spec(source)
        assert "\n" not in str(info.value)


def test_what_is_not_there_is_no_text_or_does_not_compile(tmp_path):
    for source in (tmp_path / "gripper.xml", "gripper", tmp_path):
        with pytest.raises(InvalidValueError, match=r"^no such model file: .*"):
            load_spec(source)
    (tmp_path / "gripper.xml").write_bytes(bytes(range(256)))
    with pytest.raises(InvalidValueError, match="MuJoCo cannot parse"):
        load_spec(tmp_path / "gripper.xml")
    spec = load_spec("<mujoco><worldbody><body><freejoint/></body></worldbody></mujoco>")
    with pytest.raises(InvalidValueError, match=r"^MuJoCo cannot compile the thing: .*mass") as info:
        compile_spec(spec, "the thing")
    assert "\n" not in str(info.value)
    assert one_line(ValueError("XML Error:\n  bad   thing\n\nline 3 ")) == "XML Error: bad thing line 3"
