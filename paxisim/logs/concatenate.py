"""concatenate: join several recordings into one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.logs.recording_arrays import RecordingArrays, unit_of
from paxisim.logs.renumber import renumbered


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
    old = np.concatenate(episodes)
    is_unique = len(np.unique(old[begins])) == begins.sum()
    episode = old if is_unique else np.cumsum(begins) - 1
    metadata, begin = [], 0
    for part in parts:
        own = begin + np.flatnonzero(begins[begin : begin + len(part.time)])
        metadata.append(renumbered(part.metadata, zip(old[own].tolist(), episode[own].tolist(), strict=True)))
        begin += len(part.time)
        if "task" in part.metadata and any(other.metadata.get("task") != part.metadata["task"] for other in parts):
            metadata[-1].setdefault("tasks", dict.fromkeys(map(str, episode[own].tolist()), metadata[-1]["task"]))
    merged = _merged(metadata)
    merged.pop("start", None)
    starts = [start for part in parts if isinstance(start := part.metadata.get("start"), (int, float))]
    if len(starts) == len(parts):
        merged["start"] = starts[0]  # from which the times of all parts count
    else:
        starts = [0.0] * len(parts)
    return RecordingArrays(
        np.concatenate([part.time + (start - starts[0]) for part, start in zip(parts, starts, strict=True)]),
        None if first.measured is None else np.concatenate([p.measured for p in parts if p.measured is not None]),
        None if first.simulated is None else np.concatenate([p.simulated for p in parts if p.simulated is not None]),
        {name: np.concatenate([part.covariates[name] for part in parts]) for name in first.covariates},
        episode,
        first.layout,
        first.pads,
        merged,
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


def _merged(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the entries that all parts share; tables keyed by episode are joined, and the worst doubts are kept."""
    out = {name: value for name, value in parts[0].items() if all(_same(name, value, part) for part in parts[1:])}
    if any("tasks" in part for part in parts):
        out["tasks"] = _joined(parts, "tasks")
    replays = [replay for part in parts if isinstance(replay := part.get("replay"), Mapping)]
    if "replay" not in out and len(replays) == len(parts):
        shared = {name: value for name, value in replays[0].items() if all(_same(name, value, r) for r in replays[1:])}
        errors = [error for replay in replays if (error := replay.get("encoder_error"))]
        worst = max(errors, key=lambda error: error.get("newtons", 0) / (error.get("peak") or 1), default=None)
        lists = {name: [text for r in replays for text in r.get(name, ())] for name in ("notes", "doubts")}
        in_doubt = max(replay.get("in_doubt", 0.0) for replay in replays)
        out["replay"] = {**shared, **lists, "encoder_error": worst, "in_doubt": in_doubt}
        if any("closing" in replay for replay in replays):
            out["replay"]["closing"] = _joined(replays, "closing")
    return out


def _same(name: str, value: object, part: Mapping[str, Any]) -> bool:
    return name in part and part[name] == value


def _joined(parts: Sequence[Mapping[str, Any]], name: str) -> dict[str, Any]:
    return {key: value for part in parts for key, value in part.get(name, {}).items()}
