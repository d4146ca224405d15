"""LeRobotDatasets written by paxisim: the layout of format v3.0, and round trips of the recording."""

import dataclasses
import json
import os

import numpy as np
import pytest
from log_files import LAYOUT, assert_equal, full_disk, recording

from paxisim.cli import main
from paxisim.errors import InvalidValueError, OutputExistsError, PaxisimError
from paxisim.layout import TaxelLayout
from paxisim.logs import lerobot_tables, lerobot_writer
from paxisim.recording import Recording

pytest.importorskip("pyarrow.parquet", exc_type=ImportError)

from pyarrow import parquet


def write(path, original, **options):
    return lerobot_writer.write_lerobot(path, original.to_arrays(), **options)


def press(lengths=(30, 20), rate=50.0, **changes):
    """Return two 6x5 pads, three joints, a gripper's pose and an action, sampled exactly at `rate`."""
    rng = np.random.default_rng(3)
    samples = sum(lengths)
    fields = {
        "time": np.concatenate([10.0 * i + np.arange(n) / rate for i, n in enumerate(lengths)]),
        "measured": rng.normal(size=(samples, 2, 3, 6, 5)).astype(np.float32),
        "covariates": {
            **{name: rng.normal(size=samples) for name in ("shoulder", "elbow", "wrist/roll")},
            "pose": rng.normal(size=(samples, 2)),
            "action": rng.normal(size=(samples, 4)),
            "resultant": rng.normal(size=(samples, 2, 3)),
        },
        "episode": np.repeat(np.arange(len(lengths)), lengths),
        "layout": TaxelLayout(6, 5, (0.0022, 0.0023)),
        "pads": ("left", "right/tip"),
        "metadata": {"profile": "gen2", "start": 1.7e9},
    }
    return Recording(**{**fields, **changes})


def assert_back(found, original, atol=1e-6):
    """Assert that two recordings are equal: tensors bit for bit, the rest to float32 precision."""
    single = {name: values.astype(np.float32) for name, values in original.covariates.items()}
    assert_equal(found, dataclasses.replace(original, covariates=single), atol)
    assert found.unit == original.unit


def test_a_recording_comes_back(tmp_path):
    original = press()
    said = write(tmp_path / "set", original, task="press the ball")
    found = Recording.load(tmp_path / "set")
    assert_back(found, original)
    assert found.metadata == {**original.metadata, "task": "press the ball"}
    assert said.startswith("LeRobotDataset v3.0, 2 episodes, 50 frames at 50 Hz, observation.tactile.left ")
    write(tmp_path / "again", found)
    assert_back(Recording.load(tmp_path / "again"), found)
    assert Recording.load(tmp_path / "again").metadata == found.metadata
    assert_back(Recording.load(tmp_path / "set", pads=("right/tip",)), original.select(pads="right/tip"))


def test_what_is_simulated_a_unit_and_curved_taxels_come_back(tmp_path):
    points = np.random.default_rng(0).normal(size=(12, 3))
    curved = TaxelLayout(4, 3, (0.002, 0.003), positions=points, normals=points, vendor_order=LAYOUT.vendor_order)
    original = recording(layout=curved, metadata={"unit": "uT"})
    write(tmp_path / "set", original)
    found = Recording.load(tmp_path / "set")
    assert_back(found, original, atol=1.1e-3)  # samples are up to 1 ms off a 100 Hz clock
    assert found.episode[0] == 4
    assert found.unit == "uT"
    np.testing.assert_allclose(found.time[:25] - found.time[0], np.arange(25) / 100, atol=1e-7)


