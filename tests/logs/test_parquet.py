"""Parquet tables: columns of LeRobot datasets, the end of a file, and tables that are none."""

import subprocess
import sys

import numpy as np
import pytest
from log_files import refused

from paxisim.logs.parquet_footer import column_chunks
from paxisim.recording import Recording

pytest.importorskip("pyarrow.parquet", exc_type=ImportError)

import pyarrow as pa
from pyarrow import parquet

FRAMES = [(episode, frame) for episode, count in ((0, 3), (1, 4)) for frame in range(count)]
STATE = np.array([[episode + frame / 10, -frame] for episode, frame in FRAMES], np.float32)


def lerobot(path, kind, **extra):
    """Write two episodes of 3 and 4 frames at 10 Hz with the columns of a LeRobotDataset, vectors as `kind` of list."""
    columns = {
        "observation.state": pa.array(STATE.tolist(), kind),
        "action": pa.array((2 * STATE).tolist(), kind),
        "timestamp": pa.array([frame / 10 for _, frame in FRAMES], pa.float32()),
        "frame_index": pa.array([frame for _, frame in FRAMES]),
        "episode_index": pa.array([episode for episode, _ in FRAMES]),
        "index": pa.array(range(7)),
        "task_index": pa.array([0] * 7),
        "next.done": pa.array([False] * 7),
        "observation.image": pa.array([{"path": "a.png"}] * 7),
        "task": pa.array(["press"] * 7),
    }
    parquet.write_table(pa.table({**columns, **extra}), path)
    return path


@pytest.fixture
def press(tmp_path):
    """A recording of the same two episodes at 20 Hz."""
    time = np.concatenate([np.arange(5), np.arange(7)]) * 0.05
    pressed = Recording(time, np.zeros((12, 1, 3, 1, 1)), episode=[0] * 5 + [1] * 7)
    pressed.save(tmp_path / "press.npz")
    return tmp_path / "press.npz"


@pytest.mark.parametrize("kind", [pa.list_(pa.float32(), 2), pa.list_(pa.float32())])
def test_the_vectors_of_lerobot_are_added_and_with_taxels_are_a_recording(tmp_path, press, kind):
    path = lerobot(tmp_path / "a.parquet", kind)
    found = Recording.load(press, streams=path)
    assert sorted(found.covariates) == ["action", "next.done", "observation.state"]
    np.testing.assert_allclose(found.covariates["observation.state"][[0, 2, 4, 5, 7, 9, 11]], STATE, rtol=1e-6)
    np.testing.assert_allclose(found.covariates["action"][1], STATE[0] + STATE[1], rtol=1e-6)
    taxels = {f"tactile.left.0_{col}.{axis}": pa.array(np.arange(7.0) + col) for col in range(2) for axis in "xyz"}
    found = Recording.load(lerobot(path, kind, **taxels))
    assert found.measured.shape == (7, 1, 3, 1, 2)
    assert found.episode.tolist() == [0, 0, 0, 1, 1, 1, 1]
    np.testing.assert_allclose(found.time, [0, 0.1, 0.2, 0, 0.1, 0.2, 0.3], atol=1e-7)
    np.testing.assert_array_equal(found.covariates["observation.state"], STATE)


@pytest.mark.parametrize("compression", ["none", "snappy", "zstd"])
def test_the_end_of_a_file_says_what_pyarrow_says(tmp_path, compression):
    rows = range(100)
    columns = {f"column {i}": [float(i)] * 100 for i in range(40)} | {
        **{"text": ["a", "b\u00e9", None, ""] * 25, "flag": [True, None] * 50, "bytes": [b"x"] * 100},
        **{"list": [[1.0] * (i % 3) for i in rows], "deep": [[[1, 2], []]] * 100, "one.two": [{"a": i} for i in rows]},
    }
    table = pa.table(columns).replace_schema_metadata({"a": "b" * 1000})
    parquet.write_table(table, tmp_path / "a.parquet", row_group_size=30, compression=compression)
    about = parquet.read_metadata(tmp_path / "a.parquet")
    groups = [about.row_group(i) for i in range(about.num_row_groups)]
    expected = [group.column(i) for group in groups for i in range(about.num_columns)]
    found = column_chunks(tmp_path / "a.parquet")
    assert len(groups) == 4
    assert [".".join(chunk.path) for chunk in found] == [column.path_in_schema for column in expected]
    assert [chunk.values for chunk in found] == [column.num_values for column in expected]
    assert [chunk.size for chunk in found] == [column.total_uncompressed_size for column in expected]
    assert [chunk.is_text for chunk in found] == [column.physical_type == "BYTE_ARRAY" for column in expected]


def test_a_process_that_ends_at_once_ends_with_our_status(tmp_path):
    parquet.write_table(pa.table({"timestamp": pa.array([], pa.float64())}), tmp_path / "empty.parquet")
    words = [sys.executable, "-m", "paxisim", "info", str(tmp_path / "empty.parquet")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.endswith("empty.parquet has no rows\n")


def test_tables_that_are_none_are_named(tmp_path, press):
    path = tmp_path / "a.parquet"
    path.write_bytes(b"PAR1 and no more")
    refused(path, "a.parquet is not a complete Parquet file")
    parquet.write_table(pa.table({"timestamp": [0.0, 0.1]}), path)
    refused(path, "a.parquet: the table must have columns tactile.PAD")
    refused(press, "a.parquet has no numeric stream besides its times", streams=path)
    parquet.write_table(pa.table({"timestamp": [0.0, 0.1], "state": [[1.0], [1.0, 2.0]]}), path)
    refused(press, "column 'state': every row must hold a vector of the same length", streams=path)
