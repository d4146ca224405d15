"""``paxisim scene make``, ``scene init``, ``protocol`` and ``replay``: from a recording to paired data."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.recording import Recording
from paxisim.scene.resume import simulate_resumable

GAIN = 0.8
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with an indenter scene and a recording of three presses by a sensor that reads too low."""
    folder = tmp_path_factory.mktemp("press")
    scene = folder / "press.toml"
    words = ["scene", "make", "indenter", "--rows", "4", "--cols", "4", "--pitch-mm", "4", "-o", str(scene)]
    assert main(words) == 0
    time = np.arange(150) / 50
    covariates = {
        "x": np.repeat([0.0, 1e-3, -1e-3], 50),
        "y": np.zeros(150),
        "depth": -5e-4 + 2e-3 * np.clip(np.sin(np.pi * (time % 1)), 0, None),
    }
    blank = Recording(
        time, np.zeros((150, 1, 3, 4, 4), np.float32), covariates=covariates, episode=np.repeat([0, 1, 2], 50),
        layout=paxisim.TaxelLayout(4, 4, (4e-3, 4e-3)),
    )  # fmt: skip
    exact = paxisim.Scene.load(scene).simulate(blank)
    assert exact.simulated[:, :, 2].sum(axis=(1, 2, 3)).max() > 1
    replace(exact, measured=GAIN * exact.simulated, simulated=None, metadata={}).save(folder / "press.mcap")
    return folder, exact


@pytest.fixture(autouse=True)
def work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def replayed(made, *words, recording="press.mcap"):
    """Replay a recording in the indenter scene to paired.npz; return the status."""
    folder, _ = made
    path = recording if Path(recording).exists() else str(folder / recording)
    return main(["replay", path, "--scene", str(folder / "press.toml"), "-o", "paired.npz", *words])


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_recording_is_replayed_and_compared(made, capsys, jobs):
    assert replayed(made, "--jobs", jobs) == 0
    paired, exact = Recording.load("paired.npz"), made[1]
    assert np.abs(paired.simulated - exact.simulated).max() < 0.01 * float(exact.simulated.max())
    np.testing.assert_allclose(paired.measured, GAIN * exact.simulated, atol=1e-4)
    out = capsys.readouterr().out
    assert "mode kinematic" in out
    assert "peak 1.25" in out
    assert [path.name for path in Path().iterdir()] == ["paired.npz"], "no temporary file remains beside the output"
    again = paxisim.Scene.from_recording(paired)
    assert [drive.stream for drive in again.drives] == ["x", "y", "depth"]


def test_a_fitted_closing_says_what_it_hides(made, capsys):
    assert replayed(made, "--mode", "fitted") == 0
    assert "makes unobservable: axis_gain" in capsys.readouterr().out


def test_a_second_call_goes_on_where_the_first_was_stopped(made, tmp_path):
    folder, exact = made
    scene, recording = paxisim.Scene.load(folder / "press.toml"), Recording.load(folder / "press.mcap")
    said = []

    def stop(done, count, before):
        said.append((done, count, before))
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_resumable(scene, recording, tmp_path / "kept", progress=stop)
    paired = simulate_resumable(scene, recording, tmp_path / "kept", progress=lambda *one: said.append(one))
    assert said == [(0, 3, 0), (1, 3, 0), (2, 3, 0), (2, 3, 2), (3, 3, 2)]
    assert np.abs(paired.simulated - exact.simulated).max() < 0.01 * float(exact.simulated.max())
    other = recording.with_covariate("x", recording.covariates["x"] + 1e-3)
    simulate_resumable(scene, other, tmp_path / "kept", progress=lambda *one: said.append(one))
    assert said[-4] == (0, 3, 0), "episodes of another motion should not be reused"


def test_a_contact_that_the_scene_misses_is_said_with_its_distance(made, capsys):
    recording = Recording.load(made[0] / "press.mcap")
    recording.with_covariate("depth", recording.covariates["depth"] - 4e-3).save("away.mcap")
    assert replayed(made, recording="away.mcap") == 0
    out, err = capsys.readouterr()
    assert "mm from the nearest object: check the object's start pose" in err
    assert "Replay is in doubt in 3 of 3 cases" in out


