"""lerobot_meta: contents of the folder ``meta`` of a LeRobotDataset, format v3."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.files import parse_file, parse_json
from paxisim.logs.about import read_about
from paxisim.logs.parquet import column_values, component_names, is_text, read_table
from paxisim.logs.recording_arrays import episode_starts

INFO, ABOUT, TASKS = "meta/info.json", "meta/paxisim.json", "meta/tasks.parquet"
INDICES = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_DTYPE = re.compile(r"(float|int|uint)\d{1,2}|bool")
_CONVERT = "python -m lerobot.datasets.v30.convert_dataset_v21_to_v30 --repo-id NAME --root DIR --push-to-hub false"


@dataclass(frozen=True)
class Meta:
    """Metadata of a dataset, read before its frames.

    Attributes:
        path: The dataset's folder.
        features: Features by name, each an object whose ``shape`` is a list of whole numbers.
        frames: Number of frames stated by the dataset, or None.
        about: Description that paxisim wrote of the recording; empty if another program wrote the dataset.
        robot: LeRobot's name of the robot, or None.
    """

    path: Path
    features: Mapping[str, dict[str, Any]]
    frames: int | None
    about: Mapping[str, Any]
    robot: str | None

    @property
    def numeric(self) -> list[str]:
        """Names of the features that hold numbers rather than images, videos or texts."""
        return [name for name, feature in self.features.items() if _DTYPE.fullmatch(str(feature.get("dtype")))]

    def names(self, feature: str) -> list[str]:
        """Return the names of a feature's axes or, for a vector, of its components; empty if it has none."""
        return component_names({feature: self.features[feature]}).get(feature, [])

    def components(self, feature: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
        """Return the columns of a vector ``(T, n)`` by the name of the component; empty without a name for each."""
        names = self.names(feature)
        is_named = values.ndim == 2 and len(names) == values.shape[1]
        return {name: values[:, i] for i, name in enumerate(names)} if is_named else {}

    def clock(self, indices: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the start time (s) and the number of each episode; `indices` are LeRobot's episode numbers, in order.

        Both come from paxisim's description. Without one, or if episodes were added or removed since, the start times
        are 0 s and the numbers are LeRobot's.
        """
        begins, numbers = self.about.get("begins", ()), self.about.get("episodes", ())
        is_as_written = np.array_equal(indices, np.arange(len(begins))) and len(numbers) == len(begins)
        if not is_as_written:
            return np.zeros(len(indices)), indices
        return np.asarray(begins, dtype=np.float64), np.asarray(numbers, dtype=np.int64)

    def metadata(self, task: NDArray[np.int64], episode: NDArray[np.int64]) -> dict[str, Any]:
        """Return the recording's metadata with the task's text as ``task``, or as ``tasks`` by episode number.

        Args:
            task: ``(T,)`` task index of each frame.
            episode: ``(T,)`` episode number of each frame.
        """
        metadata: dict[str, Any] = {"source": self.path.resolve().name}
        metadata |= {} if self.robot is None else {"robot_type": self.robot}
        metadata = dict(self.about["metadata"]) if self.about else metadata
        for name in ("task", "tasks"):  # replaced by those of the dataset
            metadata.pop(name, None)
        texts = _tasks(self.path / TASKS)
        starts = episode_starts(episode)
        found = {str(episode[i]): texts.get(int(task[i]), "") for i in starts}
        if len(set(found.values())) > 1:
            metadata["tasks"] = found
        elif any(found.values()):
            metadata["task"] = next(iter(found.values()))
        return metadata


def read_meta(path: Path) -> Meta:
    """Read ``meta/info.json`` and, if it exists, ``meta/paxisim.json``.

    Raises:
        InvalidValueError: ``meta/info.json`` is missing, or a file has another version or is malformed.
    """
    if not (path / INFO).is_file():
        raise InvalidValueError(f"{path} is a folder, but not a LeRobotDataset: expected {INFO} in it")
    info = parse_file(path / INFO, parse_json)
    _check_version(path, info)
    features = info.get("features")
    if not isinstance(features, dict) or not all(map(_is_feature, features.values())):
        raise InvalidValueError(f"{path / INFO}: features must be an object of objects, each with a shape")
    frames, robot = info.get("total_frames"), info.get("robot_type")
    about = parse_file(path / ABOUT, lambda text: _checked(path / ABOUT, parse_json(text))) if _has_about(path) else {}
    return Meta(path, features, frames if type(frames) is int else None, about, robot if type(robot) is str else None)


def _has_about(path: Path) -> bool:
    return (path / ABOUT).is_file()


def _check_version(path: Path, info: Any) -> None:
    version = info.get("codebase_version") if isinstance(info, dict) else None
    found = re.fullmatch(r"v?(\d{1,3})(\.\d{1,3}){0,2}", version) if isinstance(version, str) else None
    if found is None:
        raise InvalidValueError(f"{path / INFO} is not from a LeRobotDataset: expected codebase_version, e.g. v3.0")
    if int(found[1]) < 3:
        raise InvalidValueError(
            f"{path} is a LeRobotDataset {version}, expected v3; convert v2.1 with LeRobot 0.4: {_CONVERT}"
        )
    if int(found[1]) > 3:
        raise InvalidValueError(f"{path} is a LeRobotDataset {version}, but this paxisim reads only v3")


def _is_feature(feature: Any) -> bool:
    shape = feature.get("shape") if isinstance(feature, dict) else None
    return isinstance(shape, list) and all(type(size) is int for size in shape)


def _checked(path: Path, about: Any) -> dict[str, Any]:
    found = read_about(path, about)
    begins, numbers = about.get("begins"), about.get("episodes")
    is_time = isinstance(begins, list) and all(type(t) in (int, float) and math.isfinite(t) for t in begins)
    is_number = isinstance(numbers, list) and all(type(n) is int and abs(n) < 2**53 for n in numbers)
    if not is_time or not is_number:
        raise InvalidValueError("expected begins, a list of seconds, and episodes, a list of whole numbers")
    return {**found, "begins": begins, "episodes": numbers}


def _tasks(path: Path) -> dict[int, str]:
    """Return the tasks' texts by index, taken from the only text column."""
    if not path.is_file():
        return {}
    table = read_table(path, lambda field: field.name == "task_index" or is_text(field.type))
    texts = [name for name in table.column_names if name != "task_index"]
    if len(texts) != 1 or "task_index" not in table.column_names:
        raise InvalidValueError(f"{path} must have a column task_index and one text column, got {table.column_names}")
    index = column_values(f"{path}, column 'task_index'", table["task_index"])
    try:
        found = zip(index.tolist(), table[texts[0]].to_pylist(), strict=True)
    except UnicodeDecodeError as error:
        raise InvalidValueError(f"{path}: the task texts must be UTF-8: {error}") from error
    return {int(number): text or "" for number, text in found if math.isfinite(number)}
