"""``paxisim emulate`` as a user runs it: a process with a port, fed by a demo, file, scene or function."""

import os
import re
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.cli.emulate import make_signal
from paxisim.cli.scene_signal import LONGEST_CATCH_UP, SceneSignal
from paxisim.hw.profiles.load import load_profile
from paxisim.recording import Recording

pytestmark = pytest.mark.real_time

SCENE = """<mujoco><option timestep="0.002" gravity="0 0 0"/><worldbody><body name="hand"/>
  <body name="ball" pos="0 0 -0.006"><joint type="slide" axis="0 0 1" damping="5"/>
    <geom type="box" size="0.02 0.02 0.006" mass="0.05"/></body></worldbody>
  <actuator><motor name="push" joint="{joint}" gear="1"/></actuator>
  <keyframe><key name="pushed" ctrl="6"/></keyframe></mujoco>"""
GRID = "gen3-highspeed-mc-m2020"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def scene(folder):
    """A plate that a motor presses onto a pad of 3x3 taxels."""
    layout = load_profile(GRID).wire_layout
    world = SCENE.replace('<joint type="slide"', '<joint name="slide" type="slide"').format(joint="slide")
    pad = paxisim.Pad(paxisim.TaxelLayout(3, 3, layout.pitch))
    tactile = paxisim.attach(world, pad, [paxisim.Mount("hand")])
    Path("scene.xml").write_text(tactile.to_xml(folder))
    return Path("scene.xml")


@contextmanager
def started(*words, **options):
    """Start an emulator that receives signals even if the test runner ignores them, e.g. under nohup or ``&``.

    The process is killed at the end if it still runs.
    """
    command = [sys.executable, "-W", "ignore", "-m", "paxisim.cli", "emulate", *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}

    def reached():
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)

    with subprocess.Popen(command, preexec_fn=reached, **pipes, **options) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_it_leaves_no_link_behind_however_it_is_ended(number):
    with started("--profile", GRID, "--link", "pad") as process:
        assert process.stdout.readline() == "pad\n"
        assert Path("pad").is_symlink()
        process.send_signal(number)
        said, complained = process.communicate(timeout=60)
    assert (process.returncode, said, complained) == (0, "", "")
    assert not Path("pad").is_symlink()


def test_a_process_with_a_port_that_a_driver_reads_and_ctrl_c_ends():
    serial = pytest.importorskip("serial")
    with started("--profile", GRID, "--link", "pad") as process:
        port = process.stdout.readline().strip()
        assert port == "pad"
        with serial.Serial(port, 921600, timeout=20) as line:
            line.write(bytes.fromhex("55AA000300000F00EF"))
            assert line.read(8) == bytes.fromhex("AA55000300000F00")
        process.send_signal(signal.SIGINT)
        said, complained = process.communicate(timeout=60)
    assert (process.returncode, said, complained) == (0, "", "")
    assert not Path("pad").is_symlink()


def test_on_a_terminal_it_says_how_it_goes():
    ours, theirs = os.openpty()
    command = [sys.executable, "-W", "ignore", "-m", "paxisim.cli", "emulate", "--profile", GRID, "--seconds", "1.2"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, text=True)
    said, _ = process.communicate(timeout=60)
    os.close(theirs)
    assert process.returncode == 0
    assert said.count("\n") == 1
    assert "0 messages/s, 0 in all, 0 bytes lost" in os.read(ours, 4096).decode()
    os.close(ours)


def test_it_ends_by_itself_after_so_many_seconds(capsys):
    assert main(["emulate", "--profile", GRID, "--seconds", "0.1"]) == 0
    said = capsys.readouterr()
    assert re.fullmatch(r"/dev/\S+\n", said.out)
    assert said.err == ""


def test_a_recording_is_felt(folder):
    profile = load_profile(GRID)
    force = np.random.default_rng(0).random((2, 1, 3, 3, 3)).astype(np.float32)
    for name in ("press.mcap", "press.npz"):
        Recording(time=np.array([0.0, 1.0]), measured=force, layout=profile.wire_layout).save(name)
        felt = make_signal(name, profile)
        np.testing.assert_array_equal(felt(0.5), force[0])
        np.testing.assert_array_equal(felt(1.5), force[1])


def test_of_a_recording_with_errors_the_sample_before_is_held(folder):
    profile = load_profile(GRID)
    force = np.random.default_rng(0).random((3, 1, 3, 3, 3)).astype(np.float32)
    held = force[0].copy()
    force[1, 0, 2] = np.nan
    Recording(time=np.array([0.0, 1.0, 2.0]), measured=force, layout=profile.wire_layout).save("press.mcap")
    felt = make_signal("press.mcap", profile)
    np.testing.assert_array_equal(felt(1.5), held)
    np.testing.assert_array_equal(felt(2.5), force[2])


