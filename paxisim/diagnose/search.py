"""Search: causes are added while they bring something, with the real transforms fitted after each step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

from paxisim.diagnose.cause import TAXEL_GAIN, Cause, Values
from paxisim.diagnose.each import each
from paxisim.diagnose.fits import Fits
from paxisim.diagnose.fitting import Fit
from paxisim.diagnose.plan import Plan
from paxisim.diagnose.problem import Problem
from paxisim.diagnose.tangent import Tangent, tangent_of
from paxisim.diagnose.worth import Worth

CONTEST = 4  # candidates that are fitted in full for one place
EXCHANGE = 3  # of them where a cause that is in is put to the test again
SIGNIFICANT = 30.0  # energy, in units of the noise, that chance does not explain
SLOW = 20.0  # energy, in units of the noise, that each number of a field may take of slow noise in it
FEW = 6  # numbers of a cause
PROMISE = 0.4  # of what a cause must bring, that it must promise while it is small to be fitted
STEEP_PROMISE = 0.2  # the same at first where noise hardly reaches the next count, as small effects hardly show there
HINT = 0.2  # of what a cause must bring, that it must promise to be looked at as one that nearly was kept
NEAR = 0.6  # of the best one's gain: who has less is not fitted


class Found:
    """What a search ends with.

    Attributes:
        fit: The causes with their values.
        without: By cause, the fit of the others.
    """

    def __init__(self, search: _Search, chosen: Sequence[str]) -> None:
        """Remember; rivals are fitted when they are asked for."""
        self._search, self._chosen = search, chosen
        self.fit = search.fits.of(chosen)
        fewer = [[n for n in chosen if n != name] for name in chosen]
        self.without = dict(zip(chosen, each(search.fits.of, fewer, search.fits.jobs), strict=True))

    @cached_property
    def rivals(self) -> Mapping[str, Mapping[str, float]]:
        """By cause, the energy that is left with a rival in its place, by the rival's name."""
        return {name: self._search.rivals(self._chosen, name) for name in self._chosen}

    @cached_property
    def nearly(self) -> Mapping[str, float]:
        """By cause that is not in, what it brings as a share of what it must bring, where that is not little."""
        return self._search.nearly(self._chosen)


def search(problem: Problem, plan: Plan, begin: Sequence[str] = ()) -> Found:
    """The causes that the recording asks for, fitted.

    Args:
        problem: The recording.
        plan: What is looked for.
        begin: Causes to begin with.
    """
    return _Search(problem, plan).run(list(begin))


def found_with(problem: Problem, plan: Plan, begin: Fit, doubted: set[str]) -> Found:
    """What a search that ended with the causes of a fit finds, but for doubted ones that bring little here.

    Args:
        problem: The recording.
        plan: What was looked for, and what each of the doubted must bring.
        begin: The fit, maybe of the recording with other weights.
        doubted: Names of causes.
    """
    own = _Search(problem, plan)
    chosen = list(begin.values)
    while True:
        own.fits.of(chosen, begin)
        found = Found(own, chosen)
        gains = {n: float((found.without[n].energy - found.fit.energy).sum()) for n in doubted & set(chosen)}
        small = [n for n in gains if gains[n] < plan.limits.least(own.fits.by_name[n]) * problem.samples]
        if not small:
            return found
        chosen.remove(min(small, key=lambda n: gains[n]))


