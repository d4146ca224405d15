"""``paxisim scene make``, ``scene init`` and ``replay``: from a recording to paired measured and simulated data."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.recording import Recording
from paxisim.scene.resume import simulate_resumable

GAIN = 0.8


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with an indenter scene and a recording of three presses by a sensor that reads too low."""
    folder = tmp_path_factory.mktemp("press")
    scene = folder / "press.toml"
    words = ["scene", "make", "indenter", "--rows", "4", "--cols", "4", "--pitch-mm", "4", "-o", str(scene)]
    assert main(words) == 0
    time = np.arange(150) / 50
    phase = time % 1
    covariates = {
        "x": np.repeat([0.0, 1e-3, -1e-3], 50),
        "y": np.zeros(150),
        "depth": -5e-4 + 2e-3 * np.clip(np.sin(np.pi * phase), 0, None),
    }
    blank = Recording(
        time, np.zeros((150, 1, 3, 4, 4), np.float32), covariates=covariates, episode=np.repeat([0, 1, 2], 50),
        layout=paxisim.TaxelLayout(4, 4, (4e-3, 4e-3)),
    )  # fmt: skip
    exact = paxisim.Scene.load(scene).simulate(blank)
    assert exact.simulated[:, :, 2].sum(axis=(1, 2, 3)).max() > 1
    replace(exact, measured=GAIN * exact.simulated, simulated=None, metadata={}).save(folder / "press.mcap")
    return folder, exact


def replayed(folder, *words):
    name = "paired.npz"
    command = ["replay", "press.mcap", "--scene", "press.toml", "-o", name, "--force", *words]
    assert main([str(folder / word) if word in ("press.mcap", "press.toml", name) else word for word in command]) == 0
    return Recording.load(folder / name)


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_recording_is_replayed_and_compared(made, capsys, jobs):
    folder, exact = made
    paired = replayed(folder, "--jobs", jobs)
    peak = float(exact.simulated.max())
    assert np.abs(paired.simulated - exact.simulated).max() < 0.01 * peak
    np.testing.assert_allclose(paired.measured, GAIN * exact.simulated, atol=1e-4)
    out = capsys.readouterr().out
    assert "mode kinematic" in out
    assert "peak 1.25" in out
    assert not list(folder.glob(".paired*")), "no temporary file should remain beside the output"
    again = paxisim.Scene.from_recording(paired)
    assert [drive.stream for drive in again.drives] == ["x", "y", "depth"]


def test_a_fitted_closing_says_what_it_hides(made, capsys):
    folder, _ = made
    paired = replayed(folder, "--mode", "fitted")
    assert "makes unobservable: axis_gain" in capsys.readouterr().out
    total = [tensor[:, :, 2].sum() for tensor in (paired.measured, paired.simulated)]
    assert total[1] == pytest.approx(total[0], rel=0.01)
    assert "axis_gain" in paired.metadata["replay"]["not_testable"]


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
    other = replace(recording, covariates={**recording.covariates, "x": recording.covariates["x"] + 1e-3})
    simulate_resumable(scene, other, tmp_path / "kept", progress=lambda *one: said.append(one))
    assert said[-4] == (0, 3, 0), "episodes of another motion should not be reused"


def test_a_contact_that_the_scene_misses_is_said_with_its_distance(made, tmp_path, capsys):
    folder, _ = made
    recording = Recording.load(folder / "press.mcap")
    away = {**recording.covariates, "depth": recording.covariates["depth"] - 4e-3}
    replace(recording, covariates=away).save(tmp_path / "away.mcap")
    words = [str(tmp_path / "away.mcap"), "--scene", str(folder / "press.toml"), "-o", str(tmp_path / "out.npz")]
    assert main(["replay", *words]) == 0
    out, err = capsys.readouterr()
    assert "mm from the nearest object: check the object's start pose" in err
    assert "Replay is in doubt in 3 of 3 cases" in out


