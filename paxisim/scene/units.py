"""Units of a robot's streams, and a guess of a stream's unit if the given one does not fit."""

from __future__ import annotations

import math

from paxisim.errors import UnknownNameError

LENGTH = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
ANGLE = {"rad": 1.0, "deg": math.pi / 180}
FORCE = {"N": 1.0, "mN": 1e-3, "Nm": 1.0, "mNm": 1e-3}
CURRENT = {"A": 1.0, "mA": 1e-3}
UNITS = {**LENGTH, **ANGLE, **FORCE, **CURRENT, "1": 1.0}
"""Conversion factors to SI units; ``"1"`` is a number without a unit, such as a normalised command."""

_SLACK = 0.05  # fraction of a range: limits are soft, also in MuJoCo, and encoders are not exact


def factor(unit: str) -> float:
    """Return the conversion factor of a unit to SI units.

    Raises:
        UnknownNameError: The unit does not exist.
    """
    if unit not in UNITS:
        raise UnknownNameError("unit", unit, UNITS)
    return UNITS[unit]


def is_within(low: float, high: float, limits: tuple[float, float], slack: float = 0.0) -> bool:
    """Return whether `low` to `high` lies within the limits, with a tolerance of `slack` plus 5 % of their width."""
    slack += _SLACK * (limits[1] - limits[0])
    return limits[0] - slack <= low and high <= limits[1] + slack


def better_unit(unit: str, low: float, high: float, limits: tuple[float, float], scale: float, offset: float) -> str:
    """Return the unit with which a stream fits the limits of its target if `unit` is implausible; otherwise empty.

    A unit is implausible if the stream exceeds the limits, or if it covers only a small part of them and a unit more
    than a hundred times as large fits as well. For example, a stream covers 0.04 mm of a joint's 40 mm, but 40 mm if
    its values are read as m.

    Args:
        unit: The given unit.
        low: Lowest value of the stream, in that unit.
        high: Highest value of the stream, in that unit.
        limits: Limits of the target, in SI units.
        scale: Scale factor of the drive.
        offset: Offset of the drive, in SI units.
    """
    family = next((f for f in (LENGTH, ANGLE, FORCE, CURRENT) if unit in f), {})
    outside = not is_within(*_moved(low, high, UNITS[unit] * scale, offset), limits)
    for other, one in family.items():
        ratio = one / UNITS[unit]
        if not (ratio < 0.5 if outside else ratio > 100):
            continue
        moved = _moved(low, high, one * scale, offset)
        # a stream that hardly moves would fit with any unit
        if is_within(*moved, limits) and moved[1] - moved[0] > 0.01 * (limits[1] - limits[0]):
            return other
    return ""


def _moved(low: float, high: float, gain: float, offset: float) -> tuple[float, float]:
    ends = sorted((gain * low + offset, gain * high + offset))
    return ends[0], ends[1]
