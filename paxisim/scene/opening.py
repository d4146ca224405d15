"""Opening: which recorded stream is the opening of a gripper, the distance between its pads, and what it moves."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.scene import units
from paxisim.scene.drive import Drive
from paxisim.scene.named import NOT_MOTION, Streams, several
from paxisim.scene.streams import limits_of
from paxisim.scene.tactile_hand import TactileHand

_OPENING = re.compile(r"opening|width|aperture|gripper", re.IGNORECASE)
_LEAST_OPENING = 0.1  # share of the largest opening; a stream in mm that stays below it may be a share


def openings(streams: Streams) -> list[str]:
    """Return the names of streams that may be the opening of a gripper."""
    return [n for n, v in streams.items() if v.ndim == 1 and _OPENING.search(n) and not NOT_MOTION.search(n)]


def opening_drives(
    model: mujoco.MjModel, hands: Sequence[TactileHand], streams: Streams, drives: Sequence[Drive]
) -> tuple[list[Drive], list[str]]:
    """Return the drives of a stream that is a gripper's opening, and what is in doubt.

    Args:
        model: The compiled model.
        hands: Its hands.
        streams: The streams that may be an opening.
        drives: The drives that are known; what moves a hand already needs no opening.
    """
    driven = {drive.joint for drive in drives}
    still = [hand for hand in hands if len(hand.pads) == 2 and not driven & set(hand.joints)]
    if not streams or not still:
        return [], []
    if len(still) > 1:
        what = f"{several('stream', list(streams))} could be the opening of {len(still)} hands, so none moves"
        return [], [f"{what}: write the drives by hand"]
    moved = still[0].drives(next(iter(streams)))
    if not moved:
        return [], [
            f"{several('stream', list(streams))} cannot be the opening of the hand: the distance between the pads does "
            f"not grow steadily with the joints that move them ({', '.join(still[0].joints)}); write the drive by hand"
        ]
    ends = sorted(((np.array(limits_of(model, moved[0])) - moved[0].offset) / moved[0].scale).tolist())
    unit_of = {name: unit for name, values in streams.items() if (unit := _unit(values, (ends[0], ends[1])))}
    if len(unit_of) > 1:
        what = f"{several('stream', list(unit_of))} could each be the opening of a hand, so none is"
        return [], [f"{what}: choose one with --opening"]
    if not unit_of:
        name, values = next(iter(streams.items()))
        return [], [
            f"stream {name!r} moves nothing: it goes from {np.nanmin(values):.4g} to {np.nanmax(values):.4g}, and the "
            f"distance between the pads from {1e3 * ends[0]:.4g} to {1e3 * ends[1]:.4g} mm; it may be a share, a count "
            "or an angle; write its drive by hand"
        ]
    ((name, unit),) = unit_of.items()
    joints = " and ".join(repr(drive.joint) for drive in moved)
    how = "along a curve from the model's kinematics" if moved[0].curve else "by half of it each"
    said = f"stream {name!r} is taken to be the distance between the pads; it moves {joints} {how}"
    return [replace(drive, stream=name, unit=unit) for drive in moved], [said]


def _unit(values: NDArray[np.float64], ends: tuple[float, float]) -> str:
    """Return the unit in which a stream that moves is within the ends (m) of an opening; empty if there is none."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    fits = (
        unit
        for unit, factor in units.LENGTH.items()
        if units.is_within(factor * low, factor * high, ends)
        and (unit == "m" or factor * high > _LEAST_OPENING * ends[1])
    )
    return next(fits, "") if high > low else ""
