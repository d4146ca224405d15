"""Search: causes are added while they bring something, with the real transforms fitted after each step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from paxisim.diagnose.cause import FORM, TAXEL_GAIN, Cause, Values
from paxisim.diagnose.displaced import beyond_tolerated
from paxisim.diagnose.fitting import Fit, fit
from paxisim.diagnose.problem import FloatArray, Problem, showing
from paxisim.diagnose.tangent import Tangent, tangent_of

CONTEST = 4  # candidates that are fitted in full for one place
EXCHANGE = 3  # of them where a cause that is in is put to the test again
SIGNIFICANT = 30.0  # energy, in units of the noise, that chance does not explain
WANDERING = 0.0005  # of what offset and drift explain, that their form leaves to most others, as zeros wander
DRIFTING = 0.05  # of what a drift explains within the episodes, that its form leaves to a field that comes and goes
COARSE = 0.7  # of a step: with less noise before rounding an offset is not told well
HIDDEN = 0.07  # of what such an offset explains, that it may leave to most others
MOST_HIDDEN = 0.02  # of the noise's energy, that this may be where no noise smooths the rounding
EACH = 2.0  # times what a field's form leaves to another on the whole, that it may leave in one episode
UNREPEATED = 3.0  # times what matters that a cause must bring which but few of the episodes show
REPEATED = 0.5  # of what a cause of many numbers must bring, that it must bring without its best episode
ELSEWHERE = 0.25  # of what it brings, that it must bring there
HARDLY = 0.975  # of what is gained in some episodes and lost in others, that is gained
UNLIKE_TOLERATED = 0.5  # of what a cause must bring that one episode alone shows, which nothing tolerated brings
UNPRESSED = 0.5  # of what a field brings in the one episode that shows it, that it must bring where nothing is pressed
SLOW = 20.0  # energy, in units of the noise, that each number of a field may take of slow noise in it
FEW = 6  # numbers of a cause
SEVERAL = 6  # episodes
PROMISE = 0.4  # of what a cause must bring, that it must promise while it is small to be fitted
NEAR = 0.6  # of the best one's gain: who has less is not fitted


@dataclass(frozen=True)
class Thresholds:
    """What a cause must bring to be kept.

    Attributes:
        material: Energy, as a share of the noise's: less does not matter to a user.
        second: Whether this is a second look, in which chance brings little, so that less of some causes is enough.
        episodes: Share of the episodes that must gain, of those in which the two models differ at all; or of what is
            gained in some and lost in others.
        most: Causes at most, those that are read off the data apart.
    """

    material: float = 0.003
    second: bool = False
    episodes: float = 0.7
    most: int = 5

    def least(self, item: Cause) -> float:
        """What a cause must bring at least, as a share of the noise's energy."""
        return self.material * (item.faint if self.second else 1.0)


class Found:
    """What a search ends with.

    Attributes:
        fit: The causes with their values.
        without: By cause, the fit of the others.
    """

    def __init__(self, search: _Search, chosen: Sequence[str]) -> None:
        """Remember; rivals are fitted when they are asked for."""
        self._search, self._chosen = search, chosen
        self.fit = search.fitted(chosen)
        self.without = {name: search.fitted([n for n in chosen if n != name]) for name in chosen}

    @cached_property
    def rivals(self) -> Mapping[str, Mapping[str, float]]:
        """By cause, the energy that is left with a rival in its place, by the rival's name."""
        return {name: self._search.rivals(self._chosen, name) for name in self._chosen}


def search(
    problem: Problem,
    causes: Sequence[Cause],
    limits: Thresholds,
    progress: Callable[[str], None] | None = None,
    begin: Sequence[str] = (),
) -> Found:
    """The causes that the recording asks for, fitted.

    Args:
        problem: The recording.
        causes: Those to choose from.
        limits: What each must bring.
        progress: Told in words what is being done.
        begin: Causes to begin with.
    """
    return _Search(problem, causes, limits, progress or (lambda text: None)).run(list(begin))


