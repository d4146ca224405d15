"""lerobot_frames: a recording on the regular clock of a LeRobotDataset, whose frame ``k`` is at ``k / fps`` seconds.

- ``fps`` is a whole number: that of the recording's rate, rounded, unless another is given.
- Where the samples of every episode, rounded to the nearest frame, are its frames 0, 1, 2 ... without one that is left
  out or double, they are these frames as they are. No value changes, and no time by more than half a frame.
- Otherwise all streams are resampled, each value taken between its neighbouring samples and NaN in long gaps, as
  `paxisim.Recording.resample` does.
- Frames that are not wholly known may be left out; what follows them is then an episode of its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.logs.recording_arrays import Method, RecordingArrays, episode_spans, episode_starts, rate_of
from paxisim.logs.retime import at_rate
from paxisim.logs.select import known_samples, take


def frame_rate(recording: RecordingArrays, fps: int | None) -> int:
    """Frames a second of the dataset; `fps`, if it is given.

    Raises:
        InvalidValueError: `fps` is no whole number of at least 1, or the recording has no rate or one below 0.5 Hz.
    """
    if fps is not None:
        if not 1 <= fps <= 10**6 or fps != int(fps):
            raise InvalidValueError(f"fps must be a whole number of frames a second from 1 to 1e6, got {fps!r}")
        return int(fps)
    assert recording.episode is not None
    rate = rate_of(recording.time, recording.episode)
    if np.isnan(rate):
        raise InvalidValueError(
            "the recording has no rate, as no episode has two samples at different times; give fps (--fps)"
        )
    if round(rate) < 1:
        raise InvalidValueError(f"the recording has {rate:.3g} samples a second, expected at least 1; give fps (--fps)")
    return round(rate)


def on_frames(
    recording: RecordingArrays, fps: int, align: Method = "linear", drop: bool = False
) -> tuple[RecordingArrays, bool]:
    """The recording with a sample a frame, and whether it was resampled; its fields must have been checked.

    Args:
        recording: The recording.
        fps: Frames a second.
        align: How values are interpolated where it is resampled, as in `paxisim.Recording.resample`.
        drop: Leave out the frames at which a value is not known, and begin an episode anew after them.

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


def _is_regular(time: NDArray[np.float64], fps: int) -> bool:
    return np.array_equal(np.round((time - time[0]) * fps), np.arange(len(time)))


def _without_unknown(frames: RecordingArrays) -> RecordingArrays:
    assert frames.episode is not None
    known = known_samples(frames)
    if not known.any():
        raise InvalidValueError("no frame is left: there is none at which all streams are known")
    begins = np.diff(frames.episode, prepend=frames.episode[0] - 1) != 0
    begins[1:] |= ~known[:-1]
    left = take(frames, known)
    assert left.episode is not None
    _, episode = np.unique(np.cumsum(begins)[known], return_inverse=True)
    if episode[-1] + 1 > len(np.unique(left.episode)):  # one was split: the old numbers would come twice
        left = replace(left, episode=episode.astype(np.int64), metadata=_renumbered(left, episode))
    return left


def _renumbered(left: RecordingArrays, episode: NDArray[np.integer]) -> dict[str, Any]:
    """The metadata, in which ``tasks`` is by the new numbers of the episodes."""
    metadata = dict(left.metadata)
    tasks = metadata.get("tasks")
    if isinstance(tasks, dict) and left.episode is not None:
        old = {str(episode[i]): str(left.episode[i]) for i in episode_starts(episode)}
        metadata["tasks"] = {number: tasks[before] for number, before in old.items() if before in tasks}
    return metadata
