"""The command line as a whole, and the verbs that make models: pad, attach, sensors, demo and example."""

import os
import re
import shlex
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np
import pytest

import paxisim
from paxisim.cli import GROUPS, VERBS, main, parse
from paxisim.cli.mounts import format_mount, parse_mount
from paxisim.models.grippers import mounts_for, robosuite_gripper_path

GRIPPER = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
GRID = ["--rows", "6", "--cols", "5", "--pitch-mm", "4.35,4.52"]
MOUNTS = [
    f"{side}_finger pos-mm=0,0,-19 quat=0.5,-0.5,-0.5,0.5 replaces={side}_fingertip name={side}"
    for side in ("left", "right")
]
GIVEN = ["--mount", MOUNTS[0], "--mount", MOUNTS[1]]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    (tmp_path / "gripper.xml").write_text(GRIPPER)
    return tmp_path


def test_an_opengl_that_is_not_there_is_one_line():
    command = [sys.executable, "-m", "paxisim", "attach", "gripper.xml", *GRID]
    done = subprocess.run(command, env={**os.environ, "MUJOCO_GL": "none"}, capture_output=True, text=True)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("paxisim: error: MuJoCo cannot be loaded with MUJOCO_GL=none (")
    assert "set MUJOCO_GL=egl" in line


def pads_in(name):
    return paxisim.find_pads(mujoco.MjModel.from_xml_path(name))


# help


def test_the_list_of_verbs_has_a_sentence_for_each(capsys):
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert main([]) == 0
    assert capsys.readouterr().out == text
    listed = re.findall(r"^  (\w+) +[A-Z]", text, re.MULTILINE)
    assert sorted(listed) == sorted((*VERBS, *GROUPS))
    assert "Example" not in text
    assert len(text.splitlines()) < 60
    assert max(map(len, text.splitlines())) <= 80
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"paxisim {paxisim.__version__}\n"


def test_the_help_of_each_verb_ends_with_examples_that_parse(capsys):
    grouped = [[group, verb] for group, (verbs, _) in GROUPS.items() for verb in verbs]
    for verb in [[verb] for verb in VERBS] + grouped:
        assert main([*verb, "--help"]) == 0
        text = capsys.readouterr().out
        assert max(map(len, text.splitlines())) <= 80, verb
        assert "None" not in text, verb
        assert "(default: )" not in text, verb
        *_, examples = re.split(r"^Examples?:\n", text, flags=re.MULTILINE)
        assert examples != text, verb
        for line in examples.replace("\\\n", " ").splitlines():
            words = shlex.split((line.partition(" | ")[2] or line).partition(" > ")[0])
            assert words[: 1 + len(verb)] == ["paxisim", *verb]
            assert callable(parse(words[1:])), line


# pads


def test_a_pad_loads_by_itself_and_is_the_same_to_the_byte(capsys, folder):
    for name in ("a.xml", "b.xml"):
        assert main(["pad", *GRID, "-o", name]) == 0
    assert Path("a.xml").read_bytes() == Path("b.xml").read_bytes()
    assert pads_in("a.xml").layout == paxisim.TaxelLayout(6, 5, (0.00435, 0.00452))

    product = ["pad", "--sensor", "paxini-gen1-l4629", "--pool", "2"]
    assert main([*product, "--sensors", "contact", "-o", "a.xml", "--force"]) == 0
    assert mujoco.MjModel.from_xml_path("a.xml").nsensor == 30
    assert pads_in("a.xml").layout == paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)
    assert main([*product, "--subdivide", "2", "-o", "a.xml", "--force"]) == 0
    assert pads_in("a.xml").layout.pool(2, 2) == paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)
    before = sorted(folder.iterdir())
    capsys.readouterr()
    assert main(product) == 0, "without an output it is printed"
    model = mujoco.MjModel.from_xml_string(capsys.readouterr().out)
    assert paxisim.find_pads(model).shape == (1, 3, 6, 5)
    assert sorted(folder.iterdir()) == before


