"""Rivals: causes that explain the recording as well as one that was named.

Each candidate is fitted in place of the named cause. It is a rival if its held-out error is hardly larger than that of
the named cause, that is, if the difference between the two would itself be too small to be named.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from paxisim.diagnose.explanation import Explanation
from paxisim.diagnose.problem import PRESSED_SHARE, FloatArray, Problem
from paxisim.diagnose.search import Search

NEARLY_ALL = 0.9  # share of the sum of squares of an offset


def rivals_of(found: Explanation) -> Mapping[str, tuple[str, ...]]:
    """Rivals of each named cause, best first."""
    rivals: dict[str, tuple[str, ...]] = {named.name: () for named in found.named}
    for named in found.fitted:
        if not named.cause.nuisance:
            rivals[named.name] = in_place(found.search, found.chosen, named.name)
            continue
        amounts = np.asarray(next(iter(named.values.values())))
        asked = {item.name for item in found.off.causes}
        if named.cause.unpressed_rival in asked and _on_unpressed(found.problem, amounts):
            rivals[named.name] = (named.cause.unpressed_rival,)
    return rivals


def in_place(search: Search, names: tuple[str, ...], name: str) -> tuple[str, ...]:
    """Causes whose held-out error in place of `name`, one of the causes `names`, is hardly larger, best first."""
    rules = search.rules
    fit, rest = search.fit(names), tuple(n for n in names if n != name)
    gain = float((search.without(names, name).heldout - fit.heldout).sum())
    near = {}
    for other in [other for _, other in search.ranked(rest)[: rules.contest + 1] if other != name]:
        own = search.fit((*rest, other), search.fit(rest))
        worse = float((own.heldout - fit.heldout).sum())
        told = search.causes[name].misfit * fit.effects.get(name, 0.0)
        told += search.causes[other].misfit * own.effects.get(other, 0.0)
        if worse < search.material + told + rules.tie * max(gain, 0.0) and search.evidence((*rest, other), other).kept:
            near[other] = worse
    return tuple(sorted(near, key=lambda n: near[n]))


def _on_unpressed(problem: Problem, offset: FloatArray) -> bool:
    """Whether nearly all of an offset is on taxels that are never pressed, which may equally well be stuck."""
    pressed = np.abs(problem.simulated).max(axis=(0, 2)) >= PRESSED_SHARE * problem.peak
    square = np.sum(offset**2, axis=1)
    return bool(pressed.any() and square[~pressed].sum() > NEARLY_ALL * square.sum())
