"""The command line from a user's view: every verb, and bad input that ends in one line and status 2."""

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
from paxisim.cli import GROUPS, main, parse
from paxisim.cli import VERBS as VERBS_ALONE
from paxisim.cli.mounts import format_mount, parse_mount
from paxisim.models.grippers import mounts_for, robosuite_gripper_path

GRIPPER = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
GRID = ["--rows", "6", "--cols", "5", "--pitch-mm", "4.35,4.52"]
MOUNTS = [
    f"{side}_finger pos-mm=0,0,-19 quat=0.5,-0.5,-0.5,0.5 replaces={side}_fingertip name={side}"
    for side in ("left", "right")
]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "gripper.xml").write_text(GRIPPER)
    return tmp_path


def test_pad_from_a_grid_loads_by_itself_and_is_the_same_to_the_byte():
    assert main(["pad", *GRID, "-o", "a.xml"]) == 0
    assert main(["pad", *GRID, "-o", "b.xml"]) == 0
    assert Path("a.xml").read_bytes() == Path("b.xml").read_bytes()
    pads = paxisim.find_pads(mujoco.MjModel.from_xml_path("a.xml"))
    assert pads.layout == paxisim.TaxelLayout(6, 5, (0.00435, 0.00452))


def test_pad_from_a_product_pooled():
    assert main(["pad", "--sensor", "paxini-gen1-l4629", "--pool", "2", "--sensors", "contact", "-o", "a.xml"]) == 0
    model = mujoco.MjModel.from_xml_path("a.xml")
    assert model.nsensor == 30
    assert paxisim.find_pads(model).layout == paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)


def test_pad_without_an_output_is_printed(capsys, folder):
    before = sorted(folder.iterdir())
    assert main(["pad", "--sensor", "paxini-gen1-l4629", "--pool", "2"]) == 0
    model = mujoco.MjModel.from_xml_string(capsys.readouterr().out)
    assert paxisim.find_pads(model).shape == (1, 3, 6, 5)
    assert sorted(folder.iterdir()) == before


def test_attach_with_mounts_writes_a_model_that_gives_its_pads_back(capsys):
    assert main(["attach", "gripper.xml", *GRID, "--mount", MOUNTS[0], "--mount", MOUNTS[1], "-o", "out.xml"]) == 0
    pads = paxisim.find_pads(mujoco.MjModel.from_xml_path("out.xml"))
    assert pads.names == ("left_pad", "right_pad")
    assert Path("out.png").read_bytes()[:4] == b"\x89PNG"
    assert "2 pads of 6x5 taxels" in capsys.readouterr().out


def test_attach_finds_mounts_says_so_and_its_words_can_be_given_back(capsys):
    assert main(["attach", "gripper.xml", *GRID, "-o", "found.xml"]) == 0
    out = capsys.readouterr().out
    words = re.findall(r"--mount '([^']*)'", out)
    assert len(words) == 2
    given = [word for text in words for word in ("--mount", text)]
    assert main(["attach", "gripper.xml", *GRID, *given, "-o", "given.xml"]) == 0
    found, again = (mujoco.MjModel.from_xml_path(name) for name in ("found.xml", "given.xml"))
    pads, pads_again = paxisim.find_pads(found), paxisim.find_pads(again)
    assert pads.names == pads_again.names
    assert found.body_pos[pads.bodies] == pytest.approx(again.body_pos[pads_again.bodies], abs=2e-6)


@pytest.mark.robosuite
@pytest.mark.filterwarnings("ignore:.*is not sound MJCF")
@pytest.mark.parametrize("name", ["panda", "robotiq_85", "jaco_three_finger"])
def test_attach_to_a_gripper_of_robosuite_fits_a_terminal(name, capsys):
    assert main(["attach", str(robosuite_gripper_path(name)), *GRID, "-o", "out.xml"]) == 0
    assert mujoco.MjModel.from_xml_path("out.xml").nbody
    out = capsys.readouterr().out
    assert max(len(line) for line in out.splitlines() if "replaces=" not in line) <= 80
    mounts = mounts_for(name)
    words = re.findall(r"--mount '([^']*)'", out)
    assert [parse_mount(text).body for text in words] == [mount.body for mount in mounts]
    assert [parse_mount(text).replaces for text in words] == [mount.replaces for mount in mounts]


