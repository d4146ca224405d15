"""Software versions that a result depends on."""

from __future__ import annotations

import platform
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version

import paxisim

PACKAGES = ("mujoco", "robosuite", "stable-baselines3", "torch", "gymnasium", "numpy", "mujoco-warp", "warp-lang")


def versions() -> dict[str, str]:
    """Return the software versions that a result depends on, of the packages that are installed."""
    found: dict[str, str] = {}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return {"paxisim": paxisim.__version__, "python": platform.python_version(), **found}


def differing(made_with: dict[str, str]) -> dict[str, str]:
    """Return the versions of `made_with` that differ from those here; 2.13.0+cpu and 2.13.0 are the same version."""
    here = versions()
    return {n: made for n, made in made_with.items() if plain(here.get(n, "")) != plain(made)}


def plain(version: str) -> str:
    """Return a version without its build, such as +cpu."""
    return version.split("+")[0]