def test_what_cannot_be_followed_is_one_line(made, capsys):
    replace(Recording.load(made[0] / "press.mcap"), covariates={}).save("bad.mcap")
    capsys.readouterr()
    assert replayed(made, recording="bad.mcap") == 2
    (said,) = [text for text in capsys.readouterr().err.splitlines() if text.startswith("paxisim")]
    assert "unknown stream 'x'; there is none" in said
    assert [path.name for path in Path().iterdir()] == ["bad.mcap"]


def test_a_scene_is_begun_from_names(made, capsys):
    folder, _ = made
    words = [str(folder / "press.xml"), str(folder / "press.mcap"), "-o", "begun.toml"]
    assert main(["scene", "init", *words]) == 0
    assert "stream 'depth' moves joint 'depth': their names agree" in capsys.readouterr().out
    scene = paxisim.Scene.load("begun.toml")
    drives = [(drive.stream, drive.joint, drive.unit) for drive in scene.drives]
    assert drives == [(name, name, "m") for name in ("x", "y", "depth")]
    assert Path(scene.mjcf).resolve() == (folder / "press.xml").resolve()


# protocols


@pytest.mark.parametrize("name", ["paxini-gen1-l4629", "paxini-gen3-dp-s2015"])
def test_a_protocol_presses_on_the_pad(name):
    assert main(["protocol", "press", "-o", "press.json", "--sensor", name]) == 0
    protocol, (height, width) = paxisim.Protocol.load("press.json"), paxisim.sensor(name).layout.size
    places = np.abs(protocol.waypoints[:, 1:3]).max(axis=0)
    assert protocol.streams[:2] == ("x", "y")
    assert np.all(places > 0.2 * np.array([width, height]))
    assert np.all(places < 0.55 * np.array([width, height]))


@pytest.mark.parametrize("stopped", [False, True])
def test_a_protocol_is_rehearsed_and_says_whether_it_would_be_stopped(made, capsys, stopped):
    assert main(["protocol", "press", "-o", "taps.json"]) == 0
    out = capsys.readouterr().out
    assert "stop at a normal force of 20 N" in out
    assert "latency" in out
    assert max(map(len, out.replace("taps.json", "").splitlines())) <= 100
    whole = paxisim.Protocol.load("taps.json")
    taps = tuple(one for one in whole.segments if one.episode == 1 and one.name in ("approach", "taps"))
    replace(whole, segments=taps, stop_force=0.1 if stopped else whole.stop_force).save("taps.json")
    assert replayed(made, recording="taps.json") == 0
    said = capsys.readouterr()
    assert f"the protocol stops at {0.1 if stopped else 20} N" in said.out
    assert ("pad_pad would be stopped: write the protocol with less --depth-mm" in said.err) is stopped
    rehearsed = Recording.load("paired.npz")
    assert rehearsed.measured is None
    assert rehearsed.simulated[:, :, 2].sum(axis=(1, 2, 3)).max() > 0.3
    assert set(rehearsed.covariates) == {"x", "y", "depth"}


def test_a_protocol_takes_no_streams(made, capsys):
    assert main(["protocol", "press", "-o", "press.json"]) == 0
    assert replayed(made, "--streams", "robot.csv", recording="press.json") == 2
    assert "the motion of a protocol is complete: leave it out" in capsys.readouterr().err


def test_the_page_s_lines_about_protocols_run():
    page = (ROOT / "docs" / "guides" / "replay.md").read_text(encoding="utf-8")
    section = page.split("## A motion to record")[1]
    write, make, rehearse = section.split("```bash\n")[1].split("```")[0].replace("\\\n", " ").splitlines()
    for line in (write, make):
        assert main(line.split()[1:]) == 0
    whole = paxisim.Protocol.load("press.json")
    replace(whole, segments=whole.segments[2:3]).save("press.json")  # only the taps, of 11 minutes in total
    assert main(rehearse.split()[1:]) == 0
    assert Recording.load("rehearsed.npz").simulated.max() > 0
    exec(compile(section.split("```python\n")[1].split("```")[0], "replay.md", "exec"), {})
