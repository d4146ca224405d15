"""lerobot_writer: a recording as a LeRobotDataset, format v3.0.

| file | holds |
|---|---|
| ``meta/info.json`` | frame rate, counts, the features of `paxisim.logs.lerobot_features` |
| ``meta/stats.json`` | statistics of each feature over all frames, as in `paxisim.logs.lerobot_tables` |
| ``meta/tasks.parquet`` | the tasks' texts |
| ``meta/episodes/chunk-000/file-000.parquet`` | location, length, task and statistics of each episode |
| ``meta/paxisim.json`` | pads and metadata of the recording, and the number and start time (s) of each episode |
| ``data/chunk-000/file-000.parquet`` ... | the frames; a new file begins where one would exceed 100 MB |

The clock of a dataset is regular, with frame ``k`` of an episode at ``k / fps`` seconds:

- ``fps`` is a whole number: the recording's rounded sampling rate, unless another is given.
- If the samples of every episode, rounded to the nearest frame, are frames 0, 1, 2 ... with none missing or doubled,
  they become these frames unchanged. No value changes, and no time changes by more than half a frame.
- Otherwise all streams are resampled as by `paxisim.Recording.resample`: interpolated between neighbouring samples,
  and NaN in long gaps.
- Frames with unknown values can be dropped; the frames after them then form a new episode.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.files import whole_folder
from paxisim.logs.about import about_text
from paxisim.logs.lerobot_features import Feature, features_of
from paxisim.logs.lerobot_meta import ABOUT, INDICES, INFO
from paxisim.logs.lerobot_tables import (
    CHUNK_FILES,
    FILE,
    FILE_MEGABYTES,
    feature_stats,
    write_episodes,
    write_frames,
    write_tasks,
)
from paxisim.logs.parquet import require_pyarrow
from paxisim.logs.recording_arrays import Method, RecordingArrays, episode_spans, episode_starts, rate_of
from paxisim.logs.renumber import renumbered
from paxisim.logs.retime import at_rate
from paxisim.logs.select import known_samples, take

VERSION = "v3.0"
_UNEVEN = 0.5  # an interval that differs from the median by more than this part of it is not jitter


def write_lerobot(
    path: Path,
    recording: RecordingArrays,
    *,
    fps: int | None = None,
    task: str | None = None,
    state: Sequence[str] = (),
    action: Sequence[str] = (),
    align: Method = "linear",
    drop: bool = False,
) -> str:
    """Write the dataset atomically: after an error nothing is left of it.

    Args:
        path: Output folder; must not exist yet.
        recording: A recording whose fields were checked, as returned by `paxisim.Recording.to_arrays`.
        fps: Frame rate (Hz); default: the recording's rounded sampling rate. See above.
        task: Description of the task; default: ``task`` or, by episode, ``tasks`` in the metadata, or empty.
        state: Covariates that make up ``observation.state``. See `paxisim.logs.lerobot_features`.
        action: Covariates that make up ``action``.
        align: Interpolation method if the recording must be resampled to regular frames.
        drop: Drop frames with an unknown value, and start a new episode after them.

    Returns:
        One-line summary of the written dataset.

    Raises:
        MissingExtraError, UnsupportedError: pyarrow cannot be used.
        OutputExistsError: The path already exists.
        InvalidValueError: There is no frame rate or no frame left, a stream is never known, or `features_of` raises
            this error.
        UnknownNameError: A covariate does not exist.
    """
    require_pyarrow()
    fps = frame_rate(recording, fps)
    frames, is_resampled = on_frames(recording, fps, align, drop)
    assert recording.episode is not None
    assert frames.episode is not None
    spans = episode_spans(frames.episode)
    texts = [_task(frames, int(frames.episode[span.start]), task) for span in spans]
    tasks = list(dict.fromkeys(texts))
    features = features_of(frames, state, action)
    _check_texts([*tasks, *(feature.name for feature in features)])
    _warn_of_unknown(features)
    features += _indices(spans, [tasks.index(text) for text in texts], fps)
    stats = {feature.name: feature_stats(feature.values) for feature in features}
    _refuse_unknown(stats)
    about = json.loads(about_text(frames)) | {
        "episodes": [int(frames.episode[span.start]) for span in spans],
        "begins": [float(frames.time[span.start]) for span in spans],
    }
    del about["layout"]  # stored with each feature
    with whole_folder(path) as folder:
        files = write_frames(folder, features, spans)
        write_episodes(folder, features, spans, texts, files)
        write_tasks(folder, tasks)
        _write_json(folder / INFO, _info(features, spans, tasks, fps, frames.metadata.get("robot_type")))
        _write_json(folder / "meta/stats.json", stats)
        _write_json(folder / ABOUT, about)
    how = f", resampled {_reason(recording, fps)}" if is_resampled else ""
    names = " ".join(feature.name for feature in features if feature.name not in INDICES)
    counts = f"{len(spans)} episode{'s' * (len(spans) != 1)}, {len(frames.time)} frames at {fps} Hz{how}"
    return f"LeRobotDataset {VERSION}, {counts}, {names}"


def frame_rate(recording: RecordingArrays, fps: int | None) -> int:
    """Return the frame rate (Hz) of the dataset: `fps` if given, otherwise the recording's rounded sampling rate.

    Raises:
        InvalidValueError: `fps` is not a whole number from 1 to 1e6, or the recording's rate is undefined or rounds
            to 0.
    """
    if fps is not None:
        if not 1 <= fps <= 10**6 or fps != int(fps):
            raise InvalidValueError(f"fps must be a whole number of frames per second from 1 to 1e6, got {fps!r}")
        return int(fps)
    assert recording.episode is not None
    rate = rate_of(recording.time, recording.episode)
    if np.isnan(rate):
        raise InvalidValueError(
            "the recording has no rate, because no episode has two samples at different times; give fps (--fps)"
        )
    if round(rate) < 1:
        raise InvalidValueError(f"the recording's rate must be at least 1 Hz, got {rate:.3g} Hz; give fps (--fps)")
    return round(rate)


def on_frames(
    recording: RecordingArrays, fps: int, align: Method = "linear", drop: bool = False
) -> tuple[RecordingArrays, bool]:
    """Return the recording with one sample per frame, and whether it was resampled.

    Args:
        recording: The recording; its fields must have been checked.
        fps: Frame rate (Hz).
        align: Interpolation method for resampling, as in `paxisim.Recording.resample`.
        drop: Drop frames with an unknown value, and start a new episode after them.

    Raises:
        InvalidValueError: No frame is left.
    """
    assert recording.episode is not None
    is_regular = all(_is_regular(recording.time[span], fps) for span in episode_spans(recording.episode))
    found = recording if is_regular else at_rate(recording, fps, align, None)
    assert found.episode is not None
    time = found.time.copy()
    for span in episode_spans(found.episode):
        time[span] = time[span.start] + np.arange(span.stop - span.start) / fps
    found = replace(found, time=time)
    return (_without_unknown(found) if drop else found), not is_regular


def _reason(recording: RecordingArrays, fps: int) -> str:
    """Return why a recording was resampled to `fps`."""
    assert recording.episode is not None
    rate = rate_of(recording.time, recording.episode)
    said = f"{rate:.6g}"
    if np.isfinite(rate) and round(rate) != fps:
        return f"from {said} Hz"
    intervals = np.diff(recording.time)[np.diff(recording.episode) == 0]
    if np.isnan(rate) or said == str(fps) or np.any(np.abs(intervals * rate - 1) > _UNEVEN):
        return "because its samples are irregular"
    return f"from {said} Hz because LeRobot needs a whole number of frames per second"


def _is_regular(time: NDArray[np.float64], fps: int) -> bool:
    return np.array_equal(np.round((time - time[0]) * fps), np.arange(len(time)))


def _without_unknown(frames: RecordingArrays) -> RecordingArrays:
    assert frames.episode is not None
    known = known_samples(frames)
    if not known.any():
        raise InvalidValueError("no frame is left: at every frame some stream is unknown")
    begins = np.diff(frames.episode, prepend=frames.episode[0] - 1) != 0
    begins[1:] |= ~known[:-1]
    left = take(frames, known)
    assert left.episode is not None
    _, episode = np.unique(np.cumsum(begins)[known], return_inverse=True)
    if episode[-1] + 1 > len(np.unique(left.episode)):  # an episode was split: the old numbers would repeat
        old = [(int(left.episode[i]), int(episode[i])) for i in episode_starts(episode)]
        left = replace(left, episode=episode.astype(np.int64), metadata=renumbered(left.metadata, old))
    return left


def _task(frames: RecordingArrays, episode: int, given: str | None) -> str:
    if given is not None:
        return given
    by_episode = frames.metadata.get("tasks")
    text = by_episode.get(str(episode)) if isinstance(by_episode, dict) else None
    text = frames.metadata.get("task") if text is None else text
    return text if isinstance(text, str) else ""


def _check_texts(texts: Sequence[str]) -> None:
    for text in texts:
        try:
            text.encode()
        except UnicodeEncodeError:
            raise InvalidValueError(f"{text!r:.80} cannot be encoded as UTF-8, e.g. it has a lone surrogate") from None


def _indices(spans: Sequence[slice], tasks: Sequence[int], fps: int) -> list[Feature]:
    lengths = [span.stop - span.start for span in spans]
    frame = np.concatenate([np.arange(length) for length in lengths])
    columns = {
        "timestamp": (frame / fps).astype(np.float32),
        "frame_index": frame,
        "episode_index": np.repeat(np.arange(len(spans)), lengths),
        "index": np.arange(len(frame)),
        "task_index": np.repeat(np.asarray(tasks, dtype=np.int64), lengths),
    }
    return [Feature(name, columns[name]) for name in INDICES]


def _info(
    features: Sequence[Feature], spans: Sequence[slice], tasks: Sequence[str], fps: int, robot: Any
) -> dict[str, Any]:
    described = {}
    for feature in features:
        dtype = str(feature.values.dtype)
        described[feature.name] = {"dtype": dtype, "shape": list(feature.shape), "names": feature.names}
        if feature.info:
            described[feature.name]["info"] = feature.info
    return {
        "codebase_version": VERSION,
        "robot_type": robot if isinstance(robot, str) else None,
        "total_episodes": len(spans),
        "total_frames": spans[-1].stop,
        "total_tasks": len(tasks),
        "chunks_size": CHUNK_FILES,
        "data_files_size_in_mb": FILE_MEGABYTES,
        "video_files_size_in_mb": 200,  # LeRobot's default; there is no video
        "fps": fps,
        "splits": {"train": f"0:{len(spans)}"},
        "data_path": f"data/{FILE}",
        "video_path": None,
        "features": described,
    }


def _write_json(path: Path, document: dict[str, Any]) -> None:
    path.write_text(json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")


def _warn_of_unknown(features: Sequence[Feature]) -> None:
    unknown = {f.name: np.isnan(f.values.reshape(len(f.values), -1)).any(axis=1) for f in features}
    names = [name for name, frames in unknown.items() if frames.any()]
    if names:
        count = int(np.any([unknown[name] for name in names], axis=0).sum())
        warnings.warn(
            f"{count} of {len(unknown[names[0]])} frames hold NaN (unknown values) in {', '.join(names)}; few policies "
            "can be trained on such frames: drop them with --missing drop (drop=True)",
            stacklevel=3,
        )


def _refuse_unknown(stats: dict[str, dict[str, list[Any]]]) -> None:
    for name, found in stats.items():
        if np.isnan(found["mean"]).any():
            raise InvalidValueError(
                f"{name} holds values that are not known at any frame, and LeRobot needs statistics of each: exclude "
                "the pad or the covariate (--pads, Recording.select)"
            )
