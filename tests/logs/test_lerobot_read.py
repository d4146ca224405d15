"""Foreign LeRobotDatasets: what paxisim reads and what it refuses."""

import json

import numpy as np
import pytest
from log_files import refused

from paxisim.cli import main
from paxisim.errors import UnknownNameError
from paxisim.logs.limits import VARIABLE
from paxisim.recording import Recording

pytest.importorskip("pyarrow.parquet", exc_type=ImportError)

import pyarrow as pa
from lerobot_files import SAMPLES, dataset, values
from pyarrow import parquet

NAMES = ["pan.pos", "gripper.pos"]


@pytest.mark.parametrize("files", [1, 3])
def test_a_pad_a_feature(tmp_path, files):
    left, right, state = values(3, 6, 5), values(3, 6, 5, seed=1), values(2, seed=2)
    features = {"observation.tactile.left": left, "observation.tactile.right": right}
    features |= {"observation.state": (state, {"names": NAMES}), "action": state * 2, "gripper": state[:, 0]}
    found = Recording.load(dataset(tmp_path / "set", features, files))
    np.testing.assert_array_equal(found.measured, np.stack([left, right], axis=1))
    assert found.pads == ("left", "right")
    assert found.episode.tolist() == [0] * 3 + [1] * 4
    np.testing.assert_allclose(found.time, [0, 0.1, 0.2, 0, 0.1, 0.2, 0.3], atol=1e-7)
    assert set(found.covariates) == {*(f"observation.state.{name}" for name in NAMES), "action", "gripper"}
    np.testing.assert_array_equal(found.covariates["observation.state.gripper.pos"], state[:, 1])
    np.testing.assert_array_equal(found.covariates["action"], state * 2)
    assert found.metadata == {"source": "set", "robot_type": "so101", "tasks": {"0": "press", "1": "pull"}}
    assert found.unit == "N"
    assert Recording.load(tmp_path / "set", pads="right").pads == ("right",)
    with pytest.raises(UnknownNameError, match="unknown pad 'middle'"):
        Recording.load(tmp_path / "set", pads="middle")


def test_the_robot_and_the_tasks_go_with_a_conversion(tmp_path):
    path = dataset(tmp_path / "set", {"observation.tactile.left": values(3, 6, 5), "action": values(2)})
    found = Recording.load(path)
    assert main(["convert", str(path), "--lerobot", str(tmp_path / "again")]) == 0
    again = Recording.load(tmp_path / "again")
    assert again.metadata == found.metadata
    np.testing.assert_array_equal(again.covariates["action"], found.covariates["action"])
    assert json.loads((tmp_path / "again/meta/info.json").read_text())["robot_type"] == "so101"


def test_all_pads_in_one_feature(tmp_path):
    tensor = values(2, 3, 6, 5)
    found = Recording.load(dataset(tmp_path / "set", {"observation.tactile": tensor}, task=("press", "press")))
    np.testing.assert_array_equal(found.measured, tensor)
    assert found.pads == ("pad0", "pad1")
    assert found.metadata["task"] == "press"
    features = {"observation.tactile.thumb": tensor, "observation.left_tactile": values(3, 6, 5)}
    found = Recording.load(dataset(tmp_path / "more", features))
    assert found.pads == ("thumb0", "thumb1", "left_tactile")
    assert found.measured.shape == (SAMPLES, 3, 3, 6, 5)


def test_tensors_as_the_extension_type_that_lerobot_registers(tmp_path):
    """If its library is imported too, Arrow knows a separate type for the tensors."""

    class Array3D(pa.ExtensionType):
        def __init__(self):
            super().__init__(pa.list_(pa.list_(pa.list_(pa.float32()))), "test.Array3D")

        def __arrow_ext_serialize__(self):
            return b""

        @classmethod
        def __arrow_ext_deserialize__(cls, storage_type, serialized):
            return cls()

    tensor = values(3, 2, 1)
    path = dataset(tmp_path / "set", {"observation.tactile.left": tensor}) / "data/chunk-000/file-000.parquet"
    table = parquet.read_table(path)
    extended = pa.ExtensionArray.from_storage(Array3D(), table["observation.tactile.left"].combine_chunks())
    parquet.write_table(table.set_column(0, "observation.tactile.left", extended), path)
    np.testing.assert_array_equal(Recording.load(tmp_path / "set").measured[:, 0], tensor)
    pa.register_extension_type(Array3D())
    try:
        assert isinstance(parquet.read_table(path).schema.field(0).type, Array3D)
        np.testing.assert_array_equal(Recording.load(tmp_path / "set").measured[:, 0], tensor)
    finally:
        pa.unregister_extension_type("test.Array3D")


