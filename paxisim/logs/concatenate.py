"""concatenate: join several recordings into one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.logs.recording_arrays import RecordingArrays, unit_of


def concatenate(parts: Sequence[RecordingArrays]) -> RecordingArrays:
    """Join recordings; see `paxisim.Recording.concatenate`. The fields of each part must have been checked."""
    first = parts[0]
    for i, part in enumerate(parts[1:], start=1):
        for what in ("layout", "pads"):
            if getattr(part, what) != getattr(first, what):
                raise InvalidValueError(
                    f"recordings with different {what} cannot be concatenated: the first has {getattr(first, what)}, "
                    f"number {i} (from 0) has {getattr(part, what)}"
                )
        for what in ("measured", "simulated"):
            if (getattr(part, what) is None) != (getattr(first, what) is None):
                without = i if getattr(part, what) is None else 0
                raise InvalidValueError(
                    f"either all concatenated recordings must have a {what} tensor, or none: number {without} (from "
                    "0) has none"
                )
        if unit_of(part.metadata) != unit_of(first.metadata):
            raise InvalidValueError(
                f"recordings with different units cannot be concatenated: the first is in {unit_of(first.metadata)}, "
                f"number {i} (from 0) in {unit_of(part.metadata)}"
            )
        _check_covariates(i, part, first)
    episodes = [part.episode for part in parts if part.episode is not None]
    begins = np.concatenate([np.diff(episode, prepend=episode[0] - 1) != 0 for episode in episodes])
    episode = np.concatenate(episodes)
    if len(np.unique(episode[begins])) < begins.sum():
        episode = np.cumsum(begins) - 1
    return RecordingArrays(
        np.concatenate([part.time for part in parts]),
        None if first.measured is None else np.concatenate([p.measured for p in parts if p.measured is not None]),
        None if first.simulated is None else np.concatenate([p.simulated for p in parts if p.simulated is not None]),
        {name: np.concatenate([part.covariates[name] for part in parts]) for name in first.covariates},
        episode,
        first.layout,
        first.pads,
        _metadata(parts),
    )


def _check_covariates(number: int, part: RecordingArrays, first: RecordingArrays) -> None:
    only = sorted(part.covariates.keys() ^ first.covariates.keys())
    if only:
        common = sorted(part.covariates.keys() & first.covariates.keys())
        raise InvalidValueError(
            f"concatenated recordings must have the same covariates, but the first and number {number} (from 0) do "
            f"not share {', '.join(only)}; keep the shared ones with select(covariates={common})"
        )
    for name, values in part.covariates.items():
        if values.shape[1:] != first.covariates[name].shape[1:]:
            raise InvalidValueError(
                f"covariate {name!r} has samples of shape {first.covariates[name].shape[1:]} in the first recording "
                f"and of {values.shape[1:]} in number {number} (from 0)"
            )


def _metadata(parts: Sequence[RecordingArrays]) -> dict[str, object]:
    """Return the entries that all recordings share, and the first one's start, from which its time counts."""
    first = parts[0].metadata
    return {
        name: value
        for name, value in first.items()
        if name == "start" or all(name in part.metadata and part.metadata[name] == value for part in parts[1:])
    }
