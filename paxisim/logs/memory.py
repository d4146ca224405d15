"""Memory: over which episodes of a recording a sensor remembers what pressed it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

MAX_PAUSE = 15.0
"""Longest pause at rest (s) between two episodes over which the state of a sensor is followed."""
PRESSED_SHARE = 0.01
"""Force above which a taxel is pressed, relative to the peak force."""


def peak_of(simulated: NDArray[np.floating]) -> float:
    """Return the peak force (N) on the most loaded taxel, the 99.5 % quantile over time.

    Args:
        simulated: ``(T, pads, 3, rows, cols)`` newtons.
    """
    return float(np.quantile(np.abs(simulated).max(axis=(1, 2, 3, 4)), 0.995))


def at_rest(simulated: NDArray[np.floating], peak: float) -> NDArray[np.bool_]:
    """Return ``(T,)`` whether no taxel is pressed.

    Args:
        simulated: ``(T, pads, 3, rows, cols)`` newtons.
        peak: Peak force (N).
    """
    return np.abs(simulated).max(axis=(1, 2, 3, 4)) < PRESSED_SHARE * max(peak, 1e-9)


def in_one_piece(
    time: NDArray[np.float64], episodes: Sequence[slice], rest: NDArray[np.bool_] | None = None
) -> tuple[slice, ...]:
    """Return the episodes, merged where they follow one another without a break.

    Args:
        time: ``(T,)`` seconds.
        episodes: Samples of each episode.
        rest: ``(T,)`` whether no taxel is pressed. If given, episodes are also merged over a short pause at rest: a
            sensor remembers a press for longer.
    """
    breaks = np.diff(time, prepend=-np.inf)
    usual = 1.5 * float(np.median(breaks[1:])) if len(time) > 1 else 0.0
    follows = (breaks > 0) & (breaks <= usual)
    if rest is not None:
        follows |= (breaks > 0) & (breaks <= MAX_PAUSE) & rest & np.append(False, rest[:-1])
    starts = [span.start for span in episodes if not follows[span.start]]
    return tuple(slice(a, b) for a, b in itertools.pairwise([*starts, len(time)]))
