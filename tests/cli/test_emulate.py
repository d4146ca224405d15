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
from paxisim import Recording, load_profile
from paxisim.cli import main
from paxisim.cli.emulate import make_signal
from paxisim.cli.scene_signal import LONGEST_CATCH_UP, SceneSignal

pytestmark = pytest.mark.real_time

SCENE = """<mujoco><option timestep="0.002" gravity="0 0 0"/><worldbody><body name="hand"/>
  <body name="ball" pos="0 0 -0.006"><joint name="slide" type="slide" axis="0 0 1" damping="5"/>
    <geom type="box" size="0.02 0.02 0.006" mass="0.05"/></body></worldbody>
  <actuator><motor name="push" joint="slide" gear="1"/></actuator>
  <keyframe><key name="pushed" ctrl="6"/></keyframe></mujoco>"""
GRID = "gen3-highspeed-mc-m2020"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def scene(folder):
    """A plate that a motor presses onto a pad of 3x3 taxels."""
    pad = paxisim.Pad(paxisim.TaxelLayout(3, 3, load_profile(GRID).wire_layout.pitch))
    tactile = paxisim.attach(SCENE, pad, [paxisim.Mount("hand")])
    Path("scene.xml").write_text(tactile.to_xml(folder))
    return Path("scene.xml")


@contextmanager
def started(*words, **options):
    """Start an emulator that receives signals even if the test runner ignores them, e.g. under nohup or ``&``.

    The process is killed at the end if it still runs.
    """
    command = [sys.executable, "-W", "ignore", "-m", "paxisim.cli", "emulate", "--profile", GRID, *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options}

    def reached():
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)

    with subprocess.Popen(command, preexec_fn=reached, **pipes) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, *[pytest.param(n, marks=pytest.mark.slow) for n in (15, 1)]])
def test_a_driver_reads_its_port_and_it_leaves_no_link_behind_however_it_is_ended(number):
    serial = pytest.importorskip("serial")
    with started("--link", "pad") as process:
        assert process.stdout.readline() == "pad\n"
        assert Path("pad").is_symlink()
        with serial.Serial("pad", 921600, timeout=20) as line:
            line.write(bytes.fromhex("55AA000300000F00EF"))
            assert line.read(8) == bytes.fromhex("AA55000300000F00")
        process.send_signal(number)
        said, complained = process.communicate(timeout=60)
    assert (process.returncode, said, complained) == (0, "", "")
    assert not Path("pad").is_symlink()


def test_on_a_terminal_it_says_how_it_goes():
    ours, theirs = os.openpty()
    with started("--seconds", "1.2", stderr=theirs) as process:
        said, _ = process.communicate(timeout=60)
    os.close(theirs)
    assert process.returncode == 0
    assert said.count("\n") == 1
    assert "0 messages/s, 0 in all, 0 bytes lost" in os.read(ours, 4096).decode()
    os.close(ours)


def test_a_function_is_called_and_one_that_fails_later_is_one_line_and_status_2():
    serial = pytest.importorskip("serial")
    Path("felt.py").write_text("def press(now):\n    return [[[[now] * 3] * 3] * 3]\n")
    assert make_signal("felt:press", load_profile(GRID))(2.0).shape == (1, 3, 3, 3)
    assert main(["emulate", "--profile", GRID, "--signal", "felt:press", "--seconds", "0"]) == 0
    late = "def press(now):\n    assert now < 0.01, 'too late'\n    return [[[[0.0] * 3] * 3] * 3]\n"
    Path("late.py").write_text(late)
    with (
        started("--signal", "late:press") as process,
        serial.Serial(process.stdout.readline().strip(), 921600) as line,
    ):
        line.write(bytes.fromhex("55AA00101700010001D8"))
        _, complained = process.communicate(timeout=60)
    assert process.returncode == 2
    assert re.fullmatch(r"paxisim: error: the signal failed at .* AssertionError: too late\n", complained)


@pytest.mark.parametrize("name", ["press.mcap", "press.npz"])
def test_a_recording_is_felt_and_its_errors_are_not(name):
    profile = load_profile(GRID)
    force = np.random.default_rng(0).random((4, 1, 3, 3, 3)).astype(np.float32)
    known = force.copy()
    force[2, 0, 2] = np.nan
    Recording(time=np.arange(4.0), measured=force, layout=profile.wire_layout).save(name)
    felt = make_signal(name, profile)
    for now, sample in ((0.5, 0), (1.5, 1), (2.5, 1), (3.5, 3)):  # the sample before an unknown one is held
        np.testing.assert_array_equal(felt(now), known[sample])


def test_a_scene_runs_in_real_time_and_falls_behind_where_it_is_asked_rarely(scene):
    felt = make_signal(str(scene), load_profile(GRID))
    assert felt(0.0).shape == (1, 3, 3, 3)
    for now in np.arange(0, 2.0, 0.02):
        force = felt(now)
    assert force[0, 2].sum() == pytest.approx(6.0, rel=0.05)
    assert abs(force[0, :2].sum()) < 0.5
    late = SceneSignal(scene, load_profile(GRID))
    for now, seconds in ((100.0, LONGEST_CATCH_UP), (100.02, LONGEST_CATCH_UP + 0.02), (0.0, LONGEST_CATCH_UP + 0.02)):
        late(now)
        assert late.seconds == pytest.approx(seconds, abs=5e-3)
