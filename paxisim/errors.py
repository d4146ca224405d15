"""The errors paxisim raises: each says what was expected, what came, and what to do about it.

Every one inherits `PaxisimError` and the builtin that fits, so `except ValueError` works as well.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class PaxisimError(Exception):
    """Base of every error that paxisim raises on purpose."""


class InvalidValueError(PaxisimError, ValueError):
    """A value, shape or file that cannot be used as given."""


class UnknownNameError(PaxisimError, LookupError):
    """A name that is not among the known ones; the message offers the near matches."""

    def __init__(self, kind: str, name: str, known: Iterable[str], advice: str = "") -> None:
        """Build the message.

        Args:
            kind: What the name should have named, e.g. ``"sensor"``.
            name: The name that came.
            known: The names there are.
            advice: What else to do about it.
        """
        known = sorted(known)
        in_lower_case = {n.lower(): n for n in known}
        near = [in_lower_case[n] for n in difflib.get_close_matches(name.lower(), in_lower_case, n=3, cutoff=0.4)]
        if near:
            hint = "did you mean " + " or ".join(repr(n) for n in near) + "?"
        elif known:
            hint = "known: " + ", ".join(known)
        else:
            hint = "there is none"
        super().__init__(f"unknown {kind} {name!r}; {hint}" + (f"; {advice}" if advice else ""))
        self._made_of = (kind, name, known, advice)

    def advised(self, advice: str) -> UnknownNameError:
        """The same error, with something else to do about it."""
        kind, name, known, _ = self._made_of
        return UnknownNameError(kind, name, known, advice)

    def __reduce__(self) -> tuple[type[UnknownNameError], tuple[str, str, list[str], str]]:
        """For copies and pickles, such as a pool of processes makes, which know only the message."""
        return type(self), self._made_of


class MissingExtraError(PaxisimError, ImportError):
    """An optional dependency is not installed; the message names the extra to install."""

    def __init__(self, module: str, extra: str, purpose: str) -> None:
        """Build the message.

        Args:
            module: The module that could not be imported.
            extra: The extra of paxisim that brings it.
            purpose: What needs it, e.g. ``"plot_tactile"``.
        """
        super().__init__(f"{purpose} needs {module}, which is not installed: pip install 'paxisim[{extra}]'")
        self._made_of = (module, extra, purpose)

    def __reduce__(self) -> tuple[type[MissingExtraError], tuple[str, str, str]]:
        """For copies and pickles, such as a pool of processes makes, which know only the message."""
        return type(self), self._made_of


class OutputExistsError(PaxisimError, FileExistsError):
    """An output file exists already and overwriting was not asked for."""


class UnsupportedError(PaxisimError, RuntimeError):
    """The request is sound but cannot be met here: a version, a geometry or a missing display."""


class DeviceError(PaxisimError, OSError):
    """A sensor, or the line to it, does not do what it should."""


class DeviceTimeoutError(DeviceError, TimeoutError):
    """No answer, or no frame, within the time allowed."""


class PortNotFoundError(DeviceError, FileNotFoundError):
    """There is no such port, or it went away."""


class PortAccessError(DeviceError, PermissionError):
    """The port is there but may not be opened: no permission, or another program has it."""


class ProtocolError(DeviceError):
    """Bytes arrive, but they are not what this profile's board sends."""