def test_a_scene_is_begun_from_names(made, tmp_path, capsys):
    folder, _ = made
    path = tmp_path / "begun.toml"
    assert (
        main(["scene", "init", str(folder / "press.xml"), "--recording", str(folder / "press.mcap"), "-o", str(path)])
        == 0
    )
    assert "stream 'depth' moves joint 'depth': their names agree" in capsys.readouterr().out
    scene = paxisim.Scene.load(path)
    assert [(drive.stream, drive.joint, drive.unit) for drive in scene.drives] == [
        (name, name, "m") for name in ("x", "y", "depth")
    ]
    assert Path(scene.mjcf).resolve() == (folder / "press.xml").resolve()


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (lambda r: replace(r, covariates={}), "unknown stream 'x'; there is none"),
        (lambda r: replace(r, covariates={**r.covariates, "depth": 1e3 * r.covariates["depth"]}), "mm"),
        (lambda r: r.select(covariates=["x", "y"]), "depth"),
    ],
    ids=["no streams", "mm", "a stream lacks"],
)
def test_what_cannot_be_followed_is_one_line(made, tmp_path, capsys, change, wanted):
    folder, _ = made
    change(Recording.load(folder / "press.mcap")).save(tmp_path / "bad.mcap")
    line = [
        "replay",
        str(tmp_path / "bad.mcap"),
        "--scene",
        str(folder / "press.toml"),
        "-o",
        str(tmp_path / "out.npz"),
    ]
    capsys.readouterr()
    assert main(line) == 2
    said = [text for text in capsys.readouterr().err.splitlines() if not text.startswith("reading")]
    assert len([text for text in said if text.startswith("paxisim")]) == 1
    assert wanted in " ".join(said)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.mcap"]


@pytest.fixture
def protocol(tmp_path, capsys):
    """A protocol file reduced to the taps of one episode."""
    path = tmp_path / "taps.json"
    assert main(["protocol", "press", "-o", str(path)]) == 0
    out = capsys.readouterr().out
    assert "stop at a normal force of 20 N" in out
    assert "latency" in out
    assert max(map(len, out.replace(str(path), "").splitlines())) <= 100
    whole = paxisim.Protocol.load(path)
    taps = tuple(one for one in whole.segments if one.episode == 1 and one.name in ("approach", "taps"))
    replace(whole, segments=taps).save(path)
    return path


@pytest.mark.parametrize("name", ["paxini-gen1-l4629", "paxini-gen3-dp-s2015"])
def test_a_protocol_presses_on_the_pad(name, tmp_path):
    path = tmp_path / "press.json"
    assert main(["protocol", "press", "-o", str(path), "--sensor", name]) == 0
    made, (height, width) = paxisim.Protocol.load(path), paxisim.sensor(name).layout.size
    places = np.abs(made.waypoints[:, 1:3]).max(axis=0)
    assert made.streams[:2] == ("x", "y")
    assert np.all(places > 0.2 * np.array([width, height]))
    assert np.all(places < 0.55 * np.array([width, height]))


def test_a_protocol_is_rehearsed_in_a_ready_made_scene(made, protocol, capsys):
    folder, _ = made
    out = protocol.with_suffix(".npz")
    assert main(["replay", str(protocol), "--scene", str(folder / "press.toml"), "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert "the protocol stops at 20 N" in said.out
    assert "would be stopped" not in said.err
    rehearsed = Recording.load(out)
    assert rehearsed.measured is None
    assert rehearsed.simulated[:, :, 2].sum(axis=(1, 2, 3)).max() > 0.3
    assert set(rehearsed.covariates) == {"x", "y", "depth"}


def test_a_rehearsal_that_would_be_stopped_says_so(made, protocol, capsys):
    folder, _ = made
    replace(paxisim.Protocol.load(protocol), stop_force=0.1).save(protocol)
    words = ["--scene", str(folder / "press.toml"), "-o", str(protocol.with_suffix(".npz"))]
    assert main(["replay", str(protocol), *words]) == 0
    assert "pad_pad would be stopped: write the protocol with less --depth-mm" in capsys.readouterr().err


def test_the_page_s_lines_about_protocols_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[2] / "docs" / "guides" / "replay.md").read_text(encoding="utf-8")
    section = page.split("## A motion to record")[1]
    write, make, rehearse = section.split("```bash\n")[1].split("```")[0].splitlines()
    for line in (write, make):
        assert main(line.split()[1:]) == 0
    whole = paxisim.Protocol.load("press.json")
    replace(whole, segments=whole.segments[2:3]).save("press.json")  # only the taps, of 11 minutes in total
    assert main(rehearse.split()[1:]) == 0
    assert Recording.load("rehearsed.npz").simulated.max() > 0
    exec(compile(section.split("```python\n")[1].split("```")[0], "replay.md", "exec"), {})


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["open-close", "-o", "a.json", "--depth-mm", "1"], "open-close touches nothing: it takes no --depth-mm"),
        (["regrasp", "-o", "a.json", "--sensor", "paxini-gen1-l4629"], "regrasp is the same for every pad"),
        (["press", "-o", "a.toml"], "the output must end in .json, got a.toml"),
        (["press", "-o", "a.json", "--stop-n", "-3"], "stop_force must be above 0 N, got -3"),
        (["pres", "-o", "a.json"], "Expected one of"),
    ],
)
def test_a_protocol_that_cannot_be_made_is_one_line(words, wanted, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["protocol", *words]) == 2
    error = capsys.readouterr().err
    assert wanted in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())
