"""Search: causes are added, exchanged and dropped as long as the scorer's objective improves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from paxisim.diagnose.causes.kinds import BaselineCause, FittedCause
from paxisim.diagnose.scorer.scorer import Scorer


def search(scorer: Scorer) -> tuple[str, ...]:
    """The names of the causes that pass the scorer's test, with the nuisances fitted beside them."""
    causes = scorer.causes
    nuisances = tuple(c.name for c in causes.values() if c.nuisance)
    found = _climbed(scorer, nuisances)
    needed = len(found) > len(nuisances) or any(
        scorer.evidence(found, n).kept for n in nuisances if not causes[n].tacit
    )
    if any(not causes[n].tacit for n in nuisances) and needed and scorer.problem.noise.is_steep:
        # a zero offset visible only under load absorbs other effects, so it must be worth its price, too
        bare = _climbed(scorer, tuple(n for n in nuisances if causes[n].tacit))
        without = [tuple(n for n in names if n not in nuisances or causes[n].tacit) for names in (found, bare)]
        sets = dict.fromkeys(filter(None, (found, bare, *without)))
        found = min(sets, key=lambda names: scorer.objective(names, nuisances=True, exact=True))
    return _separated(scorer, _climbed(scorer, found) if _pruned(scorer, found) else found)


def confirmed(scorer: Scorer, names: Sequence[str]) -> tuple[str, ...]:
    """The causes of a set that pass the test with independently fitted folds; the weakest is dropped first."""
    return _dropped(scorer, tuple(names), exact=True)


def rivals_in_place(scorer: Scorer, names: Sequence[str], name: str) -> tuple[str, ...]:
    """Causes whose held-out error in place of `name`, one of the causes `names`, is hardly larger, best first."""
    rules = scorer.rules
    fit, rest = scorer.fit(names), tuple(n for n in names if n != name)
    gain = float((scorer.without(names, name).heldout - fit.heldout).sum())
    if scorer.causes[name].nuisance:  # another form of the zero offset
        others = [n for n, c in scorer.causes.items() if isinstance(c, BaselineCause) and n not in names]
    else:
        others = [other for _, other in scorer.ranked(rest)[: rules.contest + 1] if other != name]
    near = {}
    for other in others:
        own = scorer.fit((*rest, other), scorer.fit(rest))
        worse = float((own.heldout - fit.heldout).sum())
        limit = scorer.material
        if not scorer.causes[name].nuisance:  # a settled drift would replace any offset to within its misfit
            limit += scorer.causes[name].misfit * fit.effects.get(name, 0.0)
            limit += scorer.causes[other].misfit * own.effects.get(other, 0.0) + rules.tie * max(gain, 0.0)
        if worse < limit and scorer.evidence((*rest, other), other).kept:
            near[other] = worse
    return tuple(sorted(near, key=lambda n: near[n]))


def _climbed(scorer: Scorer, chosen: tuple[str, ...]) -> tuple[str, ...]:
    """The set reached by adding, exchanging and dropping causes until nothing improves."""
    seen: set[frozenset[str]] = set()
    for _ in range(scorer.rules.rounds):
        shown = scorer.shown(chosen)
        beside = f"looking for a cause beside {', '.join(shown)}" if shown else "looking for the first cause"
        scorer.begin(beside)
        better = _dropped(scorer, _exchanged(scorer, _added(scorer, chosen)))
        if frozenset(better) in seen or set(better) == set(chosen):
            break
        seen.add(frozenset(better))
        chosen = better
    return chosen


def _pruned(scorer: Scorer, chosen: tuple[str, ...]) -> bool:
    """Leave out the parts of the chosen causes that are small or gain nothing; return whether there were any.

    A part that gains a little stays in the model, although it is not reported.
    """
    pruned = False
    while failed := [
        e for n in chosen for e in scorer.evidence_of_parts(chosen, n) if e.gain.sum() <= 0 or e.amount < 1
    ]:
        scorer.leave_out(chosen, min(failed, key=lambda e: e.share).name)
        pruned = True
    return pruned


def _separated(scorer: Scorer, chosen: tuple[str, ...]) -> tuple[str, ...]:
    """The set with causes added that explain what is beyond the limits of others, if they pass the test."""
    for name in scorer.shown(chosen):
        item = scorer.causes[name]
        if not isinstance(item, FittedCause) or item.beyond in chosen or item.beyond not in scorer.causes:
            continue
        if item.beyond_limits(scorer.fit(chosen).whole.values[name], scorer.problem):
            scorer.put(item.within_limits())
            both = (*chosen, item.beyond)
            if scorer.evidence(both, item.beyond).kept:
                chosen = both
            else:
                scorer.put(item)
    return chosen


