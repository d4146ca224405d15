"""Clocks: by how much the measured contacts come after the simulated ones, and streams moved to the sensor's clock.

A robot and a sensor that are logged by two programs rarely share a clock. A sensor's latency has the same effect as an
offset between the clocks, and a recording alone cannot tell them apart. But a latency is positive and the same in every
episode, whereas each start of a program may set a clock anew. So a lag that is negative, or that differs between
episodes by more than its error, is one of the clocks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.logs.encoder_steps import with_steps
from paxisim.presses import find_presses
from paxisim.recording import Recording
from paxisim.scene.closing import total_normal
from paxisim.scene.grasps import CLOSING_FITS
from paxisim.scene.scene import Scene

MAX_OFFSET = 10.0
"""Largest offset (s) between the clocks of an episode that is looked for, and at most half of the episode."""
_LEVEL = 0.3  # of the peak of a grasp; where a contact begins and ends
_AROUND = 0.5  # s; reach of the search for the flanks of a grasp, once the streams are roughly aligned
_CERTAIN = 4.0  # standard errors by which a lag must differ from 0 or from that of another episode
_PASSES = 3


@dataclass(frozen=True)
class Lag:
    """Time by which the contacts of an episode are measured after their simulation.

    Attributes:
        episode: Number of the episode.
        seconds: The lag (s): the mean over the begins and ends of its grasps. An object that is larger than in the
            scene begins its contact earlier and ends it later, which leaves the mean as it is.
        error: Its standard error (s).
    """

    episode: int
    seconds: float
    error: float


@dataclass(frozen=True)
class Lags:
    """Lags of the episodes of a recording; its text states what they mean.

    Attributes:
        lags: One lag for each episode with contact in both streams.
    """

    lags: tuple[Lag, ...]

    @property
    def common(self) -> Lag | None:
        """The weighted mean of all lags, with the number of the first episode; None if there is no lag."""
        if not self.lags:
            return None
        weights = np.array([lag.error for lag in self.lags]) ** -2.0
        mean = float(np.average([lag.seconds for lag in self.lags], weights=weights))
        return Lag(self.lags[0].episode, mean, float(weights.sum() ** -0.5))

    @property
    def of_clocks(self) -> bool:
        """Whether the clocks of robot and sensor certainly differ."""
        return bool(self._why)

    @property
    def _why(self) -> str:
        common = self.common
        if common is None:
            return ""
        low, high = (pick(self.lags, key=lambda lag: lag.seconds) for pick in (min, max))
        if high.seconds - low.seconds > _CERTAIN * np.hypot(low.error, high.error):
            return (
                f"{_shown(low.seconds)} in episode {low.episode} and {_shown(high.seconds)} in episode {high.episode}, "
                "but a sensor's latency does not change"
            )
        if common.seconds < -_CERTAIN * common.error:
            return f"{_shown(common.seconds)}, but no sensor measures a contact before it happens"
        return ""

    def __str__(self) -> str:
        """Return the common lag, or why it is one of the clocks, as text; empty if there is no lag."""
        common = self.common
        if common is None or (not self._why and common.seconds < _CERTAIN * common.error):
            return ""
        if self._why:
            return f"The clocks of robot and sensor differ: contacts are measured {self._why} (--align-clocks)"
        return (
            f"Contacts are measured {_shown(common.seconds)} (+-{1e3 * common.error:.0f} ms), in all episodes alike: "
            "latency of the sensor or an offset between its clock and the robot's, which a recording cannot tell apart"
        )


def _shown(seconds: float) -> str:
    return f"{1e3 * abs(seconds):.0f} ms {'early' if seconds < 0 else 'late'}"


def find_lags(recording: Recording) -> Lags:
    """Return by how much the measured contacts of each episode lag behind the simulated ones.

    Args:
        recording: A recording with both streams in newtons.
    """
    assert recording.measured is not None
    assert recording.simulated is not None
    found: dict[int, NDArray[np.float64]] = {}
    totals = total_normal(recording.measured), total_normal(recording.simulated)
    for number in dict.fromkeys(recording.episode.tolist()):
        own = recording.episode == number
        flanks = _flanks(recording.time[own], totals[0][own], totals[1][own])
        if len(flanks) > 1:
            found[number] = flanks
    if not found:
        return Lags(())
    interval = float(np.median(np.diff(recording.time)))
    inside = np.concatenate([own - own.mean() for own in found.values()])
    spread = float(np.sqrt(np.sum(inside**2) / max(len(inside) - len(found), 1)))
    spread = max(spread, interval)
    return Lags(tuple(Lag(number, float(own.mean()), spread / np.sqrt(len(own))) for number, own in found.items()))


def align_clocks(
    scene: Scene, recording: Recording, progress: Callable[[str], None] | None = None
) -> tuple[Recording, Lags]:
    """Move the streams that drive a scene to the sensor's clock, in each episode by its own lag.

    The motion is simulated as mode ``"kinematic"`` does. The latency of the sensor then cannot be determined any more,
    because the alignment removes it too.

    Args:
        scene: The scene.
        recording: Recording with measured forces in newtons and the driving streams.
        progress: Callback that is called with a line of text for each pass.

    Returns:
        The recording with the streams moved, NaN where they are then unknown; its metadata hold the mean shift
        (``clocks_aligned_by``) and that of each episode (``clock_offsets``). And the lags that were found.

    Raises:
        InvalidValueError: There are no measured forces in newtons, or no episode has contact in both streams.
        UnknownNameError: See `paxisim.Scene.simulate`.
    """
    from paxisim.scene.replay import Replay

    if recording.measured is None or recording.unit != "N":
        raise InvalidValueError("aligning the clocks needs measured forces in newtons")
    scene = plain_motion(scene)
    total: dict[int, float] = {}
    aligned, first = recording, Lags(())
    for count in range(_PASSES):
        if progress is not None:
            progress(f"aligning the clocks, pass {count + 1}")
        lags = find_lags(aligned.with_simulated(Replay(scene, aligned).forces()))
        if count == 0:
            first = lags
            if not lags.lags:
                raise InvalidValueError(
                    "the clocks cannot be aligned: no episode has a grasp that is both measured and simulated within "
                    f"{MAX_OFFSET:g} s"
                )
        for lag in lags.lags:
            total[lag.episode] = total.get(lag.episode, 0.0) + lag.seconds
        aligned = _moved(recording, scene, total)
        if all(abs(lag.seconds) < 2 * lag.error for lag in lags.lags):
            break
    return aligned, first


def plain_motion(scene: Scene) -> Scene:
    """Return the scene in a mode that follows the streams as they are, without fitting a closing to the forces."""
    return replace(scene, mode="kinematic") if scene.mode in (*CLOSING_FITS, "auto") else scene


def _moved(recording: Recording, scene: Scene, offsets: Mapping[int, float]) -> Recording:
    """Return the recording with the driving streams of each episode delayed by its offset (s).

    An episode without an offset of its own is delayed by the mean.
    """
    mean = float(np.mean(list(offsets.values())))
    covariates = dict(recording.covariates)
    for name in {drive.stream for drive in scene.drives} & covariates.keys():
        values = covariates[name].astype(np.float64)
        for part in recording.episodes():
            own = recording.episode == part.episode[0]
            then = part.time - offsets.get(int(part.episode[0]), mean)
            flat = values[own].reshape(len(then), -1)
            moved = [np.interp(then, part.time, column, left=np.nan, right=np.nan) for column in flat.T]
            values[own] = np.stack(moved, axis=1).reshape(values[own].shape)
        covariates[name] = values
    known = {str(number): float(offset) for number, offset in offsets.items()}
    metadata = {
        **with_steps(recording.metadata, recording.covariates),
        "clocks_aligned_by": mean,
        "clock_offsets": known,
    }
    return replace(recording, covariates=covariates, metadata=metadata)


def _flanks(
    time: NDArray[np.float64], measured: NDArray[np.float64], simulated: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the lags ``(flanks,)`` (s) of all begins and ends of contact that both streams have."""
    try:
        presses, rest = find_presses(time, measured), find_presses(time, simulated).rest
    except InvalidValueError:
        return np.zeros(0)
    if not presses.spans:
        return np.zeros(0)
    measured, simulated = measured - presses.rest, simulated - rest
    rough, found = _rough_lag(time, measured, simulated), []
    begins = np.array([time[span.start] for span in presses.spans])
    ends = np.array([time[span.stop - 1] for span in presses.spans])
    gaps = np.minimum(_AROUND, np.concatenate([[_AROUND], 0.5 * (begins[1:] - ends[:-1]), [_AROUND]]))
    for begin, end in zip(begins - gaps[:-1], ends + gaps[1:], strict=True):
        ours, theirs = _crossings(time, measured, begin, end), _crossings(time, simulated, begin - rough, end - rough)
        if ours and theirs:
            found += [ours[0] - theirs[0], ours[1] - theirs[1]]
    return np.array(found)


