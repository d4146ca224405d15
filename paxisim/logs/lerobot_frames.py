"""lerobot_frames: a recording on the regular clock of a LeRobotDataset, whose frame ``k`` is at ``k / fps`` seconds.

- ``fps`` is a whole number: the recording's rounded sampling rate, unless another is given.
- If the samples of every episode, rounded to the nearest frame, are frames 0, 1, 2 ... with none missing or doubled,
  they become these frames unchanged. No value changes, and no time changes by more than half a frame.
- Otherwise all streams are resampled as by `paxisim.Recording.resample`: interpolated between neighbouring samples,
  and NaN in long gaps.
- Frames with unknown values can be dropped; the frames after them then form a new episode.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.logs.recording_arrays import Method, RecordingArrays, episode_spans, episode_starts, rate_of
from paxisim.logs.renumber import renumbered
from paxisim.logs.retime import at_rate
from paxisim.logs.select import known_samples, take


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
