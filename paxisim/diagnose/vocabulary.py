"""Vocabulary: the causes that a diagnosis knows, both built-in and registered by a user."""

from __future__ import annotations

from paxisim.diagnose.cause import Cause
from paxisim.diagnose.causes import CAUSES
from paxisim.errors import InvalidValueError, UnknownNameError

_ADDED: list[Cause] = []


def register_cause(cause: Cause) -> None:
    """Add a cause to those that a diagnosis looks for.

    Raises:
        InvalidValueError: A cause of that name already exists.
    """
    if cause.name in known_causes():
        raise InvalidValueError(f"there is a cause {cause.name!r} already; choose another name")
    _ADDED.append(cause)


def known_causes() -> tuple[str, ...]:
    """Names of all causes, in chain order."""
    return tuple(item.name for item in _all())


def cause(name: str) -> Cause:
    """Return the cause of that name.

    Raises:
        UnknownNameError: There is no such cause.
    """
    for item in _all():
        if item.name == name:
            return item
    whole = next((item.name for item in _all() for part in item.parts if part.name.lower().startswith(name)), "")
    advice = f"it is a part of {whole}" if whole else "if it is your own, import its module first"
    raise UnknownNameError("cause", name, known_causes(), advice)


def _all() -> list[Cause]:
    return sorted((*CAUSES, *_ADDED), key=lambda item: item.order)