def _rough_lag(time: NDArray[np.float64], measured: NDArray[np.float64], simulated: NDArray[np.float64]) -> float:
    """Return the lag (s) at which the streams correlate best."""
    from scipy.signal import correlate

    interval = float(np.median(np.diff(time)))
    if not interval > 0:
        return 0.0
    at = np.arange(time[0], time[-1], interval)
    if len(at) < 2:
        return 0.0
    both = [np.interp(at, time, np.nan_to_num(stream)) for stream in (measured, simulated)]
    product = correlate(both[0] - both[0].mean(), both[1] - both[1].mean(), method="fft")
    lags = np.arange(len(product)) - (len(at) - 1)
    near = np.abs(lags) * interval <= min(MAX_OFFSET, 0.5 * (time[-1] - time[0]))
    return float(lags[near][int(np.argmax(product[near]))] * interval)


def _crossings(
    time: NDArray[np.float64], force: NDArray[np.float64], begin: float, end: float
) -> tuple[float, float] | None:
    """Return when a force first rises above a share of its peak and last falls below it; None if it does not."""
    own = (time >= begin) & (time <= end) & np.isfinite(force)
    at, values = time[own], force[own]
    if len(at) < 3 or not values.max() > 0:
        return None
    level = _LEVEL * float(values.max())
    above = np.flatnonzero(values > level)
    if above[0] == 0 or above[-1] == len(at) - 1:
        return None
    rise = np.interp(level, values[above[0] - 1 : above[0] + 1], at[above[0] - 1 : above[0] + 1])
    fall = np.interp(-level, -values[above[-1] : above[-1] + 2], at[above[-1] : above[-1] + 2])
    return float(rise), float(fall)
