"""renumbered: carry whatever the metadata key by episode to new episode numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any


def renumbered(metadata: Mapping[str, Any], episodes: Iterable[tuple[int, int]]) -> dict[str, Any]:
    """Return the metadata with every entry that is keyed by episode under the new numbers.

    These are ``tasks`` (text by number, from a LeRobotDataset) and, in ``replay``, ``closing`` and ``encoder_error``.
    Entries of episodes that are not listed are dropped.

    Args:
        metadata: Metadata of a recording.
        episodes: Old and new number of each episode; one that was split has several new numbers.
    """
    pairs = [(str(old), str(new)) for old, new in episodes]
    found = dict(metadata)
    _rekey(found, "tasks", pairs)
    if isinstance(found.get("replay"), Mapping):
        found["replay"] = replay = dict(found["replay"])
        _rekey(replay, "closing", pairs)
        error = replay.get("encoder_error")
        if isinstance(error, Mapping) and "episode" in error:
            new = next((int(new) for old, new in pairs if old == str(error["episode"])), None)
            replay["encoder_error"] = None if new is None else {**error, "episode": new}
    return found


def _rekey(entries: dict[str, Any], name: str, pairs: list[tuple[str, str]]) -> None:
    table = entries.get(name)
    if isinstance(table, Mapping):
        entries[name] = {new: table[old] for old, new in pairs if old in table}
