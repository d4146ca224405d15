"""``paxisim live`` for a recording, a scene and an emulated sensor, and the input it refuses."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rerun", exc_type=ImportError)
from rrd_files import read_rrd

import paxisim
from paxisim.cli import main
from paxisim.recording import Recording
from paxisim.viz.live import LiveView
from paxisim.viz.live_sources import open_source

DEADLINE = 60.0  # s
LAYOUT = paxisim.TaxelLayout(3, 3, 3e-3)
PLATE = """<mujoco><option timestep="0.002" gravity="0 0 9.81"/><worldbody><body name="hand"/>
  <body pos="0 0 -0.0062"><joint type="slide" axis="0 0 1" damping="5"/>
    <geom type="box" size="0.02 0.02 0.006" mass="0.1"/></body></worldbody></mujoco>"""

pytestmark = [pytest.mark.real_time, pytest.mark.filterwarnings("ignore:.*never tried on a device:UserWarning")]


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """A 0.1 kg plate lying on a pad."""
    folder = tmp_path_factory.mktemp("plate")
    tactile = paxisim.attach(PLATE, paxisim.Pad(LAYOUT), [paxisim.Mount("hand", name="palm")])
    return tactile.to_xml(folder)


@pytest.fixture
def folder(tmp_path, monkeypatch, plate):
    monkeypatch.chdir(tmp_path)
    Path("scene.xml").write_text(plate)
    return tmp_path


def record(path, *, simulated=True, **options):
    """Save a recording of 30 readings in 0.6 s."""
    measured = np.random.default_rng(0).uniform(0, 4, (30, 2, *LAYOUT.shape)).astype(np.float32)
    options = {"time": 5 + 0.02 * np.arange(30)} | options
    recording = Recording(
        measured=measured, simulated=0.5 * measured if simulated else None, layout=LAYOUT, pads=("l", "r"), **options
    )
    recording.save(path)
    return recording


@pytest.mark.parametrize("name", ["press.npz", "press.mcap"])
def test_a_recording_is_drawn_whole_beside_its_simulation(name, folder, capsys):
    recording = record(name)
    assert main(["live", name, "--save", "view.rrd"]) == 0
    assert "wrote view.rrd, 30 of 30 readings drawn" in capsys.readouterr().out
    found = read_rrd("view.rrd")
    for line in ("measured", "simulated", "residual"):
        for pad in ("l", "r"):
            times, _ = found[f"/pads/{line}/{pad}/taxels", "color"]
            np.testing.assert_allclose(times, 0.02 * np.arange(30), atol=1e-6)
    totals = recording.measured[:, 1].sum(axis=(-2, -1))
    np.testing.assert_allclose(found["/force/r/measured", "scalar"][1], totals, rtol=1e-4)
    (scale,) = {tuple(scale) for scale in found["/scale", "scalar"][1]}  # one for the whole recording
    assert scale[0] == pytest.approx(recording.measured[:, :, 2].max(), rel=1e-6)


def test_a_part_of_a_recording_without_a_simulation_has_one_line(folder):
    record("press.npz", simulated=False)
    assert main(["live", "press.npz", "--save", "view.rrd", "--seconds", "0.2"]) == 0
    found = read_rrd("view.rrd")
    assert len(found["/pads/measured/l/taxels", "color"][0]) == 11
    assert not [entity for entity, _ in found if "residual" in entity or "simulated" in entity]


def test_a_recording_in_real_time_takes_its_time_and_an_episode_follows_the_one_before(folder):
    record("press.npz", time=np.concatenate([0.02 * np.arange(15)] * 2), episode=np.repeat([0, 1], 15))
    with open_source("press.npz", None, real_time=True) as source:
        began = time.monotonic()
        times = [moment.time for moment in source.moments]
    assert time.monotonic() - began >= 0.02 * 29
    np.testing.assert_allclose(times, 0.02 * np.arange(30), atol=1e-9)


def test_a_scene_runs_and_its_pads_feel_the_weight(folder, capsys):
    assert main(["live", "scene.xml", "--save", "view.rrd", "--seconds", "2"]) == 0
    assert "201 of 201" in capsys.readouterr().out
    times, totals = read_rrd("view.rrd")["/force/palm_pad/simulated", "scalar"]
    np.testing.assert_allclose(np.diff(times), 0.01, atol=1e-6)
    assert totals[-1][2] == pytest.approx(0.981, rel=0.02)
    with open_source("scene.xml", None, real_time=True) as source:
        assert not source.ends
        began = time.monotonic()
        assert next(moment for moment in source.moments if moment.time > 0.3)
    assert time.monotonic() - began >= 0.28


@pytest.fixture
def board():
    """Function that starts an emulated board whose taxels read one normal force (N)."""
    pytest.importorskip("serial")
    pytest.importorskip("pty", reason="no pseudo-terminals here")
    from paxisim.hw.emulation.emulator import Emulator
    from paxisim.hw.profiles.load import load_profile

    def start(name, newtons, **options):
        profile = load_profile(name)
        pressed = np.zeros((len(profile.slots), *profile.wire_layout.shape))
        pressed[:, 2] = newtons
        return profile, Emulator(profile, lambda now: pressed, **options)

    return start


def test_a_sensor_is_read_until_the_seconds_are_over(folder, board, capsys):
    profile, emulator = board("gen3-highspeed-mc-m2020", 5.0)
    with emulator:
        words = ["live", emulator.port, "--profile", profile.name, "--save", "view.rrd", "--seconds", "1"]
        assert main(words) == 0
    drawn, shown = map(int, re.search(r"(\d+) of (\d+) readings drawn", capsys.readouterr().out).groups())
    assert shown >= drawn > 5
    times, totals = read_rrd("view.rrd")[f"/force/{profile.slots[0].name}/measured", "scalar"]
    assert len(times) == drawn
    assert times[-1] <= 1.0
    np.testing.assert_allclose(totals, [[0, 0, 5.0 * profile.wire_layout.taxels]] * drawn, rtol=1e-5)


def test_a_pad_in_error_is_drawn_as_unknown(board):
    from paxisim.hw.emulation.faults import Faults

    for status in (0.0, 1.0):  # the board reports the status of its first pad
        profile, emulator = board("gen1-stream", 5.0, faults=Faults(status=status))
        with emulator, open_source(emulator.port, profile.name, real_time=True) as source:
            moment = next(source.moments)
        assert np.isnan(moment.measured[0]).all() == bool(status)
        assert np.isfinite(moment.measured[1:]).all()


def test_a_sensor_that_goes_away_leaves_what_was_seen(folder, board, capsys, monkeypatch):
    from paxisim.viz import live_sources

    monkeypatch.setattr(live_sources, "_RECONNECT", 0.2)
    profile, emulator = board("gen3-highspeed-mc-m2020", 1.0)
    port, started, show = emulator.start().port, time.monotonic(), LiveView.show

    def unplugged(self, *arguments, **options):
        if self.shown > 20 or time.monotonic() - started > DEADLINE:
            emulator.stop()
        return show(self, *arguments, **options)

    monkeypatch.setattr(LiveView, "show", unplugged)
    assert main(["live", port, "--profile", profile.name, "--save", "view.rrd"]) == 2
    said = capsys.readouterr()
    assert "wrote view.rrd" in said.out
    assert port in said.err.strip().splitlines()[-1]
    assert len(read_rrd("view.rrd")[f"/force/{profile.slots[0].name}/measured", "scalar"][0]) > 10


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is sent as a signal")
def test_ctrl_c_ends_an_endless_source_cleanly_with_a_whole_file(folder):
    with subprocess.Popen(
        [sys.executable, "-m", "paxisim.cli", "live", "scene.xml", "--save", "view.rrd"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # tests that run in the background ignore Ctrl-C, and their child processes inherit that
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        try:
            deadline = time.monotonic() + DEADLINE
            sizes = set()  # the file grows in pieces; the first few hold the window's layout
            while len(sizes) < 10:
                sizes.update(path.stat().st_size for path in folder.glob(".view.rrd.*"))
                assert process.poll() is None, process.communicate()
                assert time.monotonic() < deadline, f"sizes of the file so far: {sorted(sizes)}"
                time.sleep(0.02)
            assert not Path("view.rrd").exists()  # only exists once it is complete
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=DEADLINE)
        finally:
            process.kill()
    assert (process.returncode, err) == (0, "")
    drawn = int(re.search(r"wrote view.rrd, (\d+) of", out).group(1))
    assert len(read_rrd("view.rrd")["/force/palm_pad/simulated", "scalar"][0]) == drawn > 0
    assert not list(folder.glob(".view*"))


def test_without_rerun_or_a_display_it_says_what_to_do(folder, monkeypatch, capsys):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    if sys.platform.startswith("linux"):  # other systems always have a display
        assert main(["live", "scene.xml"]) == 2
        assert "--save FILE.rrd" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["live", "scene.xml", "--save", "view.rrd"]) == 2
    assert "pip install 'paxisim[live]'" in capsys.readouterr().err
