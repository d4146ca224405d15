"""Prepare: validate a recording, clean it and split it into episodes."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256

import numpy as np

from paxisim.diagnose.data.pieces import FloatArray
from paxisim.diagnose.rules import STREAMS
from paxisim.errors import InvalidValueError
from paxisim.logs.memory import peak_of
from paxisim.logs.recording_arrays import episode_spans, episode_starts
from paxisim.logs.stopped import stopped_in_words
from paxisim.presses import find_presses
from paxisim.recording import Recording
from paxisim.scene.modes import start_streams

MAX_VALUES = 4_000_000  # most values that are compared
SENSOR_OUTPUTS = ("resultant",)  # covariates that the sensor itself reports, so that they explain nothing of it
_LONGEST = 0.04  # s, longest frame interval after decimation
_LEAST_EPISODES = 12  # fewest episodes that are kept


def prepare(recording: Recording) -> tuple[Recording, tuple[str, ...]]:
    """The recording without missing samples, split into episodes if it has only one, and warnings.

    Raises:
        InvalidValueError: The recording cannot be diagnosed; the message states why and what to do.
    """
    if not isinstance(recording, Recording):
        raise InvalidValueError(f"recording must be a paxisim.Recording, got {type(recording).__name__}")
    if recording.unit != "N":
        loads = " ".join(name for name, values in recording.covariates.items() if values.ndim == 1) or "NAME"
        raise InvalidValueError(
            f"the channels are in {recording.unit}, but a diagnosis compares forces in newtons. Record a load cell "
            "beside the sensor and run: paxisim calibrate RECORDING --loads Fz=NAME -o calibrated.mcap, where NAME is "
            f"the covariate with its force (there are: {loads}); then diagnose calibrated.mcap. "
            "See docs/guides/calibrate.md"
        )
    for name, other in (
        ("simulated", "replay the recorded motion in the simulation"),
        ("measured", "record the sensor"),
    ):
        if getattr(recording, name) is None:
            raise InvalidValueError(
                f"a diagnosis compares two streams, but the recording has no {name} tensor: {other}"
            )
    warnings: list[str] = []
    recording = _without_copies(_known(recording, warnings), warnings)
    seconds, frames = recording.duration, len(recording)
    if seconds < STREAMS.seconds or frames < STREAMS.frames:
        raise InvalidValueError(
            f"the recording is too short to be diagnosed: it has {seconds:.2g} s and {frames} samples; at least "
            f"{STREAMS.seconds:g} s and {STREAMS.frames} samples are needed"
        )
    still = [np.median(np.diff(recording.time[span])) == 0 for span in episode_spans(recording.episode)]
    if any(still):
        raise InvalidValueError(
            f"in {sum(still)} of {len(still)} episodes most samples repeat the previous time stamp: give each sample "
            "its own time stamp"
        )
    if seconds < STREAMS.few_seconds:
        warnings.append(f"the recording has only {seconds:.1f} s: expect wide intervals and missed causes")
    cut = _cut(recording)
    pieces = len(np.unique(cut.episode))
    was_one = pieces > len(np.unique(recording.episode))
    cut = _shortened(cut, warnings)
    _check_signals(cut, warnings)
    count = len(np.unique(cut.episode))
    if was_one:
        warnings.append(f"the single episode was split into {pieces} where the pads are unloaded")
    elif count == 1:
        warnings.append(
            "the recording has one episode: nothing can be held out, the figures are in-sample, and no cause is certain"
        )
    elif count < 4:
        warnings.append(f"the recording has only {count} episodes: held-out figures rest on few replicates")
    return cut, tuple(warnings)


def _known(recording: Recording, warnings: list[str]) -> Recording:
    """The recording without samples at which a tensor is missing."""
    recording = _without_missing(recording, warnings)
    known = np.ones(len(recording), dtype=bool)
    for name in ("measured", "simulated"):
        finite = np.isfinite(getattr(recording, name)).all(axis=(1, 2, 3, 4))
        if not finite.any():
            raise InvalidValueError(
                f"{name} contains NaN at every sample: a channel is missing, or the stream is empty"
            )
        known &= finite
    if not known.any():
        raise InvalidValueError("measured and simulated do not overlap in time: no sample has both")
    starts = start_streams(recording)  # poses at the start of episodes, which nothing follows
    covariates = {}
    for name, values in recording.covariates.items():
        if name in starts or name.partition("[")[0] in SENSOR_OUTPUTS:
            continue
        finite = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
        if not finite[known].all():
            warnings.append(
                f"covariate {name!r} is missing at {np.mean(~finite[known]):.0%} of the samples and is ignored"
            )
        elif values.ndim > 1:  # one covariate per value, named as transforms refer to it
            columns = values.reshape(len(values), -1).T
            covariates |= {f"{name}[{number}]": column for number, column in enumerate(columns)}
        else:
            covariates[name] = values
    if known.mean() < 1:
        warnings.append(f"{np.mean(~known):.1%} of the samples contain NaN and were dropped")
    recording = replace(recording, covariates=covariates)
    interrupted = np.zeros(len(recording), dtype=bool)
    if not known.all():
        recording = recording[known]
        step = np.diff(recording.time, prepend=recording.time[0])
        usual = np.median(step[1:]) if len(step) > 1 else 0.0
        interrupted = step > STREAMS.gap * max(float(usual), 1e-9)
    changes = (np.diff(recording.episode, prepend=recording.episode[0]) != 0) | interrupted[: len(recording)]
    piece = np.cumsum(changes)
    numbers = recording.episode[episode_starts(piece)]
    first = np.unique(numbers, return_index=True)[1]
    later = np.setdiff1d(np.arange(len(numbers)), first)  # a part of an interrupted episode has no number of its own
    names = numbers.copy()
    names[later] = numbers.max() + 1 + np.arange(len(later))
    if len(later):
        at = recording.time[np.searchsorted(piece, later[0])]
        warnings.append(
            f"{len(later)} parts after a gap count as episodes of their own: episode {names[later[0]]} is the part of "
            f"episode {numbers[later[0]]} from {at:.2f} s"
        )
    enough = np.bincount(piece)[piece] >= 4
    if not enough.any():
        raise InvalidValueError("no episode has 4 samples with both streams")
    recording = replace(recording, episode=names[piece])
    return recording if enough.all() else recording[enough]


def _without_copies(recording: Recording, warnings: list[str]) -> Recording:
    """The recording without episodes that repeat an earlier one exactly, as files that were merged twice do.

    A copy is no second measurement: its difference to the original would show a sensor without noise.
    """
    assert recording.measured is not None
    assert recording.simulated is not None
    kept = np.ones(len(recording), dtype=bool)
    first: dict[bytes, int] = {}
    for span in episode_spans(recording.episode):
        measured, simulated = recording.measured[span], recording.simulated[span]
        if not np.ptp(measured, axis=0).any():  # nothing was read
            continue
        number = int(recording.episode[span.start])
        key = sha256(measured.tobytes() + simulated.tobytes()).digest()
        if key in first:
            kept[span] = False
            warnings.append(f"episode {number} is an exact copy of episode {first[key]} and was left out")
        first.setdefault(key, number)
    return recording if kept.all() else recording[kept]


def _without_missing(recording: Recording, warnings: list[str]) -> Recording:
    """The recording with 0 in measured channels that are always NaN; constant channels are excluded later."""
    assert recording.measured is not None
    missing = np.isnan(recording.measured).all(axis=0)
    if missing.all() or not missing.any():
        return recording
    warnings.append(f"{int(missing.sum())} of {missing.size} measured channels are always NaN and were set to 0")
    return replace(recording, measured=np.where(missing, 0, recording.measured))


def _check_signals(recording: Recording, warnings: list[str]) -> None:
    assert recording.measured is not None
    assert recording.simulated is not None
    y, x = recording.measured.astype(np.float64), recording.simulated.astype(np.float64)
    touches = bool(np.any(x))
    for name, values in (("measured", y), ("simulated", x)):
        if float(np.ptp(values, axis=0).max()) == 0 and (touches or name == "measured"):
            raise InvalidValueError(f"{name} is constant: every sample is the same")
        if not np.isfinite(np.square(values).sum()):
            raise InvalidValueError(f"{name} contains values too large to be forces")
    stopped, share = stopped_in_words(recording.time, recording.measured, recording.simulated)
    if share > STREAMS.stopped:
        raise InvalidValueError(f"{stopped}: leave these samples out, or record again")
    if stopped:
        warnings.append(f"{stopped}: leave these samples out")
    if not touches:
        warnings.append(
            "the simulation shows no contact: only what the sensor reads without force can be tested, which is offset, "
            "drift, interference and noise"
        )
        return
    if np.array_equal(x, y):
        warnings.append("measured and simulated are identical: is one a copy of the other?")
    y, x = y - y.mean(axis=0), x - x.mean(axis=0)
    product, own, other = _products(x, y)
    alike = product / max(np.sqrt(own * other), 1e-300)
    scale, slope = np.sqrt(other / own), abs(product) / own
    follows = abs(alike) > STREAMS.clearly
    if (follows and not 1 / STREAMS.gain <= slope <= STREAMS.gain) or scale > STREAMS.scale:
        ratio = slope if follows else scale
        raise InvalidValueError(
            f"measured is {ratio:.3g} times simulated: both must be in newtons. Convert millinewtons or counts by "
            "their factor, for example 0.1 N per count. If the channels are not forces but, say, fields in microtesla, "
            "record a load cell beside the sensor and run: paxisim calibrate RECORDING --loads Fz=NAME -o "
            "calibrated.mcap, where NAME is the covariate with its force. See docs/guides/calibrate.md"
        )
    peak, (least, most) = peak_of(recording.simulated), STREAMS.forces
    if not least <= peak <= most:
        raise InvalidValueError(
            f"simulated reaches {peak:.3g} N on a taxel, but {least:g} to {most:g} N were expected: both "
            "streams must be in newtons; are they in millinewtons or counts? Convert both to newtons"
        )
    if scale < 1 / STREAMS.gain and abs(alike) < STREAMS.follows:
        raise InvalidValueError(
            f"measured shows no signal: it changes {scale:.2g} times as much as simulated and does not follow it "
            f"(correlation {alike:.2f}); was the sensor connected and pressed, and is it the same motion?"
        )
    if not 1 / STREAMS.gain <= scale <= STREAMS.gain:
        warnings.append(f"measured changes {scale:.3g} times as much as simulated; are both in newtons?")
    if alike < STREAMS.follows:
        warnings.append(f"measured and simulated hardly correlate ({alike:.2f}): is it the same motion?")
    stuck = int(np.sum(np.ptp(recording.measured, axis=0) == 0))
    if stuck > 0.5 * recording.measured[0].size:
        warnings.append(f"{stuck} of {recording.measured[0].size} channels never change")


def _products(x: FloatArray, y: FloatArray) -> FloatArray:
    """``(3,)`` sums of x * y, x^2 and y^2 of both streams, without dead taxels if others follow the simulation."""
    product, own, other = (np.sum(values, axis=(0, 2)) for values in (x * y, x * x, y * y))
    alike = np.abs(product) / np.maximum(np.sqrt(own * other), 1e-300)
    dead = (other * STREAMS.gain**2 < own) & (alike < STREAMS.follows)
    counted = ~dead if np.any(alike > STREAMS.clearly) else np.ones_like(dead)
    return np.stack([product, own, other])[:, counted].sum(axis=1)


def _cut(recording: Recording) -> Recording:
    """The recording, split at the middle of its rests if it has a single episode."""
    assert recording.simulated is not None
    if len(np.unique(recording.episode)) > 1:
        return recording
    load = np.abs(recording.simulated).max(axis=(1, 2, 3, 4))
    return replace(recording, episode=find_presses(recording.time, load).episode)


def _shortened(recording: Recording, warnings: list[str]) -> Recording:
    """The recording reduced to a size that a diagnosis can hold: fewer frames per episode, then fewer episodes."""
    assert recording.measured is not None
    numbers = recording.measured.size
    if numbers <= MAX_VALUES:
        return recording
    first = episode_starts(recording.episode)
    number = np.cumsum(np.isin(np.arange(len(recording)), first)) - 1  # episode of each frame
    interval = float(np.median(np.diff(recording.time)))
    stride = max(1, min(int(np.ceil(numbers / MAX_VALUES)), int(_LONGEST / max(interval, 1e-9))))
    skip = max(1, min(int(np.ceil(numbers / MAX_VALUES / stride)), len(first) // _LEAST_EPISODES))
    kept = ((np.arange(len(recording)) - first[number]) % stride == 0) & (number % skip == 0)
    warnings.append(f"the recording is long: only one frame in {stride} of one episode in {skip} was used")
    return recording[kept]