def found_with(problem: Problem, causes: Sequence[Cause], limits: Thresholds, begin: Fit, doubted: set[str]) -> Found:
    """What a search that ended with the causes of a fit finds, but for doubted ones that bring little here.

    Args:
        problem: The recording.
        causes: Those that were to choose from.
        limits: What each of the doubted must bring.
        begin: The fit, maybe of the recording with other weights.
        doubted: Names of causes.
    """
    own = _Search(problem, causes, limits, lambda text: None)
    chosen = list(begin.values)
    while True:
        own.fitted(chosen, begin)
        found = Found(own, chosen)
        gains = {n: float((found.without[n].energy - found.fit.energy).sum()) for n in doubted & set(chosen)}
        small = [n for n in gains if gains[n] < limits.least(own._by_name[n]) * problem.samples]
        if not small:
            return found
        chosen.remove(min(small, key=lambda n: gains[n]))


class _Search:
    """The fits made so far, by the set of causes, and the rules by which two of them are compared."""

    def __init__(
        self, problem: Problem, causes: Sequence[Cause], limits: Thresholds, tell: Callable[[str], None]
    ) -> None:
        self._problem, self._causes, self._limits, self._tell = problem, causes, limits, tell
        self._by_name = {item.name: item for item in causes}
        self._fits: dict[frozenset[str], Fit] = {}
        self._zero_gain = self._drifting = self._hidden = 0.0
        if np.any(problem.zero):
            with_zero = np.sum(problem.residual(problem.simulated + problem.zero) ** 2)
            self._zero_gain = max(float(np.sum(problem.residual(problem.simulated) ** 2) - with_zero), 0.0)
            still = problem.residual(problem.simulated + _still(problem))
            self._drifting = max(float(np.sum(still**2) - with_zero), 0.0)
            told = problem.dither / (COARSE * problem.step) if problem.step else 1.0
            if told < 1:
                read = [problem.read(problem.simulated + zero) for zero in (0.0, problem.zero)]
                without, whole = (float(np.sum(((problem.measured - r) * problem.weight) ** 2)) for r in read)
                self._hidden = min(HIDDEN * max(without - whole, 0.0), MOST_HIDDEN * (1 - told) * problem.samples)
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

    def fitted(self, names: Sequence[str], start: Fit | None = None) -> Fit:
        """The fit of a set of causes, begun with the values of another where it has them."""
        key = frozenset(names)
        if key not in self._fits:
            known = {} if start is None else {n: v for n, v in start.values.items() if n in key}
            self._fits[key] = fit(self._problem, [self._by_name[n] for n in names], known)
        return self._fits[key]

    def _ranked(self, chosen: Sequence[str]) -> dict[str, float]:
        """What each other cause would take away in addition while it is small, largest first."""
        key = frozenset(chosen)
        if key not in self._gains:
            current = self.fitted(chosen)
            force = current.prediction - self._problem.zero
            tangent = tangent_of(self._problem, self._causes, force, current.prediction)
            gains = {n: _promise(tangent, chosen, item) for n, item in self._by_name.items() if n not in key}
            self._gains[key] = dict(sorted(gains.items(), key=lambda item: -item[1]))
        return self._gains[key]

    def _near(self, chosen: Sequence[str], most: int, share: float = NEAR) -> list[str]:
        """Candidates for a place beside `chosen`, with those that they may be mistaken for."""
        gains = self._ranked(chosen)
        found = self.fitted(chosen)
        least = {n: self._limits.least(self._by_name[n]) * self._problem.samples for n in gains}
        # what others' forms may leave to one is not what it is looked for with
        promising = [n for n in gains if gains[n] >= PROMISE * max(least[n], self._misfit(found, n))]
        near = [n for n in promising[:most] if gains[n] >= share * gains[promising[0]]]
        simpler = [n for m in near for n in self._by_name[m].simpler]
        # what looks like a cause that is in shows only once both are fitted
        alike = [n for n in gains for m in chosen if n in self._by_name[m].behind or m in self._by_name[n].behind]
        return list(dict.fromkeys([*near, *(n for n in (*simpler, *alike) if n in gains)]))

    def _next(self, chosen: Sequence[str]) -> str | None:
        """The cause that brings most beside `chosen`, if one brings enough."""
        current = self.fitted(chosen)
        for share in (NEAR, 0.0):  # those behind are fitted only where the first keep none of what they promise
            contest = {n: self.fitted([*chosen, n], current) for n in self._near(chosen, CONTEST, share)}
            for name in sorted(contest, key=lambda n: contest[n].energy.sum()):
                name = self._simplest(name, contest, current)
                if self._worth(contest[name], current, name) and self._material(contest[name], name):
                    return name
        return None

    def _exchanged(self, chosen: list[str]) -> list[str]:
        """With each cause replaced by another that does better now that the others are in."""
        for _ in range(3):
            if len(chosen) < 2:
                break
            for place, name in enumerate(chosen):
                rest = [n for n in chosen if n != name]
                without = self.fitted(rest, self.fitted(chosen))
                near = [n for n in self._near(rest, EXCHANGE) if n != name]
                contest = {n: self.fitted([*rest, n], without) for n in near}
                contest = {n: found for n, found in contest.items() if self._worth(found, without, n)}
                contest[name] = self.fitted(chosen)
                best = self._simplest(min(contest, key=lambda n: contest[n].energy.sum()), contest, without)
                better = contest[name].energy.sum() - contest[best].energy.sum()
                gives_way = best in self._by_name[name].gives_way
                if best != name and (better > SIGNIFICANT or gives_way) and self._material(contest[best], best):
                    chosen = self._pruned([*chosen[:place], *chosen[place + 1 :], best], best)
                    break
            else:
                break
        return chosen

    def rivals(self, chosen: Sequence[str], name: str) -> dict[str, float]:
        """Energy that is left with others in place of one cause, by their names."""
        rest = [n for n in chosen if n != name]
        without = self.fitted(rest, self.fitted(chosen))
        near = [n for n in list(self._ranked(rest))[: EXCHANGE + 1] if n != name]
        return {n: float(self.fitted([*rest, n], without).energy.sum()) for n in near}

    def _simplest(self, name: str, contest: Mapping[str, Fit], without: Fit) -> str:
        """`name`, or a candidate that it gives way to and does no more than."""
        item = self._by_name[name]
        others = sorted((n for n in contest if n != name), key=lambda n: contest[n].energy.sum())
        for simple in others if item.costs > 1 else item.gives_way:
            # one that would be too small to be named does not stand in for another of its kind
            if simple in contest and (simple in item.simpler or self._material(contest[simple], simple)):
                found = contest[name]
                values: Values = found.values[name]  # type: ignore[assignment]
                ahead = item.behind[simple](values, self._problem) if simple in item.behind else item.ahead
                least = max(SIGNIFICANT, ahead * float((without.energy - found.energy).sum()))
                significant = self._consistent(found, contest[simple], least)
                if significant and item.beyond(values, self._problem) >= 1:
                    continue
                if not self._worth_beside_absorbers(without, name, simple):
                    return simple
        return name

    def _pruned(self, chosen: list[str], kept: str = "") -> list[str]:
        """Without the causes that the others, `kept` among them, have made superfluous."""
        for name in [n for n in chosen if n != kept]:
            fewer = [n for n in chosen if n != name]
            whole = self.fitted(chosen)
            if not self._worth(whole, self.fitted(fewer, whole), name) or not self._material(whole, name):
                return self._pruned(fewer, kept)
        return chosen

    def _consistent(self, more: Fit, fewer: Fit, least: float) -> bool:
        gain = fewer.energy - more.energy
        if gain.sum() <= least:
            return False
        if (gain[showing(gain)] > 0).mean() >= self._limits.episodes:
            return True
        # few may show it, then more of it, if the others do not object, or hardly speak
        better = gain[gain > 0].sum() / max(np.abs(gain).sum(), 1e-12)
        return bool(better >= HARDLY or (gain.sum() > UNREPEATED * least and better >= self._limits.episodes))

    def _worth(self, more: Fit, fewer: Fit, name: str) -> bool:
        item = self._by_name[name]
        least = self._limits.least(item) * self._problem.samples * item.costs
        gain = fewer.energy - more.energy
        elsewhere = gain.sum() - gain.max()
        alone = len(gain) > SEVERAL and elsewhere < ELSEWHERE * gain.sum()
        if item.costs > 1 and (alone or (len(gain) > SEVERAL and elsewhere < REPEATED * least)):
            return False  # many numbers fit what one episode has of its own
        if alone and item.mistaken >= FORM and not self._is_own(fewer, more, item, least, int(gain.argmax())):
            return False
        if self._consistent(more, fewer, max(least, self._misfit(fewer, name, more))):
            return True
        return self._consistent(more, fewer, least) and self._worth_beside_absorbers(fewer, name)

    def _is_own(self, fewer: Fit, more: Fit, item: Cause, least: float, number: int) -> bool:
        """Whether what one episode alone shows is the cause's own."""
        span = self._problem.episodes[number]
        if not item.covariate:  # a press that is a little beside its place looks like a saturation
            freed = beyond_tolerated(self._problem, fewer.prediction, more.prediction, span)
            return freed > UNLIKE_TOLERATED * least
        # a field is there without a press, too
        rest, left = (self._problem.residual(f.prediction)[span] ** 2 for f in (fewer, more))
        gain = (rest - left).sum(axis=(1, 2, 3, 4))
        unpressed = gain[self._problem.at_rest[span]].sum()
        return bool(unpressed > UNPRESSED * gain.sum())

    def _worth_beside_absorbers(self, fewer: Fit, name: str, among: str = "") -> bool:
        """Whether a cause brings enough where others, `among` them, take up what the form of one of a fit's misses."""
        item = self._by_name[name]
        least = self._limits.least(item) * self._problem.samples * item.costs
        for other in (self._by_name[n] for n in fewer.values):
            known = self._by_name.keys() >= set(other.absorbers)
            if name in other.absorbs and known and (not among or among in other.absorbers):
                names = list(dict.fromkeys([*fewer.values, *other.absorbers]))
                absorbed = self.fitted(names, fewer)
                more = self.fitted([*names, name], absorbed)
                return self._consistent(more, absorbed, max(least, self._misfit(fewer, name, more, other.name)))
        return False

    def _misfit(self, fewer: Fit, name: str, more: Fit | None = None, absorbed: str = "") -> float:
        """Energy that the forms of a fit's causes may leave for `name` to explain, at least or beside a fit with it.

        What the form of `absorbed` misses is taken up by others.
        """
        item = self._by_name[name]
        gain = np.maximum(fewer.energy - more.energy, 0.0) if more else np.zeros_like(fewer.energy)
        misfit = max(self._hidden, WANDERING * self._zero_gain) * min(item.mistaken / FORM, 1.0)
        if name == "interference":
            misfit = max(DRIFTING * self._drifting, WANDERING * self._zero_gain)
        for other in fewer.values:
            without = self.fitted([n for n in fewer.values if n != other], fewer)
            form = self._by_name[other].form
            share = self._by_name[other].absorbs[name] if other == absorbed else form.get(name, item.mistaken)
            left = share * (without.energy - fewer.energy)
            if self._by_name[other].covariate and not item.covariate:
                # a field leaves something where it changes, not where the pad is pressed
                misfit += np.minimum(EACH * np.maximum(left, 0.0), gain).sum()
            else:
                misfit += max(left.sum(), 0.0)
        return float(misfit)

    def _material(self, found: Fit, name: str) -> bool:
        values: Values = found.values[name]  # type: ignore[assignment]
        return self._by_name[name].is_material(values, self._problem, found.values)


def _still(problem: Problem) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` the zero, in each episode its mean."""
    zero = np.broadcast_to(problem.zero, problem.measured.shape)
    return np.concatenate([np.broadcast_to(zero[span].mean(axis=0), zero[span].shape) for span in problem.episodes])


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
