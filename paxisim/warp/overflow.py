"""check_overflow: an error where Warp had no room for contacts or constraint rows, which makes forces wrong."""

from __future__ import annotations

from typing import Any

import numpy as np

from paxisim.errors import UnsupportedError

# values of mujoco_warp.OverflowType, which 3.11 has but does not export
_NEFC, _NJMAX_NNZ, _BROADPHASE, _NARROWPHASE, _CCD = (1 << bit for bit in range(5))
_SIZES = {
    "njmax": _NEFC | _NJMAX_NNZ,
    "nconmax": _BROADPHASE | _NARROWPHASE | _CCD,
}
DROPS = sum(_SIZES.values())
"""Flags of overflows that drop contacts or constraint rows; others stop an iteration early or concern sensors."""


def check_overflow(d: Any) -> None:
    """Check that no world has run out of room since it was made or reset. This waits for the device.

    Args:
        d: The Warp data, from `put_worlds`.

    Raises:
        UnsupportedError: Contacts or constraint rows were dropped; the message has the size to raise.
    """
    rows, contacts = d.nefc.numpy(), int(max(d.nacon.numpy()[0], d.ncollision.numpy()[0]))
    flags = d.overflow.numpy()
    # flags are set at the end of a step, so after `forward` only the numbers tell
    over = {"njmax": rows > d.njmax, "nconmax": np.full(len(rows), contacts > d.naconmax)}
    wrong = {size: (flags & bits != 0) | over[size] for size, bits in _SIZES.items()}
    which = [size for size, worlds in wrong.items() if worlds.any()]
    if not which:
        return
    have = {"njmax": d.njmax, "nconmax": d.naconmax // d.nworld}
    now = {"njmax": int(rows.max()), "nconmax": -(-contacts // d.nworld)}
    count = int(np.sum(wrong["njmax"] | wrong["nconmax"]))
    sizes = " and ".join(f"{size} (now {have[size]}; the last step needed {now[size]})" for size in which)
    raise UnsupportedError(
        f"MuJoCo Warp had no room for all contacts, so forces are wrong in {count} of {d.nworld} "
        f"worlds: call put_worlds with a larger {sizes}, or in mjlab set it in SimulationCfg"
    )
