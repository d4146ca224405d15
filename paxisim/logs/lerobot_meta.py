"""lerobot_meta: what the folder ``meta`` of a LeRobotDataset, format v3, says of it."""

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
from paxisim.files import parse_file
from paxisim.logs.about import read_about
from paxisim.logs.parquet import column_values, is_text, read_table
from paxisim.logs.recording_arrays import episode_starts
from paxisim.logs.text import parse_json

INFO, ABOUT, TASKS = "meta/info.json", "meta/paxisim.json", "meta/tasks.parquet"
INDICES = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_CONVERT = "python -m lerobot.datasets.v30.convert_dataset_v21_to_v30 --repo-id NAME --root DIR --push-to-hub false"


@dataclass(frozen=True)
class Meta:
    """What is known of a dataset before its frames are read.

    Attributes:
        path: The dataset's folder.
        features: By name an object with a list of whole numbers ``shape``.
        frames: How many it should have, if it says so.
        about: What paxisim wrote of the recording, or nothing.
        robot: LeRobot's name of the robot, or None.
    """

    path: Path
    features: Mapping[str, dict[str, Any]]
    frames: int | None
    about: Mapping[str, Any]
    robot: str | None

    def clock(self, indices: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """When each episode begins (s), and its number; `indices` are LeRobot's numbers of them, in order.

        As paxisim wrote them; 0 s and LeRobot's numbers where it did not, or episodes came or went since.
        """
        begins, numbers = self.about.get("begins", ()), self.about.get("episodes", ())
        is_as_written = np.array_equal(indices, np.arange(len(begins))) and len(numbers) == len(begins)
        if not is_as_written:
            return np.zeros(len(indices)), indices
        return np.asarray(begins, dtype=np.float64), np.asarray(numbers, dtype=np.int64)

    def metadata(self, task: NDArray[np.int64], episode: NDArray[np.int64]) -> dict[str, Any]:
        """The recording's metadata, with the task in words: ``task``, or ``tasks`` by the episode's number.

        Args:
            task: ``(T,)`` the index of each frame's task.
            episode: ``(T,)`` the number of each frame's episode.
        """
        metadata: dict[str, Any] = {"source": self.path.resolve().name}
        metadata |= {} if self.robot is None else {"robot_type": self.robot}
        metadata = dict(self.about["metadata"]) if self.about else metadata
        for name in ("task", "tasks"):  # what the dataset says counts
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
    """Read ``meta/info.json``, and ``meta/paxisim.json`` where there is one.

    Raises:
        InvalidValueError: There is none, it is of another version, or not what it should be.
    """
    if not (path / INFO).is_file():
        raise InvalidValueError(f"{path} is a folder, but no LeRobotDataset: expected {INFO} in it")
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
        raise InvalidValueError(f"{path / INFO} is of no LeRobotDataset: expected codebase_version, such as v3.0")
    if int(found[1]) < 3:
        raise InvalidValueError(
            f"{path} is a LeRobotDataset {version}, expected v3; LeRobot 0.4 converts one of v2.1: {_CONVERT}"
        )
    if int(found[1]) > 3:
        raise InvalidValueError(f"{path} is a LeRobotDataset {version}, which is newer than this paxisim: expected v3")


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
    """The tasks' texts by their index, from the one column of texts."""
    if not path.is_file():
        return {}
    table = read_table(path, lambda field: field.name == "task_index" or is_text(field.type))
    texts = [name for name in table.column_names if name != "task_index"]
    if len(texts) != 1 or "task_index" not in table.column_names:
        raise InvalidValueError(f"{path} must have a column task_index and one of texts, it has {table.column_names}")
    index = column_values(f"{path}, column 'task_index'", table["task_index"])
    try:
        found = zip(index.tolist(), table[texts[0]].to_pylist(), strict=True)
    except UnicodeDecodeError as error:
        raise InvalidValueError(f"{path}: the texts of the tasks must be UTF-8: {error}") from error
    return {int(number): text or "" for number, text in found if math.isfinite(number)}