def _candidates(scorer: Scorer, names: Sequence[str], most: int) -> list[tuple[str, ...]]:
    """Causes to try adding: those fitted in closed form, and the `most` others with the largest promise."""
    least = scorer.rules.promise * scorer.material
    in_closed_form = [n for n, c in scorer.causes.items() if n not in names and not isinstance(c, FittedCause)]
    promising = [n for gain, n in scorer.ranked(names)[:most] if gain > least]
    return [(n,) for n in (*in_closed_form, *promising)]


def _pairs(scorer: Scorer, names: Sequence[str]) -> list[tuple[str, ...]]:
    """Pairs whose joint promise exceeds the best single promise by more than the materiality threshold."""
    if len(scorer.shown(names)) > scorer.rules.most - 2:
        return []
    ranking = scorer.ranking(names)
    alone = {n: gain for gain, n in scorer.ranked(names)}
    best = max(alone.values(), default=0.0)
    gains = [(ranking.gain([a, b]), (a, b)) for i, a in enumerate(alone) for b in list(alone)[i + 1 :]]
    promising = sorted((g for g in gains if g[0] > best + scorer.material), reverse=True)
    return [pair for _, pair in promising[: scorer.rules.pairs]]


def _added(scorer: Scorer, chosen: tuple[str, ...]) -> tuple[str, ...]:
    """The best set with one or two causes more, all of which pass the test."""
    if len(scorer.shown(chosen)) >= scorer.rules.most:
        return chosen
    candidates = _candidates(scorer, chosen, scorer.rules.contest)
    sets = [(*chosen, *extra) for extra in (*candidates, *_pairs(scorer, chosen))]
    scorer.fit_all(sets, scorer.fit(chosen))
    promised = {name: gain for gain, name in scorer.ranked(chosen)}
    begun = len(scorer.shown(chosen)) < scorer.rules.afresh
    scorer.fit_afresh([names for names in sets if begun and _falls_short(scorer, chosen, names, promised)])
    better = [names for names in sets if scorer.objective(names) < scorer.objective(chosen)]
    kept = [names for names in better if all(scorer.evidence(names, n).kept for n in names if n not in chosen)]
    return next(iter(_by_merit(scorer, kept)), chosen)


def _exchanged(scorer: Scorer, chosen: tuple[str, ...]) -> tuple[str, ...]:
    """The set after replacing causes by others with a smaller held-out error."""
    for name in scorer.shown(chosen):
        rest = tuple(n for n in chosen if n != name)
        scorer.fit(rest, scorer.fit(chosen))
        candidates = _candidates(scorer, rest, scorer.rules.contest - 1)
        sets = [(*rest, *extra) for extra in candidates if extra != (name,)]
        scorer.fit_all(sets, scorer.fit(rest))
        best = _by_merit(scorer, [chosen, *sets])[0]
        if best != chosen and scorer.evidence(best, best[-1]).kept:
            return _exchanged(scorer, best) if len(best) == len(chosen) else best
    return chosen


def _dropped(scorer: Scorer, chosen: tuple[str, ...], exact: bool = False) -> tuple[str, ...]:
    """The set without the causes that fail the test; the weakest is dropped first."""
    while failed := [e for n in scorer.shown(chosen) if not (e := scorer.evidence(chosen, n, exact)).kept]:
        weakest = min(failed, key=lambda e: e.share).name
        chosen = tuple(n for n in chosen if n != weakest)
    return chosen


def _by_merit(scorer: Scorer, sets: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """The sets in order of preference.

    Sets whose causes have only a few parameters each and whose objective is within the materiality threshold of the
    best come first, the one with the fewest parameters leading. The others follow by objective.
    """
    least = min(map(scorer.objective, sets), default=0.0) + scorer.material

    def merit(names: tuple[str, ...]) -> tuple[float, float]:
        causes = [scorer.causes[n] for n in names]
        left = scorer.objective(names)
        plain = all(c.nuisance or isinstance(c, FittedCause) for c in causes)
        numbers = sum(len(c.parameters(scorer.problem)) // c.copies(scorer.problem) for c in causes)
        return (numbers, left) if left < least and plain else (np.inf, left)

    return sorted(sets, key=merit)


def _falls_short(
    scorer: Scorer, chosen: tuple[str, ...], names: tuple[str, ...], promised: Mapping[str, float]
) -> bool:
    """Whether a fit gains much less than its new cause promised, as when another cause absorbs its effect."""
    promise = promised.get(names[-1], 0.0) if len(names) == len(chosen) + 1 else 0.0
    gain = float((scorer.fit(chosen).heldout - scorer.fit(names).heldout).sum())
    return promise > scorer.material and gain < scorer.rules.delivered * promise