def test_attach_conforms_to_round_fingers_and_says_how_near_the_taxels_are(capsys):
    flat, round_ = 'size="0.004 0.012 0.014" pos="-0.004', 'type="cylinder" size="0.012 0.014" pos="-0.012'
    Path("round.xml").write_text(GRIPPER.replace(flat, round_))
    words = [*GRID, "--mount", MOUNTS[0], "--mount", MOUNTS[1], "--conform"]
    assert main(["attach", "round.xml", *words, "-o", "out.xml"]) == 0
    printed = capsys.readouterr().out
    assert "pad left on left_finger: taxels within 0.0..0.0 mm of the skin" in " ".join(printed.split())
    assert "--mount" not in printed
    pads = paxisim.find_pads(mujoco.MjModel.from_xml_path("out.xml"))
    assert [np.ptp(layout.positions[:, 2]) for layout in pads.layouts] == pytest.approx([4.1e-3] * 2, abs=2e-4)
    assert main(["attach", "gripper.xml", *words, "-o", "flat.xml"]) == 0
    assert all(layout.is_grid for layout in paxisim.find_pads(mujoco.MjModel.from_xml_path("flat.xml")).layouts)


def test_attach_refuses_a_gripper_with_pads_of_another_shape_and_writes_nothing(capsys, folder):
    assert main(["attach", "gripper.xml", *GRID, "--mount", MOUNTS[0], "-o", "padded.xml"]) == 0
    before = sorted(folder.iterdir())
    words = ["--rows", "2", "--cols", "2", "--pitch-mm", "9", "--mount", MOUNTS[1]]
    assert main(["attach", "padded.xml", *words, "-o", "out.xml"]) == 2
    assert "padded.xml has pads of another shape already (left_pad 6x5)" in capsys.readouterr().err
    assert sorted(folder.iterdir()) == before
    assert main(["attach", "padded.xml", *GRID, "--mount", MOUNTS[1], "-o", "out.xml"]) == 0


def test_a_mount_survives_its_words():
    mount = paxisim.Mount("a body", (0.0012, -0.3, 0), (1, 2, -3, 0.5), ("tip", 3, "a body/3"), "left")
    again = parse_mount(format_mount(mount))
    assert again.pos == pytest.approx(mount.pos, abs=1e-6)
    assert again.quat == pytest.approx(mount.quat, abs=1e-5)
    assert (again.body, again.replaces, again.name) == (mount.body, mount.replaces, mount.name)


def test_sensors_lists_products_and_sources(capsys):
    assert main(["sensors"]) == 0
    assert "paxini-gen1-l4629" in capsys.readouterr().out
    assert main(["sensors", "--sources"]) == 0
    out = capsys.readouterr().out
    assert "arXiv" in out
    assert max(len(line) for line in out.splitlines() if "replaces=" not in line) <= 80


def test_demo_agrees_with_the_known_load_and_finds_a_free_name(capsys):
    assert main(["demo"]) == 0
    errors = [float(e) for e in re.findall(r"([\d.]+)%", capsys.readouterr().out)]
    assert len(errors) == 3
    assert max(errors) < 1
    assert main(["demo", "--squeeze", "12", "--seed", "3"]) == 0
    assert Path("paxisim-demo.png").exists()
    assert Path("paxisim-demo-2.png").exists()


