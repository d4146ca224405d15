"""lerobot_tables: the Parquet files of a LeRobotDataset, format v3.0, as LeRobot lays them out, and their statistics.

The statistics have the same shape as LeRobot's own: one value for each index of the feature's last axis, taken over all
frames and all other axes. LeRobot can therefore add episodes to the dataset and merge it with others.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.logs.lerobot_features import Feature
from paxisim.logs.lerobot_meta import TASKS

FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
"""Path of a file within its folder, from its chunk and file index."""
CHUNK_FILES = 1000
"""Number of files per chunk."""
FILE_MEGABYTES = 100
"""Maximum size of a file of frames, as in LeRobot; a larger episode is stored in a file of its own."""
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
_ROWS = 8192  # per row group


def write_frames(folder: Path, features: Sequence[Feature], spans: Sequence[slice]) -> list[int]:
    """Write the frames below ``data`` and return each episode's file number; `spans` are the episodes' frames."""
    import pyarrow as pa
    from pyarrow import parquet

    frame_bytes = sum(feature.values[:1].nbytes for feature in features)
    first = {feature.name: _column(feature.values[:1]) for feature in features}
    schema = pa.schema([(name, column.type) for name, column in first.items()])
    places: list[int] = []
    writer, number, size = None, -1, 0
    try:
        for span in spans:
            length = frame_bytes * (span.stop - span.start)
            size += length
            if writer is None or size > FILE_MEGABYTES * 1e6:
                if writer is not None:
                    writer.close()
                number, size = number + 1, length
                file = folder / "data" / _file(number)
                file.parent.mkdir(parents=True, exist_ok=True)
                writer = parquet.ParquetWriter(file, schema)
            places.append(number)
            for start in range(span.start, span.stop, _ROWS):
                rows = slice(start, min(start + _ROWS, span.stop))
                columns = [_column(feature.values[rows]) for feature in features]
                writer.write_table(pa.Table.from_arrays(columns, schema=schema))
    finally:
        if writer is not None:
            writer.close()
    return places


def _column(values: NDArray[Any]) -> Any:
    """Return an Arrow array of ``(T,)``, ``(T, n)`` or ``(T, a, b, ...)`` values, nested as in LeRobot."""
    import pyarrow as pa

    shape = values.shape[1:]
    array = pa.array(np.ascontiguousarray(values).ravel())
    if len(shape) == 1:
        return array if shape == (1,) else pa.FixedSizeListArray.from_arrays(array, shape[0])
    for size in reversed(shape):
        array = pa.ListArray.from_arrays(np.arange(0, len(array) + 1, size, dtype=np.int32), array)
    return array


def write_episodes(
    folder: Path, features: Sequence[Feature], spans: Sequence[slice], tasks: Sequence[str], files: Sequence[int]
) -> None:
    """Write each episode's location, task and statistics; `files` is the result of `write_frames`."""
    table: dict[str, list[Any]] = {
        "episode_index": list(range(len(spans))),
        "tasks": [[task] for task in tasks],
        "length": [span.stop - span.start for span in spans],
        "data/chunk_index": [file // CHUNK_FILES for file in files],
        "data/file_index": [file % CHUNK_FILES for file in files],
        "dataset_from_index": [span.start for span in spans],
        "dataset_to_index": [span.stop for span in spans],
    }
    for feature in features:
        found = [feature_stats(feature.values[span]) for span in spans]
        table |= {f"stats/{feature.name}/{what}": [one[what] for one in found] for what in found[0]}
    table |= {"meta/episodes/chunk_index": [0] * len(spans), "meta/episodes/file_index": [0] * len(spans)}
    _write(folder / "meta/episodes" / _file(0), table)


def write_tasks(folder: Path, tasks: Sequence[str]) -> None:
    """Write the tasks' texts. LeRobot reads the table with pandas and expects the text as the row's index label."""
    names = "__index_level_0__"
    columns = [
        {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, field, kind, numpy in (
            ("task_index", "task_index", "int64", "int64"),
            (None, names, "unicode", "object"),
        )
    ]
    pandas = json.dumps({"index_columns": [names], "column_indexes": [], "columns": columns})
    _write(folder / TASKS, {"task_index": list(range(len(tasks))), names: list(tasks)}, {"pandas": pandas})


def _write(path: Path, columns: dict[str, list[Any]], about: dict[str, str] | None = None) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(pa.table(columns).replace_schema_metadata(about), path)


def _file(number: int) -> str:
    return FILE.format(chunk_index=number // CHUNK_FILES, file_index=number % CHUNK_FILES)


def feature_stats(values: NDArray[Any]) -> dict[str, list[Any]]:
    """Return minimum, maximum, mean, standard deviation and quantiles of the known values, and the number of frames.

    Args:
        values: ``(T, *shape)``, or ``(T,)`` for the shape ``(1,)``.

    Returns:
        Lists by name, each as long as the last axis except ``count``, which has length 1; NaN if no value is known.
    """
    flat = values.reshape(-1, values.shape[-1] if values.ndim > 1 else 1)
    columns = [_column_stats(flat[:, i]) for i in range(flat.shape[1])]
    return {**{name: [column[name] for column in columns] for name in columns[0]}, "count": [len(values)]}


def _column_stats(column: NDArray[Any]) -> dict[str, Any]:
    known = column[~np.isnan(column)]
    if not len(known):
        return dict.fromkeys(("min", "max", "mean", "std", *QUANTILES), float("nan"))
    exact = known.astype(np.float64)
    return {
        "min": known.min().item(),
        "max": known.max().item(),
        "mean": float(exact.mean()),
        "std": float(exact.std()),
        **dict(zip(QUANTILES, np.quantile(exact, list(QUANTILES.values())).tolist(), strict=True)),
    }
