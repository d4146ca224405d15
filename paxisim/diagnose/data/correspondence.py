"""Correspondence: whether both streams show the same motion, and the offset between their clocks.

The streams are compared by their activity: the root of the summed squared changes of all channels. It is almost
unaffected by swapped taxels, axes or pads, and by signs, gains, offsets and drift.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from paxisim.diagnose.data.noise import FloatArray
from paxisim.diagnose.rules import STREAMS
from paxisim.logs.memory import in_one_piece
from paxisim.logs.recording_arrays import episode_spans
from paxisim.recording import Recording

CLIP_QUANTILE = 0.97  # quantile at which the activity is clipped, so that a few wild frames do not dominate
ACTIVITY_WINDOW = 0.2  # s, window of the moving means whose changes are the activity
MIN_STRETCH_SAMPLES = 10  # fewest samples of a stretch
MIN_INTERVAL = 0.02  # s, shortest interval between samples of the activity

CLOCKS = (
    "the clocks of the two streams differ: measured lags simulated by {:.2f} s. The streams were aligned first, so a "
    "delay of the sensor itself cannot be determined; check the clocks"
)


@dataclass(frozen=True)
class Correspondence:
    """How well two streams match.

    Attributes:
        shift: Lag of the measured behind the simulated stream at the highest correlation, in seconds.
        alike: Correlation of the activities at that lag.
        at_once: Highest correlation at lags of at most `STREAMS.delay` seconds.
        why: Why the streams do not show the same motion; empty if they may.
    """

    shift: float
    alike: float
    at_once: float
    why: str

    @property
    def clocks_apart(self) -> bool:
        """Whether the clocks differ by more than the delay of a sensor."""
        return not self.why and abs(self.shift) > STREAMS.delay and 1 - self.alike < STREAMS.left * (1 - self.at_once)


NO_CORRESPONDENCE = Correspondence(0.0, 1.0, 1.0, "")
"""The result for recordings without contact and for those that are too short to compare."""


def correspondence_of(recording: Recording, replayed: bool = False) -> Correspondence:
    """Compare the measured stream with the simulated one.

    Args:
        recording: Recording with both streams.
        replayed: Whether the simulation replays motions that were recorded with the measured stream. The episodes are
            then known to be in the same order, and parts of them between doubtful spans may look alike.
    """
    assert recording.measured is not None
    assert recording.simulated is not None
    if not recording.simulated.any():
        return NO_CORRESPONDENCE
    spans = in_one_piece(recording.time, episode_spans(recording.episode))
    interval = max(float(np.median(np.diff(recording.time[spans[0]]))), MIN_INTERVAL)
    pairs, numbers = [], []
    for span in spans:
        time = recording.time[span]
        step = max(1, round(ACTIVITY_WINDOW / max(float(np.median(np.diff(time))), 1e-9)))
        time = time[step : len(time) + 1 - step]  # centre of each change
        grid = np.arange(time[0], time[-1], interval) if len(time) else time
        if len(grid) > MIN_STRETCH_SAMPLES:
            both = (_activity(s[span].astype(np.float64), step) for s in (recording.measured, recording.simulated))
            pairs.append(tuple(np.interp(grid, time, activity) for activity in both))
            numbers.append(int(recording.episode[span.start]))
    if not pairs:
        return NO_CORRESPONDENCE
    shifts, alike = _correlation(pairs, int(STREAMS.offset / interval))
    best = int(np.argmax(alike))
    near = np.abs(shifts) * interval <= STREAMS.delay
    shift = _peak(shifts, alike, best) * interval
    doubtful = alike[best] < STREAMS.doubtful  # one of many shifts may fit by chance
    if alike[best] < STREAMS.correlation or (
        doubtful and (abs(shift) > STREAMS.delay or _alike(_shifted(recording, shift)) < STREAMS.shared)
    ):
        why = (
            f"measured does not follow simulated at any clock shift up to {shifts[-1] * interval:.2g} s (the "
            f"correlation of their activities is at most {alike[best]:.2f})"
        )
    else:
        why = "" if replayed else _other_order(pairs, numbers, int(shifts[best]))
    return Correspondence(shift, float(alike[best]), float(alike[near].max()), why)


def aligned(recording: Recording, shift: float) -> Recording:
    """The recording with the simulated stream and the covariates delayed by about `shift` seconds.

    The shift is refined to maximise the correlation of the forces over all channels.
    """
    near = (shift - ACTIVITY_WINDOW, shift + ACTIVITY_WINDOW)
    best = minimize_scalar(lambda by: -_alike(_shifted(recording, by)), bounds=near, method="bounded")
    return _shifted(recording, float(best.x))


def _alike(recording: Recording) -> float:
    """Mean squared correlation of both streams over the channels, weighted by the variance of the measurement."""
    assert recording.measured is not None
    assert recording.simulated is not None
    both = (values.reshape(len(values), -1) for values in (recording.measured, recording.simulated))
    measured, simulated = (values - values.mean(axis=0, dtype=np.float64) for values in both)
    product, variance = np.sum(measured * simulated, axis=0), np.sum(simulated**2, axis=0)
    return float(np.sum(product**2 / np.maximum(variance, 1e-12)) / max(float(np.sum(measured**2)), 1e-300))


def _shifted(recording: Recording, shift: float) -> Recording:
    """The recording with the simulated stream and the covariates delayed by `shift` seconds."""
    assert recording.simulated is not None
    kept, simulated = np.zeros(len(recording), dtype=bool), recording.simulated.copy()
    covariates = {name: values.copy() for name, values in recording.covariates.items()}
    for span in in_one_piece(recording.time, episode_spans(recording.episode)):
        time = recording.time[span]
        then = time - shift
        kept[span] = (then >= time[0]) & (then <= time[-1])
        for values in (simulated, *covariates.values()):
            flat = values[span].reshape(len(time), -1)
            moved = np.stack([np.interp(then, time, column) for column in flat.T], axis=1)
            values[span] = moved.reshape(values[span].shape)
    metadata = {**recording.metadata, "clocks_aligned_by": shift}
    return replace(recording, simulated=simulated, covariates=covariates, metadata=metadata)[kept]


def _activity(values: FloatArray, step: int) -> FloatArray:
    """Root of the summed squared differences between adjacent means of `step` frames, clipped at a quantile."""
    sums = np.cumsum(np.pad(values.reshape(len(values), -1), ((1, 0), (0, 0))), axis=0)
    means = (sums[step:] - sums[:-step]) / step
    activity = np.linalg.norm(means[step:] - means[:-step], axis=1)
    return np.minimum(activity, np.quantile(activity, CLIP_QUANTILE))


def _correlation(pairs: list[tuple[FloatArray, ...]], most: int) -> tuple[NDArray[np.intp], FloatArray]:
    """Shifts in samples, and the pooled correlation of all pairs at each shift."""
    longest = max(len(one) for one, _ in pairs)
    most = min(most, int((1 - STREAMS.overlap) * longest))
    shifts = np.arange(-most, most + 1)
    sums = np.zeros((3, len(shifts)))  # products and both squares, summed over the overlap
    for measured, simulated in pairs:
        count = len(measured)
        measured, simulated, ones = measured - measured.mean(), simulated - simulated.mean(), np.ones(count)
        terms = ((measured, simulated), (measured**2, ones), (ones, simulated**2))
        size = 2 * count
        for row, (one, other) in enumerate(terms):
            product = np.fft.irfft(np.fft.rfft(one, size) * np.conj(np.fft.rfft(other, size)), size)
            inside = np.abs(shifts) < count
            sums[row, inside] += product[shifts[inside]]
    return shifts, sums[0] / np.sqrt(np.maximum(sums[1] * sums[2], 1e-12 * max(float(sums[1:].max()) ** 2, 1e-300)))


def _peak(shifts: NDArray[np.intp], alike: FloatArray, best: int) -> float:
    """The shift at the vertex of a parabola through the best shift and its neighbours."""
    if not 0 < best < len(alike) - 1:
        return float(shifts[best])
    before, top, after = alike[best - 1 : best + 2]
    bend = before - 2 * top + after
    return float(shifts[best] + (0.5 * (before - after) / bend if bend < 0 else 0.0))


def _other_order(pairs: list[tuple[FloatArray, ...]], numbers: list[int], shift: int) -> str:
    """Message with the worst mismatch if most measured episodes fit another simulated episode better; else empty."""
    pairs = [(m[max(shift, 0) :], s[max(-shift, 0) :]) for m, s in pairs]
    count = len(pairs)
    if count < 3:
        return ""
    distance = np.empty((count, count))
    scale = np.sqrt(sum(float(m @ m) for m, _ in pairs) / max(sum(float(s @ s) for _, s in pairs), 1e-300))
    for i, (measured, _) in enumerate(pairs):
        for j, (_, simulated) in enumerate(pairs):
            length = min(len(measured), len(simulated))
            distance[i, j] = np.mean((measured[:length] - scale * simulated[:length]) ** 2)
    own = np.diag(distance)
    fits = np.argmin(distance, axis=1)
    misplaced = distance.min(axis=1) < STREAMS.misplaced * own
    if misplaced.mean() <= 0.5 or len(np.unique(fits[misplaced])) < 2:
        return ""
    worst = int(np.argmax(misplaced * (own - distance.min(axis=1))))
    return (
        "the measured and simulated episodes are not in the same order: measured episode "
        f"{numbers[worst]} fits simulated episode {numbers[fits[worst]]} best"
    )
