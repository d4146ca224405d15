"""Caveats: warnings about results that a reader should not rely on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.explain.explanation import Explanation
from paxisim.diagnose.result import Interval, LeftOver, pad_in_words

AXES = "xyz"
MAX_LISTED = 8  # channels listed


def caveats(
    found: Explanation, dropped: Mapping[str, Interval], pads: tuple[str, ...], replayed: bool
) -> tuple[str, ...]:
    """Return the warnings, one line each.

    Args:
        found: Explanation of the recording.
        dropped: Causes that were fitted but not named, see `Explained`.
        pads: Names of the pads.
        replayed: Whether the simulation followed the streams of a robot.
    """
    silent = found.off.raw.alive & ~found.off.judged.alive
    clocks = [f"{named.name}: {named.cause.of_replay}" for named in found.named if replayed and named.cause.of_replay]
    return (*silent_in_words(silent, pads), *at_bounds(found).values(), *_dropped(dropped), *clocks)


def silent_in_words(silent: NDArray[np.bool_], pads: tuple[str, ...]) -> tuple[str, ...]:
    """Return warnings about excluded channels.

    Args:
        silent: ``(pads, 3, rows, cols)`` whether a channel is excluded.
        pads: Names of the pads.
    """
    whole = silent.all(axis=(2, 3))
    warnings = []
    if whole.any():
        axes = [" and ".join(AXES[axis] for axis in np.flatnonzero(own)) for own in whole]
        names = ", ".join(f"{own} of {pad_in_words(pad)}" for own, pad in zip(axes, pads, strict=True) if own)
        warnings.append(
            f"{names} never change although the simulation does: either the sensor does not measure them, or they are "
            "not connected. They were excluded"
        )
    single = np.argwhere(silent & ~whole[:, :, None, None])
    if len(single):
        names = ", ".join(f"{AXES[k]} of {pad_in_words(pads[p])} ({r}, {c})" for p, k, r, c in single[:MAX_LISTED])
        more = f" and {len(single) - MAX_LISTED} more" if len(single) > MAX_LISTED else ""
        warnings.append(
            f"{names}{more} never change{'s' if len(single) == 1 else ''} under load although the other axes of the "
            "taxel respond. Such dead channels were excluded"
        )
    return tuple(warnings)


def at_bounds(found: Explanation) -> dict[str, str]:
    """Return warnings about parameters that the fit pushes against a bound, by cause."""
    lines = {}
    for named in found.fitted:
        for free in named.cause.parameters(found.problem):
            value = named.values.get(free.name)
            at = [bound for bound in (free.low, free.high) if bound != free.neutral and value == bound]
            if at and free.material is not None:
                lines[named.name] = (
                    f"{free.name} of {named.name} is at its bound, {at[0]:g} {free.unit}: do not rely on its value"
                )
    return lines


def _dropped(dropped: Mapping[str, Interval]) -> tuple[str, ...]:
    """Return warnings about causes that may explain nothing."""
    return tuple(
        f"{name} was fitted but not named: it reduces the error of the held-out episodes that it affects by "
        f"{share.percent()}, which may be no improvement at all"
        for name, share in dropped.items()
    )


def near_misses(shares: Mapping[str, float], least: float) -> dict[str, LeftOver]:
    """Return causes that fall a little short of being named.

    Args:
        shares: Gain of each cause, as a share of the gain required to name it.
        least: Smallest share at which a cause is mentioned.
    """
    return {
        name: LeftOver(
            f"{name} is a near miss: it reaches {min(share, 1):.0%} of the gain required to name it", share, least
        )
        for name, share in shares.items()
        if share > least
    }
