"""Rivals: causes that explain the recording as well as one that was named.

Each candidate is fitted in place of the named cause. It is a rival if its held-out error is hardly larger than that of
the named cause, that is, if the difference between the two would itself be too small to be named.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from paxisim.diagnose.causes.kinds import BaselineCause
from paxisim.diagnose.data.problem import PRESSED_SHARE, FloatArray, Problem
from paxisim.diagnose.explain.explanation import Explanation
from paxisim.diagnose.search import rivals_in_place

NEARLY_ALL = 0.9  # share of the sum of squares of an offset


def rivals_of(found: Explanation) -> Mapping[str, tuple[str, ...]]:
    """Rivals of each named cause, best first."""
    rivals: dict[str, tuple[str, ...]] = {named.name: () for named in found.named}
    for named in found.fitted:
        if not named.cause.nuisance:
            rivals[named.name] = rivals_in_place(found.scorer, found.chosen, named.name)
            continue
        amounts = np.asarray(next(iter(named.values.values())))
        rival = named.cause.unpressed_rival if isinstance(named.cause, BaselineCause) else ""
        if rival in {item.name for item in found.off.causes} and _on_unpressed(found.problem, amounts):
            rivals[named.name] = (rival,)
    return rivals


def _on_unpressed(problem: Problem, offset: FloatArray) -> bool:
    """Whether nearly all of an offset is on taxels that are never pressed, which may equally well be stuck."""
    pressed = np.abs(problem.simulated).max(axis=(0, 2)) >= PRESSED_SHARE * problem.peak
    square = np.sum(offset**2, axis=1)
    return bool(pressed.any() and square[~pressed].sum() > NEARLY_ALL * square.sum())