def test_attach_finds_mounts_says_so_and_its_words_can_be_given_back(capsys):
    assert main(["attach", "gripper.xml", *GRID, "-o", "found.xml"]) == 0
    out = capsys.readouterr().out
    words = re.findall(r"--mount '([^']*)'", out)
    assert len(words) == 2
    assert "2 pads of 6x5 taxels" in out
    assert Path("found.png").read_bytes()[:4] == b"\x89PNG"
    given = [word for text in words for word in ("--mount", text)]
    assert main(["attach", "gripper.xml", *GRID, *given, "-o", "given.xml"]) == 0
    assert "--mount" not in capsys.readouterr().out
    (found, pads), (again, pads_again) = (
        (model, paxisim.find_pads(model)) for model in map(mujoco.MjModel.from_xml_path, ("found.xml", "given.xml"))
    )
    assert pads.names == pads_again.names == ("left_finger_pad", "right_finger_pad")
    assert found.body_pos[pads.bodies] == pytest.approx(again.body_pos[pads_again.bodies], abs=2e-6)


def test_an_output_is_named_after_the_input_and_never_overwritten(capsys):
    assert main(["attach", "gripper.xml", *GRID]) == 0
    assert Path("gripper_with_pads.xml").exists()
    assert Path("gripper_with_pads.png").exists()
    for words, output in (
        (["protocol", "press"], "press.json"),
        (["scene", "make", "indenter", *GRID], "indenter.toml"),
        (["scene", "compose", "--hand", "gripper.xml"], "scene.xml"),
    ):
        assert main(words) == 0
        before = Path(output).read_bytes()
        capsys.readouterr()
        assert main(words) == 2
        assert f"{output} exists; --force overwrites it" in capsys.readouterr().err
        assert Path(output).read_bytes() == before


def test_attach_adds_a_pad_of_the_same_shape_beside_another():
    assert main(["attach", "gripper.xml", *GRID, "--mount", MOUNTS[0], "-o", "padded.xml"]) == 0
    assert main(["attach", "padded.xml", *GRID, "--mount", MOUNTS[1], "-o", "out.xml"]) == 0
    assert pads_in("out.xml").names == ("left_pad", "right_pad")


