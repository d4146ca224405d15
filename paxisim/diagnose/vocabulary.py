"""Vocabulary: the causes that a diagnosis knows, ours and those that a user has added."""

from __future__ import annotations

from paxisim.diagnose.cause import Cause
from paxisim.diagnose.causes import CAUSES
from paxisim.errors import InvalidValueError, UnknownNameError

_ADDED: list[Cause] = []


def register_cause(cause: Cause) -> None:
    """Add a cause to those that are looked for from now on.

    Raises:
        InvalidValueError: There is a cause of that name already.
    """
    if cause.name in known_causes():
        raise InvalidValueError(f"there is a cause {cause.name!r} already; choose another name")
    _ADDED.append(cause)


def known_causes() -> tuple[str, ...]:
    """The names of all causes, in the order of the chain."""
    return tuple(item.name for item in _all())


def cause(name: str) -> Cause:
    """The cause of that name.

    Raises:
        UnknownNameError: There is none.
    """
    for item in _all():
        if item.name == name:
            return item
    raise UnknownNameError("cause", name, known_causes())


def _all() -> list[Cause]:
    return sorted((*CAUSES, *_ADDED), key=lambda item: item.order)
