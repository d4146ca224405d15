"""Loading a gripper: always a copy, two faults repaired with a warning, all others refused in one line."""

import warnings

import mujoco
import numpy as np
import pytest
import trimesh
from scenes import GRIPPER

from paxisim.errors import InvalidValueError
from paxisim.models.load import compile_spec, load_spec, one_line


def write(folder, text, name="gripper.xml"):
    path = folder / name
    path.write_text(text)
    return path


# sound files


def test_a_spec_is_copied():
    spec = mujoco.MjSpec.from_string(GRIPPER)
    copy = load_spec(spec)
    copy.body("hand").pos = [1, 2, 3]
    assert copy is not spec
    np.testing.assert_array_equal(spec.body("hand").pos, [0, 0, 0])


@pytest.mark.parametrize("kind", [str, lambda path: path])
def test_a_path_as_a_string_or_not(tmp_path, kind):
    assert load_spec(kind(write(tmp_path, GRIPPER))).body("hand") is not None


def test_text_may_begin_with_space_or_a_declaration():
    assert load_spec("\n\t " + GRIPPER.strip()).body("hand") is not None
    assert load_spec('<?xml version="1.0"?>' + GRIPPER.strip()).body("hand") is not None
    assert load_spec("<!-- mine -->" + GRIPPER).body("hand") is not None


def test_a_sound_file_gives_no_warning(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_spec(write(tmp_path, GRIPPER))
        load_spec(GRIPPER)


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
    (folder / "parts").mkdir()
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


def test_mujoco_refuses_them_and_we_do_not(tmp_path):
    path = faulty(tmp_path, repeated=True, attribute=True)
    with pytest.raises(ValueError, match=r"."):
        mujoco.MjSpec.from_file(str(path)).compile()
    with pytest.warns(UserWarning, match="not sound") as caught:
        spec = load_spec(path)
    assert len(caught) == 1
    message = str(caught[0].message)
    assert "gripper.xml is not sound MJCF, read without" in message
    assert "the second mesh 'm'" in message
    assert "the attribute 'group' of default class 'visual'" in message
    model = compile_spec(spec, "it")
    assert model.nmesh == 1
    assert int(model.geom("g").group[0]) == 1, "the value of the class, not of the stray attribute"
    assert model.nmat == 1, "a material may share the name of a mesh"


def test_the_first_of_a_repeated_asset_stays(tmp_path):
    path = faulty(tmp_path, repeated=True)
    with pytest.warns(UserWarning, match="read without the second mesh 'm'"):
        spec = load_spec(path)
    assert compile_spec(spec, "it").geom_aabb[0, 3:].max() == pytest.approx(0.05)


def test_an_unknown_attribute_of_a_default_class(tmp_path):
    with pytest.warns(UserWarning, match=r"read without the attribute 'group' of default class 'visual'$"):
        spec = load_spec(faulty(tmp_path, attribute=True))
    assert spec.body("b") is not None


def test_the_warning_points_at_the_caller(tmp_path):
    with pytest.warns(UserWarning, match="not sound") as caught:
        load_spec(faulty(tmp_path, repeated=True))
    assert caught[0].filename == __file__


def test_a_repaired_file_still_finds_its_meshes_from_elsewhere(tmp_path, monkeypatch):
    (tmp_path / "robot").mkdir()
    (tmp_path / "elsewhere").mkdir()
    path = faulty(tmp_path / "robot", repeated=True)
    monkeypatch.chdir(tmp_path / "elsewhere")
    with pytest.warns(UserWarning, match="not sound"):
        spec = load_spec(path)
    assert compile_spec(spec, "it").nmesh == 1


# unreadable input


def test_no_such_file(tmp_path):
    with pytest.raises(InvalidValueError, match=r"^no such model file: .*gripper\.xml$"):
        load_spec(tmp_path / "gripper.xml")
    with pytest.raises(InvalidValueError, match=r"^no such model file: gripper$"):
        load_spec("gripper")
    with pytest.raises(InvalidValueError, match=r"^no such model file"):
        load_spec(tmp_path)


BROKEN = {
    "not xml": "my gripper",
    "not closed": "<mujoco><worldbody></mujoco>",
    "not MJCF": "<gripper/>",
    "unknown element": "<mujoco><worldbody><bodie/></worldbody></mujoco>",
    "unknown attribute": "<mujoco><worldbody><body nam='x'/></worldbody></mujoco>",
    "bad number": "<mujoco><worldbody><body pos='0 0 zero'/></worldbody></mujoco>",
    "empty": "",
    "repeated body and asset": """<mujoco><asset><material name="m"/><material name="m"/></asset>
       <worldbody><bodie/></worldbody></mujoco>""",
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN.keys())
def test_files_that_cannot_be_parsed(tmp_path, text):
    path = write(tmp_path, text)
    with pytest.raises(InvalidValueError, match=r"^MuJoCo cannot parse .*gripper\.xml: .+") as info:
        load_spec(path)
    assert "\n" not in str(info.value)


@pytest.mark.parametrize("text", [t for t in BROKEN.values() if t.startswith("<")])
def test_text_that_cannot_be_parsed(text):
    with pytest.raises(InvalidValueError, match=r"^MuJoCo cannot parse the XML text: .+") as info:
        load_spec(text)
    assert "\n" not in str(info.value)


def test_a_file_that_is_no_text(tmp_path):
    path = tmp_path / "gripper.xml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InvalidValueError, match="MuJoCo cannot parse"):
        load_spec(path)


def test_models_that_do_not_compile():
    spec = load_spec("<mujoco><worldbody><body><freejoint/></body></worldbody></mujoco>")
    with pytest.raises(InvalidValueError, match=r"^MuJoCo cannot compile the thing: .*mass") as info:
        compile_spec(spec, "the thing")
    assert "\n" not in str(info.value)


def test_compiling_leaves_the_spec_as_it_was():
    spec = load_spec(GRIPPER)
    first, second = compile_spec(spec, "it"), compile_spec(spec, "it")
    assert first is not second
    assert first.nbody == second.nbody


def test_one_line():
    assert one_line(ValueError("XML Error:\n  bad   thing\n\nline 3 ")) == "XML Error: bad thing line 3"