def test_the_files_are_those_of_format_3(tmp_path):
    original = press()
    write(tmp_path / "set", original, task="press")
    files = sorted(str(file.relative_to(tmp_path / "set")) for file in (tmp_path / "set").rglob("*") if file.is_file())
    assert files == [
        "data/chunk-000/file-000.parquet",
        "meta/episodes/chunk-000/file-000.parquet",
        "meta/info.json",
        "meta/paxisim.json",
        "meta/stats.json",
        "meta/tasks.parquet",
    ]
    info = json.loads((tmp_path / "set/meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["splits"]) == ("v3.0", 50, {"train": "0:2"})
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, 50, 1)
    shapes = {name: feature["shape"] for name, feature in info["features"].items()}
    assert shapes == {
        **{"observation.tactile.left": [3, 6, 5], "observation.tactile.right.tip": [3, 6, 5]},
        **{"observation.state": [5], "action": [4], "observation.resultant": [2, 3]},
        **{name: [1] for name in ("timestamp", "frame_index", "episode_index", "index", "task_index")},
    }
    assert info["features"]["observation.state"]["names"] == ["shoulder", "elbow", "wrist/roll", "pose.0", "pose.1"]
    assert info["features"]["observation.tactile.left"]["info"]["unit"] == "N"
    data = parquet.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    assert data.column_names == list(shapes)
    np.testing.assert_array_equal(data["observation.tactile.left"].to_pylist(), original.measured[:, 0])
    np.testing.assert_allclose(data["timestamp"].to_pylist(), [*np.arange(30) / 50, *np.arange(20) / 50], atol=1e-7)
    assert data["index"].to_pylist() == list(range(50))
    episodes = parquet.read_table(tmp_path / "set/meta/episodes/chunk-000/file-000.parquet").to_pydict()
    assert episodes["dataset_from_index"] == [0, 30]
    assert episodes["dataset_to_index"] == [30, 50]
    assert episodes["tasks"] == [["press"], ["press"]]
    assert (tmp_path / "set").stat().st_mode == (tmp_path / "set/meta").stat().st_mode


def test_the_statistics_are_those_of_the_last_axis(tmp_path):
    original = press()
    write(tmp_path / "set", original)
    stats = json.loads((tmp_path / "set/meta/stats.json").read_text())
    episodes = parquet.read_table(tmp_path / "set/meta/episodes/chunk-000/file-000.parquet").to_pydict()
    values = original.measured[:, 0].astype(np.float64)
    prefix = "stats/observation.tactile.left/"
    second = {name.removeprefix(prefix): found[1] for name, found in episodes.items() if name.startswith(prefix)}
    for found, part in ((stats["observation.tactile.left"], values), (second, values[30:])):
        assert found["count"] == [len(part)]
        columns = part.reshape(-1, 5)
        for name in ("min", "max", "mean", "std"):
            np.testing.assert_allclose(found[name], getattr(columns, name)(axis=0), rtol=1e-6)
        for percent in (1, 10, 50, 90, 99):
            np.testing.assert_allclose(found[f"q{percent:02d}"], np.percentile(columns, percent, axis=0), rtol=1e-6)
    np.testing.assert_allclose(stats["action"]["mean"], original.covariates["action"].mean(axis=0), rtol=1e-5)
    assert stats["frame_index"]["max"] == [29]


def test_which_covariates_are_the_state_and_the_action(tmp_path):
    original = press()

    def features(name, **options):
        write(tmp_path / name, options.pop("of", original), **options)
        return json.loads((tmp_path / name / "meta/info.json").read_text())["features"]

    chosen = features("a", state=("elbow", "shoulder"), action=("pose", "wrist/roll"))
    assert chosen["observation.state"]["names"] == ["elbow", "shoulder"]
    assert chosen["action"]["names"] == ["pose.0", "pose.1", "wrist/roll"]
    assert chosen["observation.action"]["shape"] == [4]
    assert_back(Recording.load(tmp_path / "a"), original)
    named = {"action.x": np.ones(50), "action.y": np.ones(50), "observation.state.a": np.ones(50), "other": np.ones(50)}
    found = features("b", of=press(covariates=named))
    assert found["action"]["names"] == ["x", "y"]
    assert found["observation.state"]["names"] == ["a"]
    assert found["observation.other"]["shape"] == [1]
    assert not {"action", "observation.state"} & features("c", of=press(covariates={})).keys()
    for recorded, options, word in (
        (original, {"state": ("elbo",)}, "unknown covariate 'elbo'; did you mean 'elbow'"),
        (original, {"state": ("pose",), "action": ("pose",)}, "'pose' is named twice; name it only once"),
        (press(pads=("a/b", "a.b")), {}, "two streams map to the feature 'observation.tactile.a.b'"),
        (press(covariates={"deep": np.ones((50,) + (1,) * 6)}), {}, "'deep' has samples of 6 axes, LeRobot allows"),
        (original, {"task": "\ud800"}, "cannot be encoded as UTF-8"),
    ):
        with pytest.raises(PaxisimError, match=word):
            write(tmp_path / "d", recorded, **options)
    assert not (tmp_path / "d").exists()


def test_a_recording_that_does_not_fit_the_frames_is_resampled(tmp_path):
    late = press(rate=10.4)  # 3 s long; at 10 Hz its last sample would be one frame too late
    whole = "because LeRobot needs a whole number of frames per second,"
    said = write(tmp_path / "a", late)
    assert f"at 10 Hz, resampled from 10.4 Hz {whole}" in said
    assert f"at 62 Hz, resampled from 62.5 Hz {whole}" in write(tmp_path / "sixty", press((70, 20), rate=62.5))
    for rate in (50, 62.5):
        gap = press(rate=rate)
        gap = dataclasses.replace(gap, time=gap.time + 0.03 * (np.arange(50) == 29))
        said = write(tmp_path / f"gap at {rate}", gap)
        assert f"at {rate:.0f} Hz, resampled because its samples are irregular," in said
    slower = press(time=np.cumsum(np.where(np.arange(50) % 4, 0.02, 0.025)), episode=None)
    assert "at 50 Hz, resampled because its samples are irregular," in write(tmp_path / "slower", slower)
    doubled = press((2,), time=[0.0, 0.0])
    assert "1 frames at 30 Hz, resampled because" in write(tmp_path / "doubled", doubled, fps=30)
    expected = late.resample(10)
    np.testing.assert_array_equal(Recording.load(tmp_path / "a").measured, expected.measured)
    assert "at 4 Hz, resampled from 10.4 Hz" in write(tmp_path / "b", late, fps=4, align="nearest")
    np.testing.assert_array_equal(Recording.load(tmp_path / "b").measured, late.resample(4, align="nearest").measured)
    shaken = press(time=press().time + np.random.default_rng(0).uniform(-0.004, 0.004, 50))
    write(tmp_path / "c", shaken, fps=50)
    found = Recording.load(tmp_path / "c")
    np.testing.assert_array_equal(found.measured, shaken.measured)
    assert np.abs(found.time - shaken.time).max() < 0.01
    np.testing.assert_allclose(np.diff(found.time)[:29], 0.02, atol=1e-6)


def test_what_is_not_known(tmp_path):
    measured = press().measured.copy()
    measured[10:13, 1] = np.nan
    original = press(measured=measured, metadata={"tasks": {"0": "press", "1": "pull"}})
    with pytest.warns(UserWarning, match=r"3 of 50 frames hold NaN.*tactile.right.tip; .*--missing drop"):
        write(tmp_path / "a", original)
    assert_back(Recording.load(tmp_path / "a"), original)
    assert json.loads((tmp_path / "a/meta/stats.json").read_text(), parse_constant=pytest.fail)
    write(tmp_path / "b", original, drop=True)
    found = Recording.load(tmp_path / "b")
    assert [len(part) for part in found.episodes()] == [10, 17, 20]
    assert found.metadata["tasks"] == {"0": "press", "1": "press", "2": "pull"}
    np.testing.assert_array_equal(found.measured, np.delete(measured, slice(10, 13), axis=0))
    np.testing.assert_allclose(found.time, np.delete(original.time, slice(10, 13)), atol=1e-6)
    dead = measured.copy()
    dead[:, 1] = np.nan
    with (
        pytest.warns(UserWarning, match="50 of 50 frames"),
        pytest.raises(InvalidValueError, match=r"right.tip holds values that are not known at any frame.*--pads"),
    ):
        write(tmp_path / "c", press(measured=dead))
    with pytest.raises(InvalidValueError, match="no frame is left"):
        write(tmp_path / "c", press(measured=dead), drop=True)
    with pytest.raises(InvalidValueError, match="'action' holds a value that is infinite or too large for float32"):
        write(tmp_path / "c", press(covariates={"action": np.full(50, 1e300)}))
    assert sorted(os.listdir(tmp_path)) == ["a", "b"]


def test_episodes_of_one_frame_and_any_rate(tmp_path):
    for rate in (1, 7, 30, 997):
        write(tmp_path / f"{rate}", press((4, 3), rate=rate), fps=rate)
        assert_back(Recording.load(tmp_path / f"{rate}"), press((4, 3), rate=rate))
    write(tmp_path / "a", press((1, 5, 1)))
    assert_back(Recording.load(tmp_path / "a"), press((1, 5, 1)))
    with pytest.raises(InvalidValueError, match=r"no rate, because no episode has two samples.*; give fps"):
        write(tmp_path / "b", press((1, 1)))
    write(tmp_path / "b", press((1, 1)), fps=30)
    assert_back(Recording.load(tmp_path / "b"), press((1, 1)))
    for fps in (0, 2.5, float("nan"), 10**7):
        with pytest.raises(InvalidValueError, match="fps must be a whole number"):
            write(tmp_path / "c", press(), fps=fps)
    with pytest.raises(InvalidValueError, match=r"rate must be at least 1 Hz, got 0.1 Hz; give fps"):
        write(tmp_path / "c", press(rate=0.1))


def test_a_large_recording_has_several_files(tmp_path, monkeypatch):
    """Each episode is in a single file, and a file ends before it would exceed 100 MB."""
    monkeypatch.setattr(lerobot_tables, "FILE_MEGABYTES", 0.05)
    original = press((40, 20, 5, 50, 60))  # about 0.8 kB per frame
    write(tmp_path / "set", original)
    files = sorted((tmp_path / "set/data").rglob("*.parquet"))
    assert [parquet.read_metadata(file).num_rows for file in files] == [60, 55, 60]
    episodes = parquet.read_table(tmp_path / "set/meta/episodes/chunk-000/file-000.parquet").to_pydict()
    assert episodes["data/file_index"] == [0, 0, 1, 1, 2]
    assert_back(Recording.load(tmp_path / "set"), original)


def test_convert_in_the_shell(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    press().save("press.npz")
    assert main(["convert", "press.npz", "--lerobot", "set", "--task", "press the ball", "--fps", "50"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("set: LeRobotDataset v3.0, 2 episodes, 50 frames at 50 Hz,\n  observation.tactile.left")
    assert max(map(len, out.splitlines())) <= 80
    assert main(["info", "set"]) == 0
    assert "task: press the ball" in capsys.readouterr().out
    assert main(["convert", "set", "back.mcap"]) == 0
    assert_back(Recording.load("back.mcap"), press())
    capsys.readouterr()
    for words, says in (
        (["--lerobot", "set"], "set exists; folders are never overwritten, choose a new name"),
        (["--lerobot", "set", "--force"], "set exists"),
        (["--lerobot", "no/set"], "the output's folder does not exist"),
        ([], "expected one of the two, got neither"),
        (["a.npz", "--lerobot", "other"], "expected one of the two, got a.npz and other"),
        (["a.npz", "--task", "press"], "--task is for a LeRobotDataset, give --lerobot DIR; a.npz is a file"),
        (["--lerobot", "other", "--state", "elbo"], "did you mean 'elbow'"),
    ):
        assert main(["convert", "press.npz", *words]) == 2
        said = capsys.readouterr().err
        assert says in said
        assert said.count("\n") == 1
    assert sorted(os.listdir()) == ["back.mcap", "press.npz", "set"]


def test_nothing_is_left_of_a_dataset_that_could_not_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "link").symlink_to("nowhere")
    for name in ("file", "link"):
        with pytest.raises(OutputExistsError, match=f"{name} exists"):
            write(tmp_path / name, press())
    with full_disk(20_000), pytest.raises(OSError, match=r"File too large|errno: 27"):
        write(tmp_path / "set", press())
    assert sorted(os.listdir(tmp_path)) == ["file", "link"]
