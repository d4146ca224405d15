"""Errors raised by paxisim; each message says what was expected, what was given and what to do.

Each error derives from `PaxisimError` and from the matching builtin exception, so `except ValueError` also works.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

MOST_LISTED = 20
"""Known names that an error lists at most."""


class PaxisimError(Exception):
    """Base class of all errors that paxisim raises deliberately."""


class InvalidValueError(PaxisimError, ValueError):
    """A value, shape or file cannot be used as given."""


class UnknownNameError(PaxisimError, LookupError):
    """A name is not among the known ones; the message suggests close matches, or lists up to `MOST_LISTED` names."""

    def __init__(self, kind: str, name: str, known: Iterable[str], advice: str = "") -> None:
        """Build the message.

        Args:
            kind: Kind of object that the name refers to, e.g. ``"sensor"``.
            name: The unknown name.
            known: The known names.
            advice: Further advice for the user.
        """
        known = sorted(known)
        near = _near(name, known)
        if near:
            hint = "did you mean " + " or ".join(repr(n) for n in near) + "?"
        elif known:
            more = len(known) - MOST_LISTED
            hint = "known: " + ", ".join(known[:MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
        else:
            hint = "there is none"
        super().__init__(f"unknown {kind} {name!r}; {hint}" + (f"; {advice}" if advice else ""))
        self._made_of = (kind, name, known, advice)

    def advised(self, advice: str) -> UnknownNameError:
        """Return the same error with further advice."""
        kind, name, known, before = self._made_of
        return UnknownNameError(kind, name, known, f"{before}; {advice}" if before else advice)

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, str, list[str], str]]:
        """Copy and pickle by the arguments, because the default uses the message alone."""
        return type(self), self._made_of


def _near(name: str, known: list[str]) -> list[str]:
    """Return up to three known names that are spelled nearly like `name`, or that contain it."""
    in_lower_case = {n.lower(): n for n in known}
    spelled = difflib.get_close_matches(name.lower(), in_lower_case, n=3, cutoff=0.6)
    containing = [n for n in in_lower_case if len(name) > 2 and name.lower() in n]
    return [in_lower_case[n] for n in dict.fromkeys([*spelled, *containing])][:3]


class MissingExtraError(PaxisimError, ImportError):
    """An optional dependency is not installed; the message names the extra to install."""

    def __init__(self, module: str, extra: str, purpose: str) -> None:
        """Build the message.

        Args:
            module: Module that could not be imported.
            extra: Extra of paxisim that installs it.
            purpose: Name of the feature that needs it, e.g. ``"plot_tactile"``.
        """
        super().__init__(f"{purpose} needs {module}, which is not installed: pip install 'paxisim[{extra}]'")
        self._made_of = (module, extra, purpose)

    def __reduce__(self) -> tuple[type[MissingExtraError], tuple[str, str, str]]:
        """Copy and pickle by the arguments, because the default uses the message alone."""
        return type(self), self._made_of


class OutputExistsError(PaxisimError, FileExistsError):
    """An output file already exists and overwriting was not requested."""


class UnsupportedError(PaxisimError, RuntimeError):
    """A valid request cannot be met here, because of a version, a geometry or a missing display."""


class DeviceError(PaxisimError, OSError):
    """A sensor, or the connection to it, does not work as expected."""


class DeviceTimeoutError(DeviceError, TimeoutError):
    """No response or frame arrived within the timeout."""


class PortNotFoundError(DeviceError, FileNotFoundError):
    """The port does not exist or has disappeared."""


class PortAccessError(DeviceError, PermissionError):
    """The port exists but cannot be opened: permission is missing, or another program uses it."""


class ProtocolError(DeviceError):
    """Bytes arrive, but they do not match the protocol of this profile's board."""