def test_a_scene_runs_in_real_time(scene):
    felt = make_signal(str(scene), load_profile(GRID))
    assert felt(0.0).shape == (1, 3, 3, 3)
    for now in np.arange(0, 2.0, 0.02):
        force = felt(now)
    assert force[0, 2].sum() == pytest.approx(6.0, rel=0.05)
    assert abs(force[0, :2].sum()) < 0.5


def test_a_scene_that_is_asked_rarely_falls_behind_instead_of_hurrying(scene):
    felt = SceneSignal(scene, load_profile(GRID))
    felt(100.0)
    assert felt.seconds == pytest.approx(LONGEST_CATCH_UP, abs=5e-3)
    felt(100.02)
    assert felt.seconds == pytest.approx(LONGEST_CATCH_UP + 0.02, abs=5e-3)
    felt(0.0)
    assert felt.seconds == pytest.approx(LONGEST_CATCH_UP + 0.02, abs=5e-3)


def test_a_function_is_called():
    Path("felt.py").write_text("def press(now):\n    return [[[[now] * 3] * 3] * 3]\n")
    assert make_signal("felt:press", load_profile(GRID))(2.0).shape == (1, 3, 3, 3)
    assert main(["emulate", "--profile", GRID, "--signal", "felt:press", "--seconds", "0"]) == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--profile", "gen3-highsped"], "did you mean 'gen3-highspeed'"),
        (["--profile", "none.toml"], "none.toml"),
        (["--signal", "none.mcap"], "none.mcap"),
        (["--signal", "text.npz"], "text.npz"),
        (["--signal", "none.xml"], "no such model file"),
        (["--signal", "text.xml"], "MuJoCo cannot parse"),
        (["--signal", "bare.xml"], "no pads"),
        (["--signal", "press"], "MODULE:FUNCTION, got 'press'"),
        (["--signal", "nowhere:press"], "No module named 'nowhere'"),
        (["--signal", "broken:press"], "broken:press.*invalid syntax"),
        (["--signal", "math:presss"], "no attribute 'presss'"),
        (["--signal", "math:pi"], "expected a function, got float"),
        (["--signal", "math:sin"], r"of shape \(1, 3, 3, 3\)"),
        (["--signal", "math:log"], "the signal failed at 0.000 s"),
        (["--fault", "dorp=1"], "did you mean 'drop'"),
        (["--fault", "drop=7"], "from 0 to 1"),
        (["--rate-hz", "0"], "rate must be"),
        (["--rate-hz", "nan"], "rate must be"),
        (["--gate", "-2"], "gate must be"),
        (["--seed", "-1"], "seed"),
        (["--seconds", "nan"], "--seconds must be"),
        (["--link", "no/such/folder/pad"], "folder does not exist"),
        (["--link", "text.npz"], "is no link to a port"),
        (["--link", "my-link"], "is no link to a port"),
    ],
)
def test_bad_input_is_one_line_and_status_2(words, says, capsys, folder):
    for name in ("text.npz", "text.xml"):
        Path(name).write_text("some text")
    Path("bare.xml").write_text("<mujoco/>")
    Path("my-link").symlink_to("text.npz")
    Path("broken.py").write_text("def press(:")
    profile = [] if "--profile" in words else ["--profile", GRID]
    assert main(["emulate", "--seconds", "0", *profile, *words]) == 2
    said = capsys.readouterr()
    assert re.search(says, said.err), said.err
    assert said.err.count("\n") == 1
    assert said.out == ""
    assert Path("my-link").resolve() == Path("text.npz").resolve(), "a user's own link should stay"


def test_pads_of_another_shape_are_refused(scene, capsys):
    assert main(["emulate", "--profile", "gen1-pap-l4629", "--signal", str(scene), "--seconds", "0"]) == 2
    assert re.search(r"\(1, 3, 12, 10\).*\(1, 3, 3, 3\)", capsys.readouterr().err)


def test_a_function_that_fails_later_is_one_line_and_status_2():
    Path("felt.py").write_text(
        "def press(now):\n    assert now < 0.01, 'too late'\n    return [[[[0.0] * 3] * 3] * 3]\n"
    )
    pytest.importorskip("serial")
    with started("--profile", "gen3-highspeed-mc-m2020", "--signal", "felt:press") as process:
        import serial

        with serial.Serial(process.stdout.readline().strip(), 921600) as line:
            line.write(bytes.fromhex("55AA00101700010001D8"))
            _, complained = process.communicate(timeout=60)
    assert process.returncode == 2
    assert re.fullmatch(r"paxisim: error: the signal failed at .* AssertionError: too late\n", complained)