def test_pads_that_differ(tmp_path):
    grids = {"observation.tactile.left": values(3, 6, 5), "observation.tactile.palm": values(3, 9, 9)}
    path = dataset(tmp_path / "set", grids)
    refused(path, "left and observation.tactile.palm have different grids.*with pads")
    assert Recording.load(path, pads="palm").measured.shape == (SAMPLES, 1, 3, 9, 9)
    units = {**grids, "observation.tactile.palm": (values(3, 6, 5), {"info": {"unit": "uT"}})}
    path = dataset(tmp_path / "units", units)
    refused(path, "have different units")
    assert Recording.load(path, pads="palm").unit == "uT"
    features = {"observation.tactile.left": values(3, 6, 5), "observation.simulated.right": values(3, 6, 5)}
    path = dataset(tmp_path / "streams", {**features, "gripper": values()})
    refused(path, "measured has the pads left, expected left, right")
    Recording(np.arange(3) * 0.1, values(1, 3, 1, 1)[:3]).save(tmp_path / "press.npz")
    found = Recording.load(tmp_path / "press.npz", streams=path)  # streams do not depend on the pads
    np.testing.assert_allclose(found.covariates["gripper"], values()[:3], atol=1e-6)


@pytest.mark.parametrize("names", [NAMES, {"motors": NAMES}])
def test_a_dataset_without_tactile_features_gives_streams(tmp_path, names):
    state = values(2)
    features = {"observation.state": (state, {"names": names}), "touch": values(3, 6, 5)}
    path = dataset(tmp_path / "set", features, files=2)
    refused(path, r"(?s)no tactile feature.*observation.tactile.PAD of shape \(3, rows, cols\)")
    refused(path, r"touch \[3, 6, 5\]")
    refused(path, "--streams")
    time = np.concatenate([np.arange(5), np.arange(7)]) * 0.05
    Recording(time, np.zeros((12, 1, 3, 1, 1)), episode=[0] * 5 + [1] * 7).save(tmp_path / "press.npz")
    found = Recording.load(tmp_path / "press.npz", streams=path).covariates
    assert "observation.state" not in found
    np.testing.assert_allclose(found["observation.state.pan.pos"][[0, 2, 4, 5, 7, 9, 11]], state[:, 0], atol=1e-6)
    assert found["touch"].shape == (12, 3, 6, 5)


LEFT = "observation.tactile.left"
DESCRIPTIONS = [
    ({"codebase_version": "v2.1"}, "v2.1, expected v3; .*convert_dataset_v21_to_v30 --repo-id NAME"),
    ({"codebase_version": "v1.6"}, "is a LeRobotDataset v1.6, expected v3"),
    ({"codebase_version": "v4.0"}, "is a LeRobotDataset v4.0, but this paxisim reads only v3"),
    ({"codebase_version": 3}, "is not from a LeRobotDataset: expected codebase_version, e.g. v3.0"),
    ({"total_frames": 100}, "incomplete: meta/info.json states 100 frames, the data files hold 7"),
    ({"features": []}, "features must be an object of objects, each with a shape"),
    ({"features": {"a": {"shape": 3}}}, "features must be an object of objects, each with a shape"),
    ({"features": {"other": {"dtype": "float32", "shape": [3]}}}, "has no numeric column 'other'"),
    (
        {"features": {LEFT: {"dtype": "float32", "shape": [3, 5, 6]}}},
        r"observation.tactile.left has shape \(3, 6, 5\), expected \(3, 5, 6\)",
    ),
]
ADDITIONS = ["5", "[]", "{}", '{"begins": [0], "episodes": ["x"]}', '{"begins": [NaN], "episodes": [0]}', "[" * 10**5]


