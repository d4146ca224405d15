"""select: pick episodes, pads, covariates and samples of a recording."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.logs.recording_arrays import RecordingArrays, episode_starts


def select(
    recording: RecordingArrays,
    episodes: Iterable[int] | None,
    pads: Iterable[str] | None,
    covariates: Iterable[str] | None,
    known: bool,
) -> RecordingArrays:
    """Select parts of a recording; see `paxisim.Recording.select`. Its fields must have been checked."""
    if covariates is not None:
        recording = _with_covariates(recording, _names(covariates))
    if pads is not None:
        recording = _with_pads(recording, _names(pads))
    if episodes is not None:
        recording = take(recording, _in_episodes(recording, list(episodes)))
    return _known(recording) if known else recording


def _names(given: str | Iterable[str]) -> tuple[str, ...]:
    return (given,) if isinstance(given, str) else tuple(given)


def take(recording: RecordingArrays, samples: slice | NDArray[Any]) -> RecordingArrays:
    """Return the given samples of every stream; a slice does not copy."""
    return replace(
        recording,
        time=recording.time[samples],
        measured=None if recording.measured is None else recording.measured[samples],
        simulated=None if recording.simulated is None else recording.simulated[samples],
        covariates={name: values[samples] for name, values in recording.covariates.items()},
        episode=None if recording.episode is None else recording.episode[samples],
    )


def _with_covariates(recording: RecordingArrays, names: tuple[str, ...]) -> RecordingArrays:
    for name in names:
        if name not in recording.covariates:
            raise UnknownNameError("covariate", name, recording.covariates)
    return replace(recording, covariates={name: recording.covariates[name] for name in names})


def _with_pads(recording: RecordingArrays, names: tuple[str, ...]) -> RecordingArrays:
    if not names or len(set(names)) < len(names):
        raise InvalidValueError(f"pads must name different pads, at least one, got {list(names)}")
    for name in names:
        if name not in recording.pads:
            raise UnknownNameError("pad", name, recording.pads)
    index = [recording.pads.index(name) for name in names]
    covariates = dict(recording.covariates)
    resultant = covariates.get("resultant")
    if resultant is not None and resultant.shape[1:] == (len(recording.pads), 3):
        covariates["resultant"] = resultant[:, index]
    return replace(
        recording,
        measured=None if recording.measured is None else recording.measured[:, index],
        simulated=None if recording.simulated is None else recording.simulated[:, index],
        covariates=covariates,
        pads=names,
    )


def _in_episodes(recording: RecordingArrays, wanted: list[int]) -> NDArray[np.bool_]:
    assert recording.episode is not None
    numbers = recording.episode[episode_starts(recording.episode)]
    missing = [number for number in wanted if number not in numbers]
    if missing or not wanted:
        what = f"there is no episode {missing[0]} in the recording" if missing else "episodes must name at least one"
        raise InvalidValueError(f"{what}; its episodes are {', '.join(str(number) for number in numbers)}")
    return np.isin(recording.episode, np.asarray(wanted, dtype=np.int64))


def known_samples(recording: RecordingArrays) -> NDArray[np.bool_]:
    """Return a mask ``(T,)`` of the samples at which no tensor and no covariate has a NaN."""
    known = np.ones(len(recording.time), dtype=bool)
    for array in (recording.measured, recording.simulated, *recording.covariates.values()):
        if array is not None:
            # the sum of a sample is NaN if any value is; summing avoids a mask of the array's full size
            known &= ~np.isnan(array.reshape(len(array), -1).sum(axis=1))
    return known


def _known(recording: RecordingArrays) -> RecordingArrays:
    known = known_samples(recording)
    if not known.any():
        raise InvalidValueError("no sample is left: there is none at which all streams are known")
    return recording if known.all() else take(recording, known)
