"""Units that the streams of a robot come in, and which unit a stream is in when the one that was said does not fit."""

from __future__ import annotations

import math

from paxisim.errors import UnknownNameError

LENGTH = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
ANGLE = {"rad": 1.0, "deg": math.pi / 180}
FORCE = {"N": 1.0, "mN": 1e-3, "Nm": 1.0, "mNm": 1e-3}
CURRENT = {"A": 1.0, "mA": 1e-3}
UNITS = {**LENGTH, **ANGLE, **FORCE, **CURRENT, "1": 1.0}
"""What one of a unit is in SI units; ``"1"`` is a number without a unit, such as a normalised command."""

_SLACK = 0.05  # of a range: limits are soft, in MuJoCo too, and encoders are not exact


def factor(unit: str) -> float:
    """What one `unit` is in SI units.

    Raises:
        UnknownNameError: There is no such unit.
    """
    if unit not in UNITS:
        raise UnknownNameError("unit", unit, UNITS)
    return UNITS[unit]


def is_within(low: float, high: float, limits: tuple[float, float], slack: float = 0.0) -> bool:
    """Whether numbers from `low` to `high` lie within the limits, but for `slack` and 5 % of their width."""
    slack += _SLACK * (limits[1] - limits[0])
    return limits[0] - slack <= low and high <= limits[1] + slack


def better_unit(unit: str, low: float, high: float, limits: tuple[float, float], scale: float, offset: float) -> str:
    """The unit with which a stream fits the limits of what it moves, where `unit` is far off; else empty.

    A stream is far off if it leaves the limits, or if it moves a small part of them and a unit a hundred times as large
    or more fits as well: 0.04 mm of a joint's 40 mm, where the values read as m are 40 mm.

    Args:
        unit: The unit that was said.
        low: The lowest value of the stream, in that unit.
        high: The highest.
        limits: Of what the stream moves, in SI units.
        scale: The drive's factor.
        offset: The drive's offset, in SI units.
    """
    family = next((f for f in (LENGTH, ANGLE, FORCE, CURRENT) if unit in f), {})
    outside = not is_within(*_moved(low, high, UNITS[unit] * scale, offset), limits)
    for other, one in family.items():
        ratio = one / UNITS[unit]
        if not (ratio < 0.5 if outside else ratio > 100):
            continue
        moved = _moved(low, high, one * scale, offset)
        # a stream that hardly moves fits whatever the unit is
        if is_within(*moved, limits) and moved[1] - moved[0] > 0.01 * (limits[1] - limits[0]):
            return other
    return ""


def _moved(low: float, high: float, gain: float, offset: float) -> tuple[float, float]:
    ends = sorted((gain * low + offset, gain * high + offset))
    return ends[0], ends[1]