class _Search:
    """A search, with the fits made so far."""

    def __init__(self, problem: Problem, plan: Plan) -> None:
        self._problem, self._causes, self._limits, self._tell = problem, plan.searched, plan.limits, plan.tell
        self.fits = Fits(problem, plan.searched, plan.jobs)
        self._worth = Worth(self.fits, plan.limits)
        self._by_name = self.fits.by_name
        self._gains: dict[frozenset[str], dict[str, float]] = {}

    def run(self, chosen: list[str]) -> Found:
        chosen, seen = self._pruned(chosen), set[frozenset[str]]()
        while len(chosen) < self._limits.most and frozenset(chosen) not in seen:
            seen.add(frozenset(chosen))
            self._tell(f"looking for a cause beside {', '.join(chosen) or 'none'}")
            kept = self._next(chosen)
            if kept is None:
                break
            chosen = self._exchanged(self._pruned([*chosen, kept], kept))
        return Found(self, self._pruned(chosen))

    def _ranked(self, chosen: Sequence[str]) -> dict[str, float]:
        """What each other cause would take away in addition while it is small, largest first."""
        key = frozenset(chosen)
        if key not in self._gains:
            current = self.fits.of(chosen)
            force = current.prediction - self._problem.zero
            tangent = tangent_of(self._problem, self._causes, force, current.prediction)
            gains = {n: _promise(tangent, chosen, item) for n, item in self._by_name.items() if n not in key}
            self._gains[key] = dict(sorted(gains.items(), key=lambda item: -item[1]))
        return self._gains[key]

    def _near(self, chosen: Sequence[str], most: int, share: float = NEAR) -> list[str]:
        """Candidates for a place beside `chosen`, with those that they may be mistaken for."""
        gains = self._ranked(chosen)
        found = self.fits.of(chosen)
        least = {n: self._limits.least(self._by_name[n]) * self._problem.samples for n in gains}
        # what others' forms may leave to one is not what it is looked for with
        asked = STEEP_PROMISE if self._problem.counting.is_steep and not self._limits.second else PROMISE
        promising = [n for n in gains if gains[n] >= asked * max(least[n], self._worth.misfit(found, n))]
        near = [n for n in promising[:most] if gains[n] >= share * gains[promising[0]]]
        simpler = [n for m in near for n in self._by_name[m].simpler]
        # what looks like a cause that is in shows only once both are fitted
        alike = [n for n in gains for m in chosen if n in self._by_name[m].behind or m in self._by_name[n].behind]
        return list(dict.fromkeys([*near, *(n for n in (*simpler, *alike) if n in gains)]))

    def _next(self, chosen: Sequence[str]) -> str | None:
        """The cause that brings most beside `chosen`, if one brings enough."""
        current = self.fits.of(chosen)
        for share in (NEAR, 0.0):  # those behind are fitted only where the first keep none of what they promise
            contest = self.fits.with_each(chosen, self._near(chosen, CONTEST, share), current)
            for name in sorted(contest, key=lambda n: contest[n].energy.sum()):
                name = self._simplest(name, contest, current)
                if self._worth.keeps(contest[name], current, name) and self._worth.matters(contest[name], name):
                    return name
        return None

    def _exchanged(self, chosen: list[str]) -> list[str]:
        """With each cause replaced by another that does better now that the others are in."""
        for _ in range(3):
            if len(chosen) < 2:
                break
            for place, name in enumerate(chosen):
                rest = [n for n in chosen if n != name]
                without = self.fits.of(rest, self.fits.of(chosen))
                near = [n for n in self._near(rest, EXCHANGE) if n != name]
                contest = self.fits.with_each(rest, near, without)
                contest = {n: found for n, found in contest.items() if self._worth.keeps(found, without, n)}
                contest[name] = self.fits.of(chosen)
                best = self._simplest(min(contest, key=lambda n: contest[n].energy.sum()), contest, without)
                better = contest[name].energy.sum() - contest[best].energy.sum()
                gives_way = best in self._by_name[name].gives_way
                if best != name and (better > SIGNIFICANT or gives_way) and self._worth.matters(contest[best], best):
                    chosen = self._pruned([*chosen[:place], *chosen[place + 1 :], best], best)
                    break
            else:
                break
        return chosen

    def rivals(self, chosen: Sequence[str], name: str) -> dict[str, float]:
        """Energy that is left with others in place of one cause, by their names."""
        rest = [n for n in chosen if n != name]
        without = self.fits.of(rest, self.fits.of(chosen))
        near = [n for n in list(self._ranked(rest))[: EXCHANGE + 1] if n != name]
        return {n: float(found.energy.sum()) for n, found in self.fits.with_each(rest, near, without).items()}

    def nearly(self, chosen: Sequence[str]) -> dict[str, float]:
        """What those bring that are not kept beside `chosen`, as shares of what they must bring."""
        current = self.fits.of(chosen)
        least = HINT * self._limits.material * self._problem.samples
        likely = [n for n, promise in self._ranked(chosen).items() if promise > least]
        fits = self.fits.with_each(chosen, likely, current)
        shares = {n: self._worth.nearly(found, current, n) for n, found in fits.items()}
        return {n: share for n, share in shares.items() if share > 0}

    def _simplest(self, name: str, contest: Mapping[str, Fit], without: Fit) -> str:
        """`name`, or a candidate that it gives way to and does no more than."""
        item = self._by_name[name]
        others = sorted((n for n in contest if n != name), key=lambda n: contest[n].energy.sum())
        for simple in others if item.costs > 1 else item.gives_way:
            # one that would be too small to be named does not stand in for another of its kind
            if simple in contest and (simple in item.simpler or self._worth.matters(contest[simple], simple)):
                found = contest[name]
                values: Values = found.values[name]  # type: ignore[assignment]
                ahead = item.behind[simple](values, self._problem) if simple in item.behind else item.ahead
                least = max(SIGNIFICANT, ahead * float((without.energy - found.energy).sum()))
                significant = self._worth.is_consistent(found, contest[simple], least)
                if significant and item.beyond(values, self._problem) >= 1:
                    continue
                if not self._worth.told_beside_absorbers(without, name, simple):
                    return simple
        return name

    def _pruned(self, chosen: list[str], kept: str = "") -> list[str]:
        """Without the causes that the others, `kept` among them, have made superfluous."""
        for name in [n for n in chosen if n != kept]:
            fewer = [n for n in chosen if n != name]
            less = self.fits.of(fewer, self.fits.of(chosen))
            whole = self.fits.of(chosen)  # not worse than that of fewer
            if not self._worth.keeps(whole, less, name) or not self._worth.matters(whole, name):
                return self._pruned(fewer, kept)
        return chosen


def _promise(tangent: Tangent, chosen: Sequence[str], item: Cause) -> float:
    """What a cause may bring beside `chosen`: in other episodes, or half of it where but one shows it at all."""
    names = [*chosen, item.name]
    # weights that protect gains from the contacts' place let what another cause left undone weigh more
    promise = max(
        float(tangent.gain(names, True, alike).sum() - tangent.gain(chosen, True, alike).sum())
        for alike in ((False, True) if TAXEL_GAIN in names else (False,))  # nothing else is weighted
    )
    count = int((tangent.owner == item.name).sum())
    if count > FEW and not item.covariate:  # in one episode they would fit noise
        return promise
    chance = SLOW * count if count > FEW else 0.0
    return max(promise, 0.5 * (float(tangent.gain(names, False).sum() - tangent.gain(chosen, False).sum()) - chance))
