"""MuJoCo Warp, Warp and torch, imported once, with one error if they are missing or do not go together."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import Any

import mujoco

from paxisim.errors import MissingExtraError, UnsupportedError
from paxisim.warp.versions import check_versions

try:
    # before the import, which fails on the wrong mujoco with an error that does not say so
    check_versions(mujoco.__version__, version("mujoco-warp"))
    # not import statements, which a type checker looks for in this package of the same name
    mujoco_warp: Any = import_module("mujoco_warp")
    torch: Any = import_module("torch")
    warp: Any = import_module("warp")
except ImportError as error:  # also importlib's PackageNotFoundError
    raise MissingExtraError(error.name or "mujoco_warp", "warp", "paxisim.warp") from error


def device_of(name: str | None) -> Any:
    """Return Warp's device of a name.

    Args:
        name: E.g. ``"cuda:0"`` or ``"cpu"``; None for Warp's current device.

    Raises:
        UnsupportedError: This machine has no such device.
    """
    try:
        return warp.get_device(name)
    except (ValueError, RuntimeError) as error:
        known = ", ".join(device.alias for device in warp.get_devices())
        raise UnsupportedError(
            f"there is no device {name!r} here, only {known}: a GPU needs NVIDIA's driver; without one, pass 'cpu'"
        ) from error