def test_what_a_dataset_says_of_itself_is_checked(tmp_path):
    for i, (changes, word) in enumerate(DESCRIPTIONS):
        refused(dataset(tmp_path / f"wrong{i}", {LEFT: values(3, 6, 5)}, **changes), word)
    for i, info in enumerate(({"unit": 5}, {"layout": 5}, {"layout": {"rows": 10**6, "cols": 10**6, "pitch": 1}})):
        path = dataset(tmp_path / f"info{i}", {LEFT: (values(3, 2, 1), {"info": info})})
        refused(path, "the (unit|layout) of observation.tactile.left")
    path = dataset(tmp_path / "set", {LEFT: values(3, 2, 1)})
    for about in ADDITIONS:
        (path / "meta/paxisim.json").write_text(about)
        refused(path, "meta/paxisim.json: ")


def test_names_and_times_of_episodes_that_came_or_went(tmp_path):
    """LeRobot's own episode numbers are kept if it has added episodes since."""
    path = dataset(tmp_path / "set", {"observation.tactile.left": values(3, 2, 1)})
    about = {"metadata": {"profile": "a"}, "episodes": [7, 3], "begins": [5.0, 9.0]}
    (path / "meta/paxisim.json").write_text(json.dumps(about))
    found = Recording.load(path)
    assert found.episode.tolist() == [7] * 3 + [3] * 4
    assert found.time[[0, 3]].tolist() == [5, 9]
    assert found.metadata == {"profile": "a", "tasks": {"7": "press", "3": "pull"}}
    (path / "meta/paxisim.json").write_text(json.dumps({**about, "episodes": [7], "begins": [5.0]}))
    found = Recording.load(path)
    assert found.episode.tolist() == [0] * 3 + [1] * 4
    assert found.time[[0, 3]].tolist() == [0, 0]


def test_folders_and_files_that_are_none(tmp_path, capsys):
    info, tasks, data = "meta/info.json", "meta/tasks.parquet", "data/chunk-000/file-000.parquet"
    path, empty = dataset(tmp_path / "set", {LEFT: values(3, 2, 1)}), tmp_path / "empty"
    empty.mkdir()
    refused(empty, "is a folder, but not a LeRobotDataset: expected meta/info.json in it")
    for name, content, word in (
        (info, None, "is a folder, but not a LeRobotDataset"),
        (info, b"{", "info.json: not JSON"),
        (info, b"\xff", "info.json: expected UTF-8 text"),
        (data, None, "has no frames: expected data/chunk-000"),
        (data, b"PAR1", "is not a complete Parquet file"),
        (tasks, b"tasks", "tasks.parquet is not a complete Parquet file"),
    ):
        whole = (path / name).read_bytes()
        (path / name).unlink()
        if content is not None:
            (path / name).write_bytes(content)
        assert main(["info", str(path)]) == 2
        assert word in capsys.readouterr().err
        (path / name).write_bytes(whole)
    refused(path / data, f"it is a part of the LeRobotDataset {path}, load that folder")
    refused(path, "profile is for the counts of a board's CSV file", profile=object())
    table = parquet.read_table(path / data)
    at = table.column_names.index("episode_index")
    for number in (np.nan, -1, 0.5, 1e12):
        episode = pa.array([0, 0, 0, number, 1, 1, 1], pa.float64())
        parquet.write_table(table.set_column(at, "episode_index", episode), path / data)
        refused(path, "episode_index must hold whole numbers of at least 0")


@pytest.mark.parametrize("shape", [(40_000_000,), (10, 4_000_000)], ids=["rows", "lists"])
def test_a_file_that_unpacks_to_very_much(tmp_path, monkeypatch, shape):
    """Repeated values take almost no space in Parquet."""
    path = dataset(tmp_path / "set", {"observation.tactile.left": values(3, 2, 1)}) / "data/chunk-000/file-000.parquet"
    zeros = pa.array(np.zeros(shape, np.float32).ravel())
    if len(shape) > 1:
        zeros = pa.ListArray.from_arrays(np.arange(shape[0] + 1, dtype=np.int32) * shape[1], zeros)
    parquet.write_table(pa.table({"timestamp": zeros}), path, compression="zstd")
    assert path.stat().st_size < 200_000
    for loaded in (tmp_path / "set", path):
        refused(loaded, f"unpacks to 320000000 bytes or more.* set {VARIABLE}=320000000")
    monkeypatch.setenv(VARIABLE, "300000000")
    refused(path, "expected at most 300000000")
