"""Old public names: they work for one release and warn."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any


def with_old_names(package: str, get: Callable[[str], Any], new_names: Mapping[str, str]) -> Callable[[str], Any]:
    """Extend a package's ``__getattr__`` (PEP 562) by names that it had before.

    Args:
        package: The package's ``__name__``.
        get: Its ``__getattr__``.
        new_names: Each old name with the new one.
    """

    def get_old(name: str) -> Any:
        if name not in new_names:
            return get(name)
        warn_renamed(f"{package}.{name}", f"{package}.{new_names[name]}")
        return get(new_names[name])

    return get_old


def warn_renamed(old: str, new: str) -> None:
    """Warn the caller's caller that `old` is now called `new`."""
    warnings.warn(
        f"{old} is now called {new}; the old name goes with the next release", DeprecationWarning, stacklevel=3
    )
