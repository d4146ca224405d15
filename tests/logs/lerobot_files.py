"""LeRobotDatasets as other programs write them, for the tests of reading."""

import json

import numpy as np
import pyarrow as pa
from pyarrow import parquet

LENGTHS = (3, 4)
SAMPLES = sum(LENGTHS)


def values(*shape, seed=0):
    return np.random.default_rng(seed).normal(size=(SAMPLES, *shape)).astype(np.float32)


def nested(array):
    kind = pa.float32()
    for _ in array.shape[1:]:
        kind = pa.list_(kind)
    return pa.array(array.tolist(), kind)


def dataset(folder, streams, files=1, task=("press", "pull"), **changes):
    """Write two episodes at 10 Hz without paxisim's additions; `streams` are arrays or (array, description) pairs."""
    frame = np.concatenate([np.arange(n) for n in LENGTHS])
    episode = np.repeat([0, 1], LENGTHS)
    arrays = {name: given[0] if isinstance(given, tuple) else given for name, given in streams.items()}
    columns = {name: nested(array) for name, array in arrays.items()} | {
        "timestamp": pa.array((frame / 10).astype(np.float32)),
        **{"frame_index": pa.array(frame), "episode_index": pa.array(episode)},
        **{"index": pa.array(np.arange(SAMPLES)), "task_index": pa.array(episode)},
    }
    table = pa.table(columns)
    for i, part in enumerate(np.array_split(np.arange(SAMPLES), files)):
        path = folder / f"data/chunk-{i // 2:03d}/file-{i % 2:03d}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(table.slice(part[0], len(part)), path)
    (folder / "meta").mkdir()
    described = {
        name: {
            **{"dtype": "float32", "shape": list(array.shape[1:]) or [1], "names": None},
            **(streams[name][1] if isinstance(streams[name], tuple) else {}),
        }
        for name, array in arrays.items()
    }
    described["observation.images.front"] = {"dtype": "video", "shape": [48, 64, 3], "names": None}
    info = {
        "codebase_version": "v3.0",
        "robot_type": "so101",
        "total_frames": SAMPLES,
        "fps": 10,
        "features": described,
    }
    (folder / "meta/info.json").write_text(json.dumps({**info, **changes}))
    tasks = pa.table({"task_index": list(range(len(task))), "__index_level_0__": list(task)})
    parquet.write_table(tasks, folder / "meta/tasks.parquet")
    return folder
