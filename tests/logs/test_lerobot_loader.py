"""LeRobotDatasets with lerobot itself, which needs its own environment because it requires numpy 2.

`PAXISIM_LEROBOT_PYTHON` names the interpreter of that environment; ``.ci/full`` shows how to create it.
"""

import json
import os
import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest

from paxisim.cli import main
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

PYTHON = os.environ.get("PAXISIM_LEROBOT_PYTHON")
PROGRAM = Path(__file__).with_name("lerobot_loader.py")
PAGE = Path(__file__).parents[2] / "docs/guides/lerobot.md"

pytestmark = [
    pytest.mark.skipif(not PYTHON, reason="PAXISIM_LEROBOT_PYTHON does not name an interpreter with lerobot"),
    pytest.mark.timeout(300),
]
pytest.importorskip("pyarrow")


@pytest.fixture
def python(tmp_path):
    """Run that interpreter, with lerobot kept offline."""

    def run(*words):
        environment = {**os.environ, "HF_HUB_OFFLINE": "1", "HF_HOME": str(tmp_path / "cache"), "PYTHONPATH": ""}
        assert PYTHON is not None
        words = [PYTHON, *map(str, words)]
        done = subprocess.run(words, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-3000:]
        return done.stdout

    return run


@pytest.fixture
def lerobot(python):
    return lambda *words: python(PROGRAM, *words)


@pytest.fixture
def looked(tmp_path, lerobot):
    """Load a dataset with lerobot's loader and return its description and its arrays by name."""

    def look(folder):
        lerobot("look", folder, tmp_path / "looked.npz")
        with np.load(tmp_path / "looked.npz") as archive:
            found = {name: archive[name] for name in archive.files}
        return json.loads(str(found.pop("said"))), found

    return look


def press():
    """Return two 6x5 pads, three joints and an action in three episodes of 30, 1 and 20 samples at 50 Hz."""
    rng = np.random.default_rng(0)
    lengths = (30, 1, 20)
    samples = sum(lengths)
    joints = {name: rng.normal(size=samples) for name in ("shoulder", "elbow", "wrist")}
    return Recording(
        np.concatenate([np.arange(n) / 50 for n in lengths]),
        rng.normal(size=(samples, 2, 3, 6, 5)),
        covariates={**joints, "action": rng.normal(size=(samples, 3)), "resultant": rng.normal(size=(samples, 2, 3))},
        episode=np.repeat(range(3), lengths),
        layout=TaxelLayout(6, 5, 0.002),
        pads=("left", "right"),
        metadata={"profile": "gen2", "tasks": {"0": "press", "1": "pull", "2": "press"}},
    )


def written(folder, recording, *words):
    recording.save(folder / "press.mcap")
    assert main(["convert", str(folder / "press.mcap"), "--lerobot", str(folder / "set"), *words]) == 0
    return folder / "set"


def test_its_loader_opens_what_paxisim_writes_and_its_windows_stay_within_the_episodes(tmp_path, looked):
    recording = press()
    said, found = looked(written(tmp_path, recording))
    assert said["fps"] == 50
    assert said["bounds"] == [[0, 30], [30, 31], [31, 51]]
    assert said["tasks"] == ["press"] * 30 + ["pull"] + ["press"] * 20
    assert said["shapes"]["observation.tactile.left"] == [3, 6, 5]
    assert set(said["stats"]["action"]) == {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}
    for i, pad in enumerate(("left", "right")):
        np.testing.assert_array_equal(found[f"observation.tactile.{pad}"], recording.measured[:, i])
    state = np.stack([recording.covariates[name] for name in ("shoulder", "elbow", "wrist")], axis=1)
    np.testing.assert_array_equal(found["observation.state"], state.astype(np.float32))
    np.testing.assert_array_equal(found["action"], recording.covariates["action"].astype(np.float32))
    np.testing.assert_array_equal(found["observation.resultant"], recording.covariates["resultant"].astype(np.float32))
    np.testing.assert_allclose(found["timestamp"], recording.time, atol=1e-6)
    np.testing.assert_array_equal(found["episode_index"], recording.episode)
    np.testing.assert_array_equal(found["last"], np.arange(31, 51))
    np.testing.assert_allclose(found["stats/action"], recording.covariates["action"].mean(axis=0), rtol=1e-5)
    begins, ends = np.array([0, 30, 31]), np.array([29, 30, 50])
    for key, values, steps in (
        ("observation.tactile.left", recording.measured[:, 0], (-2, -1, 0)),
        ("action", recording.covariates["action"].astype(np.float32), (0, 1)),
    ):
        at = np.arange(51)[:, None] + np.array(steps)
        episode = recording.episode[:, None]
        inside = np.clip(at, begins[episode], ends[episode])
        np.testing.assert_array_equal(found[f"window/{key}"], values[inside])
        np.testing.assert_array_equal(found[f"is_pad/{key}"], at != inside)


