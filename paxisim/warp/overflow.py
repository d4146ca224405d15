"""check_overflow: an error where Warp had no room for contacts or constraint rows, which makes forces wrong."""

from __future__ import annotations

from typing import Any

from paxisim.errors import UnsupportedError
from paxisim.warp.engine import mujoco_warp

_SIZES = {"NEFC": "njmax", "NJMAX_NNZ": "njmax", "BROADPHASE": "nconmax", "NARROWPHASE": "nconmax", "CCD": "nconmax"}
"""Overflows that drop contacts or rows, by the size of `put_worlds` to raise."""
DROPS = 0
for _name in _SIZES:
    DROPS |= int(getattr(mujoco_warp.OverflowType, _name))


def check_overflow(d: Any) -> None:
    """Check that no world has run out of room since it was made or reset. This waits for the device.

    Args:
        d: The Warp data, from `put_worlds`.

    Raises:
        UnsupportedError: Contacts or constraint rows were dropped; the message has the size to raise.
    """
    rows, contacts = int(d.nefc.numpy().max()), int(max(d.nacon.numpy()[0], d.ncollision.numpy()[0]))
    flags = d.overflow.numpy()
    # flags are set at the end of a step, so after `forward` only the numbers tell
    bits = int((flags & DROPS).max())
    which = {size for name, size in _SIZES.items() if bits & int(getattr(mujoco_warp.OverflowType, name))}
    which |= {"njmax"} if rows > d.njmax else set()
    which |= {"nconmax"} if contacts > d.naconmax else set()
    if not which:
        return
    have = {"njmax": d.njmax, "nconmax": d.naconmax // d.nworld}
    now = {"njmax": rows, "nconmax": -(-contacts // d.nworld)}
    sizes = " and ".join(f"{size} (now {have[size]}; the last step needed {now[size]})" for size in sorted(which))
    raise UnsupportedError(
        f"MuJoCo Warp had no room for all contacts, so forces are wrong in {int(((flags & DROPS) != 0).sum())} of "
        f"{d.nworld} worlds: call put_worlds with a larger {sizes}"
    )
