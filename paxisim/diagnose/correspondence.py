"""Correspondence: whether both streams are of the same motion, and how far apart their clocks are.

Both streams are compared by their activity: the root of the summed squares by which all channels change. Swapped
taxels, axes or pads, signs, gains, offsets and drift leave it much as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from paxisim.diagnose.noise import FloatArray
from paxisim.diagnose.pieces import in_one_piece
from paxisim.logs.recording_arrays import episode_spans
from paxisim.recording import Recording

LONGEST = 15.0  # s, by which clocks may be apart
OVERLAP = 0.5  # share of a stretch that both streams must still have in common
SENSOR = 0.5  # s, within which a delay may be the sensor's own
ALIKE = 0.25  # correlation of the activities, below which streams are not of one motion
DOUBTFUL = 0.5  # the same, below which they are not if clocks are apart, or forces less alike than `FORCES`
FORCES = 0.25  # share of the forces' variance that both have in common
HALVED = 0.5  # of what is not correlated, that a shift of the clocks must leave at most
USUAL = 0.97  # quantile of the activity, to which what is above it is cut: a few wild frames say nothing
CHANGE = 0.2  # s, over which changes are taken, and means before
LEAST = 10  # samples of a stretch
FINEST = 0.02  # s between samples of the activity
MISPLACED = 0.7  # of the distance to its own episode, that another must have to fit better


@dataclass(frozen=True)
class Correspondence:
    """How two streams go together.

    Attributes:
        shift: Seconds by which the measured stream lags behind the simulated one, where they are most alike.
        alike: Correlation of the activities there.
        at_once: The same within `SENSOR` seconds of no shift.
        why: Why they are not of one motion; empty if they may be.
    """

    shift: float
    alike: float
    at_once: float
    why: str

    @property
    def clocks_apart(self) -> bool:
        """Whether the clocks are apart by more than a sensor can be late."""
        return not self.why and abs(self.shift) > SENSOR and 1 - self.alike < HALVED * (1 - self.at_once)


UNKNOWN = Correspondence(0.0, 1.0, 1.0, "")
"""Of recordings without contact, and of those too short to tell."""


def correspondence_of(recording: Recording, replayed: bool = False) -> Correspondence:
    """How the measured stream goes with the simulated one.

    Args:
        recording: With both streams.
        replayed: Whether the simulation follows motions that were recorded with the measured stream, so that its
            episodes are in their order.
    """
    assert recording.measured is not None
    assert recording.simulated is not None
    if not recording.simulated.any():
        return UNKNOWN
    spans = in_one_piece(recording.time, episode_spans(recording.episode))
    interval = max(float(np.median(np.diff(recording.time[spans[0]]))), FINEST)
    pairs = []
    for span in spans:
        time = recording.time[span]
        step = max(1, round(CHANGE / max(float(np.median(np.diff(time))), 1e-9)))
        time = time[step : len(time) + 1 - step]  # in the middle of each change
        grid = np.arange(time[0], time[-1], interval) if len(time) else time
        if len(grid) > LEAST:
            both = (_activity(s[span].astype(np.float64), step) for s in (recording.measured, recording.simulated))
            pairs.append(tuple(np.interp(grid, time, activity) for activity in both))
    if not pairs:
        return UNKNOWN
    shifts, alike = _correlation(pairs, int(LONGEST / interval))
    best = int(np.argmax(alike))
    near = np.abs(shifts) * interval <= SENSOR
    shift = _peak(shifts, alike, best) * interval
    doubtful = alike[best] < DOUBTFUL  # among many shifts one fits by chance
    if alike[best] < ALIKE or (doubtful and (abs(shift) > SENSOR or _alike(_shifted(recording, shift)) < FORCES)):
        why = (
            f"measured does not follow simulated at any shift of the clocks up to {shifts[-1] * interval:.2g} s (the "
            f"correlation of their activities is at most {alike[best]:.2f})"
        )
    else:
        why = "" if replayed else _other_order(pairs, int(shifts[best]))
    return Correspondence(shift, float(alike[best]), float(alike[near].max()), why)


def aligned(recording: Recording, shift: float) -> Recording:
    """The recording with the simulated stream and the covariates as they were about `shift` seconds before.

    The shift is refined so that the forces of all channels are most alike.
    """
    near = (shift - CHANGE, shift + CHANGE)
    best = minimize_scalar(lambda by: -_alike(_shifted(recording, by)), bounds=near, method="bounded")
    return _shifted(recording, float(best.x))


def _alike(recording: Recording) -> float:
    """Mean squared correlation of both streams over the channels, each weighed with its variance."""
    assert recording.measured is not None
    assert recording.simulated is not None
    both = (values.reshape(len(values), -1) for values in (recording.measured, recording.simulated))
    measured, simulated = (values - values.mean(axis=0, dtype=np.float64) for values in both)
    product, variance = np.sum(measured * simulated, axis=0), np.sum(simulated**2, axis=0)
    return float(np.sum(product**2 / np.maximum(variance, 1e-12)) / max(float(np.sum(measured**2)), 1e-300))


def _shifted(recording: Recording, shift: float) -> Recording:
    """The recording with the simulated stream and the covariates as they were `shift` seconds before."""
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
    """Root of the summed squares by which means of `step` frames change from one to the next, for all that fit in."""
    sums = np.cumsum(np.pad(values.reshape(len(values), -1), ((1, 0), (0, 0))), axis=0)
    means = (sums[step:] - sums[:-step]) / step
    activity = np.linalg.norm(means[step:] - means[:-step], axis=1)
    return np.minimum(activity, np.quantile(activity, USUAL))


def _correlation(pairs: list[tuple[FloatArray, ...]], most: int) -> tuple[NDArray[np.intp], FloatArray]:
    """Shifts in samples, and the correlation of all pairs together at each."""
    longest = max(len(one) for one, _ in pairs)
    most = min(most, int((1 - OVERLAP) * longest))
    shifts = np.arange(-most, most + 1)
    sums = np.zeros((3, len(shifts)))  # of products, and of both squares, where the two overlap
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
    """The shift at the top of a parabola through the best and its neighbours."""
    if not 0 < best < len(alike) - 1:
        return float(shifts[best])
    before, top, after = alike[best - 1 : best + 2]
    bend = before - 2 * top + after
    return float(shifts[best] + (0.5 * (before - after) / bend if bend < 0 else 0.0))


def _other_order(pairs: list[tuple[FloatArray, ...]], shift: int) -> str:
    """Which simulated episode a measured one fits, if most fit another better than their own; else empty."""
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
    misplaced = distance.min(axis=1) < MISPLACED * own
    if misplaced.mean() <= 0.5 or len(np.unique(fits[misplaced])) < 2:
        return ""
    number = int(np.argmax(misplaced * (own - distance.min(axis=1))))
    return (
        f"measured and simulated episodes are not in the same order: measured episode {number + 1} fits simulated "
        f"episode {fits[number] + 1} best"
    )