def test_attach_conforms_to_round_fingers_and_says_how_near_the_taxels_are(capsys):
    flat, round_ = 'size="0.004 0.012 0.014" pos="-0.004', 'type="cylinder" size="0.012 0.014" pos="-0.012'
    Path("round.xml").write_text(GRIPPER.replace(flat, round_))
    assert main(["attach", "round.xml", *GRID, *GIVEN, "--conform", "-o", "out.xml"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "pad left on left_finger: taxels within 0.0..0.0 mm of the skin" in said
    heights = [np.ptp(layout.positions[:, 2]) for layout in pads_in("out.xml").layouts]
    assert heights == pytest.approx([4.1e-3] * 2, abs=2e-4)


@pytest.mark.robosuite
@pytest.mark.filterwarnings("ignore:.*is not sound MJCF")
@pytest.mark.parametrize(
    "name",
    [
        "panda",
        pytest.param("robotiq_85", marks=pytest.mark.slow),
        pytest.param("jaco_three_finger", marks=pytest.mark.slow),
    ],
)
def test_attach_to_a_gripper_of_robosuite_fits_a_terminal(name, capsys):
    assert main(["attach", str(robosuite_gripper_path(name)), *GRID, "-o", "out.xml"]) == 0
    assert mujoco.MjModel.from_xml_path("out.xml").nbody
    out = capsys.readouterr().out
    assert max(len(line) for line in out.splitlines() if "replaces=" not in line) <= 80
    parsed = [parse_mount(text) for text in re.findall(r"--mount '([^']*)'", out)]
    assert [(mount.body, mount.replaces) for mount in parsed] == [
        (mount.body, mount.replaces) for mount in mounts_for(name)
    ]


def test_a_mount_survives_its_words():
    mount = paxisim.Mount("a body", (0.0012, -0.3, 0), (1, 2, -3, 0.5), ("tip", 3, "a body/3"), "left")
    again = parse_mount(format_mount(mount))
    assert again.pos == pytest.approx(mount.pos, abs=1e-6)
    assert again.quat == pytest.approx(mount.quat, abs=1e-5)
    assert (again.body, again.replaces, again.name) == (mount.body, mount.replaces, mount.name)


# other verbs


def test_sensors_lists_products_and_sources(capsys):
    assert main(["sensors"]) == 0
    assert "paxini-gen1-l4629" in capsys.readouterr().out
    assert main(["sensors", "--sources"]) == 0
    out = capsys.readouterr().out
    assert "arXiv" in out
    assert max(map(len, out.splitlines())) <= 80


def test_a_scene_is_composed_and_gets_pads(capsys, folder):
    arm = "<mujoco><worldbody><body name='link'><joint/><geom size='0.01' mass='1'/>{}</body></worldbody></mujoco>"
    (folder / "arm.xml").write_text(arm.format("<site name='flange' pos='0 0 0.5'/>"))
    words = ["scene", "compose", "--arm", "arm.xml", "--at", "flange", "--hand", "gripper.xml", "--table", "0,0.5,0"]
    assert main([*words, "--object", "box:30x30x60mm:0.2kg", "--object", "ball:4mm:0.1kg@0,0.4,1", "-o", "s.xml"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "robot: arm.xml with gripper.xml on flange",
        "table: its top at 0, 0.5, 0 m",
        "box (box:30x30x60mm:0.2kg): its centre at 0, 0.5, 0.03 m",
        "ball (ball:4mm:0.1kg): its centre at 0, 0.4, 1 m",
        "s.xml is written; next: paxisim attach s.xml --help",
    ]
    assert main(["attach", "s.xml", *GRID, "-o", "pads.xml"]) == 0
    assert pads_in("pads.xml").names == ("left_finger_pad", "right_finger_pad")
    assert mujoco.MjModel.from_xml_path("pads.xml").body("box").mass[0] == pytest.approx(0.2)


def test_demo_agrees_with_the_known_load_and_finds_a_free_name(capsys):
    assert main(["demo"]) == 0
    errors = [float(e) for e in re.findall(r"([\d.]+)%", capsys.readouterr().out)]
    assert len(errors) == 3
    assert max(errors) < 1
    assert main(["demo", "--squeeze", "12", "--seed", "3"]) == 0
    assert Path("paxisim-demo.png").exists()
    assert Path("paxisim-demo-2.png").exists()


def test_examples_are_a_gripper_and_a_recording_of_a_sensor_that_reads_too_little(capsys):
    assert main(["example", "gripper"]) == 0
    assert Path("my_gripper.xml").read_text(encoding="utf-8") == GRIPPER
    following = capsys.readouterr().out.splitlines()[-1]
    assert following == "paxisim attach my_gripper.xml --sensor paxini-gen1-l4629 --pool 2 -o tactile_gripper.xml"
    assert main(shlex.split(following)[1:]) == 0
    assert main(["example", "recording"]) == 0
    recording = paxisim.Recording.load("paired.mcap")
    ratio = recording.measured[:, :, 2].sum() / recording.simulated[:, :, 2].sum()
    assert ratio == pytest.approx(0.9, abs=0.005)


# as a process


def test_the_installed_command_reports_in_the_shell_and_a_reader_may_have_seen_enough():
    command = [sys.executable, "-m", "paxisim.cli", "pad", "--rows", "60", "--cols", "60", "--pitch-mm", "1"]
    done = subprocess.run([*command, "-o", "/"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "paxisim: error: the output path must be a file, / is a folder\n"
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as writer:
        writer.stdout.readline()
        writer.stdout.close()  # as `head` does
        assert writer.stderr.read() == b""
    assert writer.returncode == 0
    reader, closed = os.pipe()
    os.close(reader)
    for words in (["--help"], ["--version"], ["attach", "--help"], ["sensors"]):
        done = subprocess.run([*command[:3], *words], stdout=closed, stderr=subprocess.PIPE, check=False)
        assert (done.returncode, done.stderr) == (0, b""), words
    os.close(closed)


INTERRUPTED = """
import runpy, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == "tyro":
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
runpy.run_module("paxisim", run_name="__main__")
"""


def test_ctrl_c_while_it_loads_is_one_line():
    run = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr, run.stdout) == (130, "paxisim: interrupted\n", "")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_one_line(capsys, folder):
    folder.chmod(0o500)
    assert main(["pad", *GRID, "-o", "a.xml"]) == 2
    assert "cannot write a.xml: Permission denied" in capsys.readouterr().err
