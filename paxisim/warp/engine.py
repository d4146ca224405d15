"""MuJoCo Warp, Warp and torch, imported once, with one error if they are missing or do not go together."""

# pyright: reportMissingImports=false
from importlib.metadata import version

import mujoco

from paxisim.errors import MissingExtraError
from paxisim.warp.versions import check_versions

try:
    # before the import, which fails on the wrong mujoco with an error that does not say so
    check_versions(mujoco.__version__, version("mujoco-warp"))
    import mujoco_warp as mujoco_warp
    import torch as torch
    import warp as warp
except ImportError as error:  # importlib's PackageNotFoundError is one, too
    raise MissingExtraError(error.name or "mujoco_warp", "warp", "paxisim.warp") from error
