"""Rivals: what a recording cannot tell from a cause that was found.

Two ways of looking: a rival that was fitted in the cause's place and left hardly more, and one that was not, but whose
small effects together imitate what the cause does on this motion. With the second a poor motion shows itself, as all
that it could tell apart is in the sums.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from paxisim import augment
from paxisim.diagnose.cause import Cause, cause, known_causes
from paxisim.diagnose.engine import Explanation, Named
from paxisim.diagnose.problem import PRESSED, FloatArray, Problem
from paxisim.diagnose.tangent import tangent_of

MARGIN = 0.03  # of a cause's gain, by which a rival that was fitted may be worse
IMITATES = 0.18  # of a cause's effect that a rival may leave: no closer are the forms of the two known
UNSEEN = 0.01  # of what a more general cause does, that it may do beyond one that was found
CHANCE = 30.0  # energy, in units of the noise, that tells nothing
INSIDE = 0.05  # of a cause's effect, that a rival may leave which can do all of it
TIED = 0.3  # of the largest of a rival's numbers, that one must reach to be part of the imitation
GAUGE = "axis_gain"  # what a rival may bring with it
LOOSE = 20.0  # probes of the gauge that cost as much as the whole effect: it is to be a small correction
NEARLY_ALL = 0.9  # of an offset's squares
EPISODES = 12  # at most, on which effects are compared


def rivals_of(found: Explanation, least: float) -> Mapping[str, tuple[str, ...]]:
    """By cause, what would do as well in its place, the nearest first.

    Args:
        found: The causes.
        least: Energy (noise units) that chance or the form of the noise may make.
    """
    searched = [item for item in found.found if cause(item.name).is_searched]
    rivals: dict[str, tuple[str, ...]] = {item.name: () for item in found.found}
    for item in searched:
        near = {**_imitating(found, item, searched, least), **_fitted(item, least, float(found.energy.sum()))}
        rivals[item.name] = tuple(sorted(near, key=lambda name: near[name]))
    for item in found.found:
        if item.name == "offset" and "dead_taxels" not in found.not_searched and _on_unpressed(found.problem, item):
            rivals["offset"] = ("dead_taxels",)
    return rivals


def _on_unpressed(problem: Problem, offset: Named) -> bool:
    """Whether nearly all of an offset is on taxels that nothing presses, which may as well be stuck."""
    pressed = np.abs(problem.simulated).max(axis=(0, 2)) >= PRESSED * problem.peak
    square = np.sum(np.asarray(offset.values["value"]) ** 2, axis=1)
    return bool(square[~pressed].sum() > NEARLY_ALL * square.sum())


def _fitted(item: Named, least: float, left: float) -> dict[str, float]:
    """Rivals that were fitted in the cause's place, and by how much worse they are as a share of its gain.

    A rival that can imitate the cause with more numbers is one only if it does better than chance would have it. One
    that leaves twice as much as the model with the cause, `left`, is none, however little that is of the gain.
    """
    gain, own = float(item.energy_gain.sum()), cause(item.name)
    near = {}
    for name, worse in item.rivals_energy.items():
        rival = cause(name)
        margin = min(MARGIN, 1.5 * own.ahead) if name in own.simpler else MARGIN
        nested = item.name in rival.simpler
        slack = -max(rival.ahead / 2 * gain, least) if nested else max(min(margin * gain, left), least)
        if worse < slack:
            near[name] = worse / max(gain, 1e-12)
    return near


def _imitating(found: Explanation, item: Named, searched: Sequence[Named], least: float) -> dict[str, float]:
    """Causes that imitate the effect of one on this motion, and what share of it they leave.

    One that was fitted counts only if it needs the gauge, which it was not given there; and one beside the gauge only
    if it takes half of what that leaves. None may leave as much as the model does.
    """
    others = [other.name for other in searched if other is not item]
    asked = [n for n in known_causes() if n not in found.not_searched and cause(n).is_searched]
    causes = [cause(name) for name in dict.fromkeys([*asked, GAUGE])]
    owner, products, projections, own = _sums(found, item, causes)
    if own <= 0:
        return {}
    limit = max(min(IMITATES * own, float(found.energy.sum())), CHANCE)
    gauge = np.flatnonzero(owner == GAUGE)
    products[gauge, gauge] += own / LOOSE**2

    def left(names: Sequence[str]) -> float:
        which = np.flatnonzero(np.isin(owner, names))
        right = projections[which]
        return own - float(right @ _solved(products[np.ix_(which, which)], right)) if len(which) else own

    alone = item.name == GAUGE or GAUGE in others
    common = others if alone else [*others, GAUGE]
    near = {}
    for name in asked:
        if name == item.name or name in others:
            continue
        if item.name in cause(name).simpler:
            share = _unseen(owner, products, name, [*common, item.name])
            if share < UNSEEN or _is_half_told(owner, products, projections, own, name, others, least):
                near[name] = share
        else:
            judged = name in item.rivals_energy and left([*others, name]) < limit
            without = left(others if name == GAUGE else common)
            if left([*common, name]) < min(limit, without / 2) and not judged:
                near[name] = left([*common, name]) / own
    return near


def _unseen(owner: FloatArray, products: FloatArray, rival: str, names: Sequence[str]) -> float:
    """The share of what a more general rival could do that `names` cannot: where it is small, it may be at work."""
    its, which = np.flatnonzero(owner == rival), np.flatnonzero(np.isin(owner, names))
    across = products[np.ix_(which, its)]
    whole = float(np.trace(products[np.ix_(its, its)]))
    return 1 - float(np.sum(across * _solved(products[np.ix_(which, which)], across))) / max(whole, 1e-12)


def _is_half_told(
    owner: FloatArray,
    products: FloatArray,
    projections: FloatArray,
    own: float,
    rival: str,
    others: Sequence[str],
    least: float,
) -> bool:
    """Whether a rival that can do all that a cause does can do so with a number fewer, to what matters.

    The cause ties numbers of the rival to one another, as a rotation ties what normal force adds to shear to what shear
    adds to normal force. Where one of them hardly shows, the tie is an assumption.
    """
    which = np.flatnonzero(np.isin(owner, [rival, *others]))
    matrix, right = products[np.ix_(which, which)], projections[which]
    values = _solved(matrix, right)
    if own - float(right @ values) > INSIDE * own:
        return False
    costs = values**2 / np.maximum(np.diag(np.linalg.pinv(matrix)), 1e-12)
    its = owner[which] == rival
    size = np.abs(values[its])
    return bool(np.any(costs[its][size >= TIED * size.max()] < least))


def _solved(products: FloatArray, right: FloatArray) -> FloatArray:
    return np.linalg.solve(products + np.diag(1e-6 * np.diag(products) + 1e-9), right)


def _sums(found: Explanation, item: Named, causes: Sequence[Cause]) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """The effects' owners, their products with one another and with what `item` does, and the energy of that."""
    problem = found.problem
    step = -(-len(problem.episodes) // EPISODES)
    tangents = []
    for number in range(0, len(problem.episodes), step):
        part = problem.select([number])
        whole, without = (_applied(part, found.model, name) for name in ("", item.name))
        ideal = replace(part, measured=whole, step=0.0, clips=False, zero=0.0)
        tangents.append(tangent_of(ideal, causes, without, without))
    products = np.sum([tangent.products[0] for tangent in tangents], axis=0)
    projections = np.sum([tangent.projections[0] for tangent in tangents], axis=0)
    return tangents[0].owner, products, projections, float(sum(tangent.energy[0] for tangent in tangents))


def _applied(problem: Problem, model: augment.Chain, without: str) -> FloatArray:
    """The model's output but for one cause, and for those that are read off the data."""
    kept = [
        (member, name)
        for member, name in zip(model.members, model.names, strict=True)
        if name != without and cause(name).is_searched
    ]
    chain = augment.Chain([member for member, _ in kept], [name for _, name in kept])
    return problem.run(chain, problem.simulated) if kept else problem.simulated
