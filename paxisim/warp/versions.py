"""Versions of mujoco and mujoco-warp: they go together if their first two numbers are the same."""

from __future__ import annotations

from paxisim.errors import UnsupportedError


def check_versions(mujoco: str, mujoco_warp: str) -> None:
    """Check that two versions go together, as ``"4.0.1"`` and ``"4.0.0"`` do.

    Args:
        mujoco: Version of mujoco.
        mujoco_warp: Version of mujoco-warp.

    Raises:
        UnsupportedError: They do not; the message has the version to install.
    """
    wanted, found = (version.split(".")[:2] for version in (mujoco_warp, mujoco))
    if wanted != found:
        same = ".".join(wanted)
        raise UnsupportedError(
            f"mujoco-warp {mujoco_warp} goes with mujoco {same}, but mujoco {mujoco} is installed: "
            f"pip install 'mujoco=={same}.*', or the mujoco-warp of the other"
        )