def test_the_page_runs_as_printed(tmp_path, python, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text, _, _ = PAGE.read_text(encoding="utf-8").partition("## Features")
    press().select(pads="left").save("press.npz")
    one = Recording.load("press.npz")
    Recording(**{**vars(one), "pads": ("pad",)}).save("press.mcap")
    for line in re.findall(r"^paxisim (.*)$", text, re.MULTILINE):
        assert main(shlex.split(line)) == 0
    (block,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    shapes = "print(*(found[0]['observation.tactile.pad'].shape for found in (dataset, windows)))"
    assert python("-c", block + shapes).splitlines()[-1] == "torch.Size([3, 6, 5]) torch.Size([2, 3, 6, 5])"
    assert len(Recording.load("again.mcap")) == 51


def test_it_merges_and_adds_to_what_paxisim_wrote(tmp_path, lerobot):
    recording = press()
    folder = written(tmp_path, recording)
    lerobot("merge", folder, folder, tmp_path / "merged")
    merged = Recording.load(tmp_path / "merged")
    assert (len(merged), merged.episode[-1]) == (102, 5)
    np.testing.assert_array_equal(merged.measured[51:], recording.measured)
    assert (merged.layout, merged.pads) == (recording.layout, recording.pads)
    assert merged.covariates.keys() == recording.covariates.keys()
    lerobot("append", folder)
    found = Recording.load(folder)
    assert len(found) == len(recording) + 4
    np.testing.assert_array_equal(found.measured[:51], recording.measured)
    assert np.all(found.measured[-4:] == np.arange(4).reshape(4, 1, 1, 1, 1))
    assert found.metadata["tasks"] == {"0": "press", "1": "pull", "2": "press", "3": "added"}


def test_paxisim_reads_what_it_recorded(tmp_path, lerobot):
    lerobot("create", tmp_path / "set")
    found = Recording.load(tmp_path / "set")
    assert found.pads == ("pad0", "pad1", "palm")
    at = np.r_[0:7, 10:15]
    grid = np.arange(180).reshape(2, 3, 6, 5)
    np.testing.assert_array_equal(found.measured[:, :2], grid + at.reshape(-1, 1, 1, 1, 1))
    np.testing.assert_array_equal(found.measured[:, 2], grid[0] - at.reshape(-1, 1, 1, 1))
    np.testing.assert_allclose(found.time, np.r_[0:7, 0:5] / 25, atol=1e-6)
    assert found.episode.tolist() == [0] * 7 + [1] * 5
    assert found.metadata["tasks"] == {"0": "press", "1": "pull"}
    assert found.metadata["robot_type"] == "arm"
    np.testing.assert_array_equal(found.covariates["observation.state.elbow"], -at)
    np.testing.assert_array_equal(found.covariates["observation.opening"], at / 2)
    np.testing.assert_array_equal(found.covariates["action"][:, 0], at)