def test_overwriting_is_asked_for():
    Path("a.xml").write_text("precious")
    assert main(["pad", *GRID, "-o", "a.xml"]) == 2
    assert Path("a.xml").read_text() == "precious"
    assert main(["pad", *GRID, "-o", "a.xml", "--force"]) == 0
    assert Path("a.xml").read_text().startswith("<mujoco")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["pad", "--rows", "nan", "--cols", "5", "--pitch-mm", "1", "-o", "a.xml"], "--rows"),
        (["pad", "--rows", "0", "--cols", "5", "--pitch-mm", "1", "-o", "a.xml"], "rows must be .* at least 1, got 0"),
        (["pad", "--rows", "6", "--cols", "-5", "--pitch-mm", "1", "-o", "a.xml"], "cols must be"),
        (
            ["pad", "--rows", "6", "--cols", "5", "--pitch-mm", "1,nan", "-o", "a.xml"],
            "--pitch-mm must lie between 0.01 and 1000",
        ),
        (["pad", "--rows", "6", "--cols", "5", "--pitch-mm", "1e300", "-o", "a.xml"], "--pitch-mm must .* got '1e300'"),
        (["demo", "--seed", "-1"], "--seed must be 0 or more, got -1"),
        (["pad", "--rows", "6", "--cols", "5", "--pitch-mm", "1,2,3", "-o", "a.xml"], "one or two numbers"),
        (["pad", "--rows", "6", "--cols", "5", "-o", "a.xml"], "all of --rows, --cols and --pitch-mm"),
        (["pad", "-o", "a.xml"], "either --sensor NAME or"),
        (["pad", *GRID, "--sensor", "paxini-gen1-l4629", "-o", "a.xml"], "either --sensor NAME or"),
        (["pad", *GRID, "--pool", "4", "-o", "a.xml"], "cannot pool 6x5 taxels in blocks of 4x4"),
        (["pad", *GRID, "--thickness-mm", "0", "-o", "a.xml"], "thickness must be positive"),
        (["pad", "--sensor", "paxini-gen1-14629", "-o", "a.xml"], "did you mean 'paxini-gen1-l4629'"),
        (["pad", *GRID, "-o", "no/such/folder/a.xml"], "folder does not exist"),
        (["pad", *GRID, "-o", "."], "is a folder"),
        (["pad", *GRID, "-o", "a.png"], r"must end in \.xml, got a\.png"),
        (["demo", "-o", "a.txt"], r"must end in \.png, got a\.txt"),
        (["attach", "gripper.xml", *GRID, "-o", "a.png"], r"must end in \.xml, got a\.png"),
        (["attach", "gripper.xml", *GRID, "-o", "a.xml", "--picture", "a.txt"], r"must end in \.png, got a\.txt"),
        (["attach", "gripper.xml", *GRID, "-o", "a.xml", "--picture", "b.xml", "--force"], r"must end in \.png"),
        (
            ["attach", "gripper.xml", *GRID, "-o", "a.xml", "--picture", "/proc/a.png"],
            "cannot write /proc/a.png|folder does not exist",
        ),
        (["demo", "-o", "/proc/a.png"], "cannot write /proc/a.png|folder does not exist"),
        (["emulate", "--link", "nodir/l"], "folder does not exist: .*nodir"),
        (["emulate", "--link", "/proc/l"], "cannot write /proc/l|folder does not exist"),
        (["attach", "gripper.xml", *GRID], "--output"),
        (["attach", "missing.xml", *GRID, "-o", "a.xml"], "no such model file: missing.xml"),
        (["attach", "broken.xml", *GRID, "-o", "a.xml"], "MuJoCo cannot parse broken.xml"),
        (["attach", "gripper.xml", *GRID, "--mount", "left_fingr", "-o", "a.xml"], "did you mean 'left_finger'"),
        (["attach", "gripper.xml", *GRID, "--mount", "hand pos-mm=a", "-o", "a.xml"], "numbers with commas"),
        (["attach", "gripper.xml", *GRID, "--mount", "hand at=1", "-o", "a.xml"], "unknown key of a mount 'at'"),
        (["attach", "gripper.xml", *GRID, "--mount", "hand replaces=x", "-o", "a.xml"], "unknown geom 'x'"),
        (
            ["attach", "gripper.xml", *GRID, "--mount", "hand replaces=hand/1", "-o", "a.xml"],
            "1 geom, there is no geom 1",
        ),
        (["attach", "gripper.xml", *GRID, "--mount", "hand replaces=\u00b2", "-o", "a.xml"], "unknown geom"),
        (["attach", "gripper.xml", *GRID, "--mount", "hand quat=0,0,0,0", "-o", "a.xml"], "quat must not be zero"),
        (["view", "gripper.xml"], "no pads|no display|window"),
        (["demo", "--squeeze", "inf"], "--squeeze must lie between"),
        (["grip"], "demo, example, sensors, pad"),
        ([], "demo, example, sensors, pad"),
    ],
)
def test_bad_input_is_one_line_and_status_2(words, says, capsys, folder):
    Path("broken.xml").write_text("<mujoco><worldbody><geom/></mujoco>")
    before = sorted(folder.iterdir())
    assert main(words) == 2
    error = capsys.readouterr().err
    assert re.search(says, error), error
    assert error.count("\n") == 1
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize("verb", [[], ["demo"], ["sensors"], ["pad"], ["attach"], ["view"]])
def test_help_fits_a_terminal(verb, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([*verb, "--help"]) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


def test_the_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"paxisim {paxisim.__version__}\n"


def test_the_installed_command_reports_in_the_shell():
    done = subprocess.run(
        [sys.executable, "-m", "paxisim.cli", "pad", *GRID, "-o", "/"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr == "paxisim: error: the output path must be a file, / is a folder\n"


def test_a_reader_that_has_seen_enough_is_no_error():
    many = [sys.executable, "-m", "paxisim.cli", "pad", "--rows", "60", "--cols", "60", "--pitch-mm", "1"]
    writer = subprocess.Popen(many, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    writer.stdout.readline()
    writer.stdout.close()
    assert writer.stderr.read() == b""
    assert writer.wait() == 0
    writer.stderr.close()


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_one_line(capsys, folder):
    folder.chmod(0o500)
    assert main(["pad", *GRID, "-o", "a.xml"]) == 2
    assert "cannot write a.xml: Permission denied" in capsys.readouterr().err


def test_example_writes_a_gripper_that_attach_takes_and_a_recording_that_can_be_diagnosed(capsys, folder):
    assert main(["example", "gripper"]) == 0
    assert main(["attach", "my_gripper.xml", *GRID, "-o", "out.xml"]) == 0
    assert main(["example", "recording"]) == 0
    recording = paxisim.Recording.load("paired.mcap")
    ratio = recording.measured[:, :, 2].sum() / recording.simulated[:, :, 2].sum()
    assert ratio == pytest.approx(0.9, abs=0.005)

    before = {path: path.read_bytes() for path in folder.iterdir()}
    assert main(["example", "gripper"]) == main(["example", "recording"]) == 2
    assert main(["example", "recording", "-o", "recording.csv"]) == 2
    assert main(["example", "gripper", "-o", "gripper.txt"]) == 2
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


VERBS = [[verb] for verb in VERBS_ALONE] + [[group, verb] for group, (verbs, _) in GROUPS.items() for verb in verbs]


@pytest.mark.parametrize("verb", VERBS, ids=" ".join)
def test_the_help_of_a_verb_ends_with_examples_that_parse(verb, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main([*verb, "--help"]) == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    assert "None" not in text
    assert "(default: )" not in text
    *_, examples = re.split(r"^Examples?:\n", text, flags=re.MULTILINE)
    assert examples != text
    for line in examples.replace("\\\n", " ").splitlines():
        words = shlex.split((line.partition(" | ")[2] or line).partition(" > ")[0])
        assert words[: 1 + len(verb)] == ["paxisim", *verb]
        assert callable(parse(words[1:])), line


def test_the_list_of_verbs_has_a_sentence_for_each(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert all(re.search(rf"^ +• {verb} +[A-Z]", text, re.MULTILINE) for verb in (*VERBS_ALONE, *GROUPS))
    assert "Example" not in text
    assert len(text.splitlines()) < 50


@pytest.mark.parametrize(
    ("words", "asked"),
    [
        (["atach"], "paxisim --help"),
        (["attach"], "paxisim attach --help"),
        (["attach", "--fource"], "paxisim attach --help"),
        (["scene"], "paxisim scene --help"),
        (["scene", "mak"], "paxisim scene --help"),
        (["scene", "make"], "paxisim scene make --help"),
    ],
)
def test_words_that_do_not_parse_point_to_the_help(words, asked, capsys):
    assert main(words) == 2
    assert capsys.readouterr().err.endswith(f"see {asked}\n")


@pytest.mark.parametrize(
    "words",
    [
        ["info", "none.mcap"],
        ["diagnose", "none.mcap", "-o", "found"],
        ["replay", "none.mcap", "--scene", "none.toml", "-o", "out.mcap"],
        ["calibrate", "none.csv", "--loads", "load", "-o", "out.json"],
        ["live", "none.mcap", "--save", "a.rrd"],
    ],
    ids=lambda words: words[0],
)
def test_a_file_that_is_not_there_is_a_sentence(words, capsys, folder):
    before = sorted(folder.iterdir())
    assert main(words) == 2
    error = capsys.readouterr().err
    assert re.fullmatch(r"paxisim: error: no such file or folder: none\.\w+\n", error), error
    assert sorted(folder.iterdir()) == before
