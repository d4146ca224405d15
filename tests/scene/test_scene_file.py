"""Scenes and their TOML files."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scene.rigs import LAYOUT, recording

from paxisim import Drive, Gel, InvalidValueError, Mount, ObjectStart, Recording, Scene, UnknownNameError
from paxisim.scene import ready
from paxisim.scene.modes import MODES
from paxisim.scene.toml import format_scene

DRIVES = (
    Drive("tip.z", joint="depth", unit="mm", scale=-1.0, offset=0.012, resolution=0.05),
    Drive("arm", body="hand", unit="mm", offset=(0.0, 0.1, 0.0), quaternion="xyzw"),
    Drive('a "quoted" \\ name\x7f', actuator="close", unit="mA", scale=2.5, column=3),
    Drive("opening", joint="crank", unit="mm", offset=1e-3, curve=[(0.0, 0.8), (0.08, 0)]),
)


def test_what_is_saved_loads_as_it_was(tmp_path):
    scene = Scene(
        tmp_path / "gripper.xml",
        DRIVES,
        mode="servo",
        closing="tip.z",
        start=(ObjectStart("peg", (0.0, 0.0, 0.1)), ObjectStart("nut", stream="nut_pose", quaternion="xyzw")),
        settle=1.5,
        gel=Gel(modulus=8e4),
        pads=("left", "right"),
        sensor="paxini-gen1-l4629",
        pool=2,
        mounts=(Mount("finger", (0.0, 0.0, -0.019), replaces=("tip", 1)),),
    )
    (tmp_path / "sub").mkdir()
    scene.save(tmp_path / "sub" / "scene.toml")
    loaded = Scene.load(tmp_path / "sub" / "scene.toml")
    assert loaded.mjcf.resolve() == (tmp_path / "gripper.xml").resolve()
    for name in ("drives", "mode", "closing", "start", "settle", "gel", "pads", "sensor", "pool", "mounts"):
        assert getattr(loaded, name) == getattr(scene, name), name


GOOD = 'mjcf = "a.xml"\n[[drive]]\nstream = "z"\njoint = "z"\n'
BAD = {
    "": "the scene needs mjcf",
    "mjcf =": "not TOML",
    'mjcf = "a.xml"': "at least one drive",
    GOOD.replace("joint", "jiont"): r"unknown key of \[\[drive\]\] number 1 'jiont'; did you mean 'joint'",
    GOOD.replace('"z"\njoint', "3\njoint"): r"stream of \[\[drive\]\] number 1 must be a string, got 3",
    GOOD + 'body = "b"\n': "must name one joint, body or actuator, got joint and body",
    GOOD + 'unit = "cm"\n': "unknown unit 'cm'",
    GOOD + "scale = 0\n": "scale of the drive of 'z' must be finite and not 0",
    GOOD + "offset = [1, 2, 3]\n": "offset of the drive of 'z' must be a finite number",
    GOOD + "curve = [[0, 1], 2]\n": "curve of .*must be a list of lists of 2 numbers",
    GOOD + "curve = [[0, 1], [1, 2], [2, 1]]\n": "the curve of the drive of 'z' must have two or more points",
    GOOD + "quaternion = 'wxzy'\n": "unknown order of quaternions 'wxzy'",
    GOOD + "scale = true\n": "must be a number, got True",
    "mode = 'fast'\n" + GOOD: "mode must be one of auto, kinematic, fitted, shape, servo, force, got 'fast'",
    "mode = 'fitted'\n" + GOOD: "mode fitted needs closing",
    "closing = 'y'\n" + GOOD: r"closing must be one of the driving streams \(z\)",
    "settle = -1\n" + GOOD: "settle must lie between 0 and 60 s",
    GOOD + GOOD.partition("\n")[2].replace('stream = "z"', 'stream = "y"'): "two drives move the same joint 'z'",
    GOOD + "[gel]\nmodulos = 3\n": "unknown key of .gel. 'modulos'; did you mean 'modulus'",
    GOOD + "[gel]\nmodulus = -3\n": "modulus must be positive",
    GOOD + "[[start]]\nbody = 'peg'\n": "a start needs a body, and either pos or stream",
    "drive = [1]\nmjcf = 'a'": r"\[\[drive\]\] number 1 must be a table",
}


def test_a_file_that_is_no_scene_is_refused_in_one_line_that_names_it(tmp_path):
    path = tmp_path / "bad.toml"
    for text, word in BAD.items():
        path.write_text(text)
        with pytest.raises((InvalidValueError, UnknownNameError), match=word) as caught:
            Scene.load(path)
        assert "bad.toml" in str(caught.value)
        assert "\n" not in str(caught.value).strip()
    with pytest.raises(FileNotFoundError):
        Scene.load(tmp_path / "none.toml")


HOSTILE = {
    "/etc/passwd": "must be the text of an MJCF, got '/etc/passwd'",
    "<mujoco><include file='/etc/passwd'/></mujoco>": "names the file '/etc/passwd' in <include>",
    "<mujoco><asset><mesh file='/tmp/fifo.stl'/></asset></mujoco>": "names the file '/tmp/fifo.stl' in <mesh>",
    "<mujoco><asset><texture type='cube' fileup='../a.png'/></asset></mujoco>": "names the file '../a.png'",
    "<mujoco><asset><model name='a' file='b.xml'/></asset></mujoco>": "names the file 'b.xml' in <model>",
    "<mujoco><option timestep='1e-12'/></mujoco>": "a time step of 1e-12 s, below 5e-05 s",
    "<mujoco><option timestep='1e-6'/></mujoco>": "a time step of 1e-6 s",
    "<mujoco><option iterations='100000000'/></mujoco>": "asks for iterations='100000000'",
    "<mujoco><size memory='900G'/></mujoco>": "asks for memory='900G'",
    "<mujoco><asset><hfield nrow='60000' ncol='60000' size='1 1 1 1'/></asset></mujoco>": "a <hfield> of 3.6e",
    "<mujoco><worldbody><replicate count='200000'><geom size='1'/></replicate></worldbody></mujoco>": "makes 4e+05",
    "<mujoco>" + "<!--" + "x" * (17 << 20) + "--></mujoco>": "more than 16777216 bytes",
    "<html/>": "must be an MJCF, got <html>",
    "<mujoco>": "is not the text of an MJCF",
}


def test_the_model_in_somebodys_recording_opens_no_file_and_asks_for_little():
    toml = format_scene(Scene("a.xml", DRIVES[:1]), "scene.xml")
    for mjcf, word in HOSTILE.items():
        given = Recording([0.0], np.zeros((1, 1, 3, 2, 2)), metadata={"scene": mjcf, "replay": {"toml": toml}})
        with pytest.raises(InvalidValueError, match=re.escape(word)):
            Scene.from_recording(given)
        assert Scene.from_recording(given, trusted=True).mjcf == mjcf
    plain = Recording(np.arange(3.0), np.zeros((3, 1, 3, 2, 2)), metadata={"scene": "<mujoco/>"})
    with pytest.raises(InvalidValueError, match="holds no scene"):  # it was not replayed
        Scene.from_recording(plain)


def test_a_step_so_short_that_an_episode_never_ends_is_refused():
    tiny = ready.indenter(LAYOUT)
    tiny = replace(tiny, mjcf=str(tiny.mjcf).replace("<option ", '<option timestep="1e-9" '))
    with pytest.raises(InvalidValueError, match="more than 20000000 steps of 1e-09 s"):
        tiny.simulate(recording(np.arange(50) / 50, {name: np.linspace(-1e-3, 0, 50) for name in ("x", "y", "depth")}))


def test_the_scene_and_the_table_of_modes_on_the_page_of_replay(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "guides" / "replay.md").read_text(encoding="utf-8")
    path = tmp_path / "squeeze.toml"
    path.write_text(page.split("```toml\n")[1].split("```")[0], encoding="utf-8")
    scene = Scene.load(path)
    assert [(drive.stream, drive.joint, drive.unit) for drive in scene.drives] == [("opening", "left_slide", "mm")]
    assert scene.start[0].pos == (0.0, 0.0, 0.125)
    for name, mode in MODES.items():
        row = page.split(f"| `{name}` |")[1].splitlines()[0]
        assert row.strip(" |").endswith(", ".join(f"`{cause}`" for cause in mode.not_testable))
        assert ("`" in row) == bool(mode.not_testable)
