"""Search: causes are added, exchanged and dropped, and each set is scored by its error on held-out episodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paxisim.diagnose.cause import Cause, CausePart, courses_of
from paxisim.diagnose.fitting import Fit, Fitter
from paxisim.diagnose.folds import Folds
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.ranking import Ranking
from paxisim.diagnose.rules import Rules
from paxisim.parallel import parallel_map

AFRESH = 2  # number of causes from which no fit is repeated from the causes' own starts
SEARCH_END, PREDICTION_END = 0.45, 0.8  # progress at the end of the search, and of the predictions of held-out episodes
SEARCH_FACTOR, PREDICTION_FACTOR = 0.96, 0.8  # factor of each fit on the remaining progress of these two stages
MAX_ROUNDS = 6  # most rounds of adding, exchanging and dropping


@dataclass(frozen=True, eq=False)
class Evidence:
    """Test of a cause: the model with the cause compared with the model refitted without it.

    Attributes:
        name: Name of the cause.
        gain: ``(units,)`` held-out energy that the cause removes, in units of the noise.
        needed: Energy the cause must remove: the materiality threshold plus the misfit tolerated from the other causes.
        amount: Size of the cause's values, in units of the smallest size of interest.
        kept: Whether the cause passes the test.
    """

    name: str
    gain: FloatArray
    needed: float
    amount: float
    kept: bool

    @property
    def share(self) -> float:
        """Gain as a share of the required gain."""
        return float(self.gain.sum()) / max(self.needed, 1e-12)


class Search:
    """A search for the causes in a recording, with a cache of its fits.

    Attributes:
        problem: The recording.
        folds: The folds.
        rules: Thresholds and limits of the search.
        material: Materiality threshold: the energy that a cause must remove to matter, in units of the noise.
    """

    def __init__(
        self, problem: Problem, causes: Iterable[Cause], folds: Folds, rules: Rules, jobs: int = 1,
        tell: Callable[[str, float], None] = lambda stage, share: None,
    ) -> None:  # fmt: skip
        """Prepare the search; nothing is fitted yet."""
        self.problem, self.folds, self.rules, self._jobs, self._tell = problem, folds, rules, jobs, tell
        self.material = (rules.material + rules.replayed * problem.excused) * problem.samples
        self.causes = {c.name: c for c in causes}
        self.fitter = Fitter(problem, folds)
        self._fits: dict[frozenset[str], Fit] = {}
        self._rankings: dict[frozenset[str], Ranking] = {}
        self._bare: dict[frozenset[str], Fit] = {}  # by set: fit without its nuisance
        self._lacking: dict[tuple[frozenset[str], str, tuple[str, ...]], Fit] = {}  # by set, cause and parts left out
        self._exact: dict[Fit, Fit] = {}
        self._beside = ""

    def run(self) -> tuple[str, ...]:
        """The names of the causes that pass the test."""
        nuisances = tuple(c.name for c in self.causes.values() if c.nuisance)
        found = self._climbed(nuisances)
        needed = len(found) > len(nuisances) or any(
            self.evidence(found, n).kept for n in nuisances if not self.causes[n].tacit
        )
        if any(not self.causes[n].tacit for n in nuisances) and needed and self.problem.counting.is_steep:
            # a zero offset visible only under load absorbs other effects, so it must be worth its price, too
            bare = self._climbed(tuple(n for n in nuisances if self.causes[n].tacit))
            without = [tuple(n for n in names if n not in nuisances or self.causes[n].tacit) for names in (found, bare)]
            sets = dict.fromkeys(filter(None, (found, bare, *without)))
            found = min(sets, key=lambda names: self.objective(names, nuisances=True, exact=True))
        return self._climbed(found) if self._pruned(found) else found

    def _pruned(self, chosen: tuple[str, ...]) -> bool:
        """Leave out the parts of the chosen causes that are small or gain nothing; return whether there were any.

        A part that gains a little stays in the model, although it is not reported.
        """
        pruned = False
        while failed := [
            e for n in chosen for e in self.evidence_of_parts(chosen, n) if e.gain.sum() <= 0 or e.amount < 1
        ]:
            weakest = min(failed, key=lambda e: e.share).name
            name, part = next((n, p) for n in chosen for p in self.causes[n].parts if p.name == weakest)
            self._replace(self.causes[name].lacking(part))
            pruned = True
        return pruned

    def evidence_of_parts(self, chosen: Sequence[str], name: str) -> list[Evidence]:
        """Test each part of a cause of a set: the model compared with the model refitted without the part."""
        item, fit = self.causes[name], self.fit(chosen)
        needed = self.material + self._misfit(fit, name)
        out = []
        for part in item.parts if len(item.parts) > 1 else ():
            amount = item.amount_of(part, fit.whole.values[name], self.problem)  # type: ignore[arg-type]
            gain = self.lacking(chosen, name, [part]).heldout - fit.heldout
            out.append(Evidence(part.name, gain, needed, amount, self._passes(gain, needed, amount)))
        return out

    def lacking(self, names: Sequence[str], name: str, parts: Sequence[CausePart]) -> Fit:
        """The fit of a set without some parts of one of its causes; cached."""
        key = frozenset(names), name, tuple(part.name for part in parts)
        if key not in self._lacking:
            start = self.fit(names)
            for part in parts:
                start = start.lacking(name, part, self.problem)
            self._lacking[key] = self.fitter.fit(start.causes, start)
        return self._lacking[key]

    def _misfit(self, fit: Fit, name: str) -> float:
        """Energy that the forms of the other causes may leave unexplained, which a cause could gain."""
        return sum(self.causes[n].misfit * energy for n, energy in fit.effects.items() if n != name)

    def _replace(self, item: Cause) -> None:
        """Replace a cause, and forget the fits that contain it."""
        self.causes[item.name] = item
        for cache in (self._fits, self._bare, self._rankings):
            for key in [key for key in cache if item.name in key]:
                del cache[key]
        self._lacking = {key: fit for key, fit in self._lacking.items() if item.name not in key[0]}

    def _passes(self, gain: FloatArray, needed: float, amount: float) -> bool:
        total = float(gain.sum())
        z_score = total / max(float(np.linalg.norm(self.folds.independent(gain))), 1e-12)
        return total > needed and z_score >= self.rules.consistency and amount >= 1

    def _climbed(self, chosen: tuple[str, ...]) -> tuple[str, ...]:
        """The set reached by adding, exchanging and dropping causes until nothing improves."""
        seen: set[frozenset[str]] = set()
        for _ in range(MAX_ROUNDS):
            shown = self._shown(chosen)
            self._beside = f"looking for a cause beside {', '.join(shown)}" if shown else "looking for the first cause"
            self._say()
            better = self._dropped(self._exchanged(self._added(chosen)))
            if frozenset(better) in seen or set(better) == set(chosen):
                break
            seen.add(frozenset(better))
            chosen = better
        return chosen

    def fit(self, names: Sequence[str], start: Fit | None = None) -> Fit:
        """The fit of a set of causes; cached."""
        key = frozenset(names)
        if key not in self._fits:
            self._fits[key] = self.fitter.fit([self.causes[n] for n in names], start)
            self._say()
        return self._fits[key]

    def exact(self, fit: Fit) -> Fit:
        """The fit with independently fitted folds, see `Fitter.exact`; cached."""
        if fit not in self._exact:
            self._exact[fit] = self.fitter.exact(fit)
            self._say()
        return self._exact[fit]

    def without(self, names: Sequence[str], name: str) -> Fit:
        """The fit of a set without one of its causes; without a nuisance, the constant that other causes own stays."""
        fewer = [n for n in names if n != name]
        if not self.causes[name].nuisance:
            return self.fit(fewer, self.fit(names))
        key = frozenset(names)
        if key not in self._bare:
            constant = owned_constant(self.problem, self.fit(names))
            self._bare[key] = self.fitter.fit([self.causes[n] for n in fewer], self.fit(names), constant)
        return self._bare[key]

    def confirmed(self, chosen: tuple[str, ...]) -> tuple[str, ...]:
        """The causes that pass the test with independently fitted folds; the weakest is dropped first."""
        return self._dropped(chosen, exact=True)

    def evidence(self, names: Sequence[str], name: str, exact: bool = False) -> Evidence:
        """Test one cause of a set; `exact` uses independently fitted folds."""
        item = self.causes[name]
        fit, without = self.fit(names), self.without(names, name)
        if item.parts:  # what its calibration convention owns is not enough to name it
            without = min(without, self.lacking(names, name, item.parts), key=lambda own: own.heldout.sum())
        if exact:
            fit, without = self.exact(fit), self.exact(without)
        gain = without.heldout - fit.heldout
        needed = item.price * self.material + self._misfit(fit, name)
        amount = np.inf
        if item.course is None:
            amount = item.amount(fit.whole.values[name], self.problem)
        kept = self._passes(gain, needed, amount) and not (item.course and self._is_contradicted(fit, name))
        return Evidence(name, gain, needed, amount, kept)

    def _is_contradicted(self, fit: Fit, name: str) -> bool:
        """Whether the samples at rest speak against an offset: it is there without contact, too.

        An offset that is only the mean of what another form leaves over helps under load and does harm at rest.
        """
        rows = self.fitter.rows(fit.causes, fit.shapes)
        rest, zero = rows.at_rest, fit.whole.zero
        assert rows.curves is not None
        own = rows.curves_owned_by(name)
        whole = np.tensordot(rows.curves.T[rest], zero, 1) + fit.constant
        without = whole - np.tensordot(rows.curves[own].T[rest], zero[own], 1)
        errors = [
            float(np.sum((rows.weight[rest] * (rows.measured[rest] - rows.read(offset))) ** 2))
            for offset in (whole, without)
        ]
        return (errors[0] - errors[1]) * self.fitter.samples > self.material

    def ranked(self, names: Sequence[str]) -> list[tuple[float, str]]:
        """Linearised gain and name of each cause that could be added to a set, largest first."""
        ranking = self._ranking(names)
        return sorted(((ranking.gain([n]), n) for n in ranking.causes), reverse=True)

    def objective(self, names: Sequence[str], nuisances: bool = False, exact: bool = False) -> float:
        """Score of a set, lower is better: the held-out error plus the materiality threshold times the causes' prices.

        Args:
            names: Names of the causes in the set.
            nuisances: Whether to include the prices of nuisances.
            exact: Whether to use independently fitted folds.
        """
        fit = self.exact(self.fit(names)) if exact else self.fit(names)
        price = sum(self.causes[n].price for n in names if nuisances or not self.causes[n].nuisance)
        return float(fit.heldout.sum()) + self.material * price

    def near_misses(self, names: Sequence[str]) -> dict[str, float]:
        """Gain relative to the required gain of each cause that was added to a set and failed the test."""
        found = {}
        for key in list(self._fits):
            extra = key - set(names)
            if len(extra) == 1 and set(names) < key:
                name = next(iter(extra))
                evidence = self.evidence([*names, name], name)
                if not evidence.kept and evidence.amount >= 1:
                    found[name] = evidence.share
        return found

    def _say(self) -> None:
        """Report progress; as the number of fits is unknown, each fit advances it by a share of the remainder."""
        if self._exact:
            left = PREDICTION_FACTOR ** len(self._exact)
            self._tell("predicting held-out episodes", PREDICTION_END - (PREDICTION_END - SEARCH_END) * left)
        elif self._beside:
            self._tell(self._beside, SEARCH_END * (1 - SEARCH_FACTOR ** len(self._fits)))

    def _shown(self, names: Sequence[str]) -> list[str]:
        return [n for n in names if not self.causes[n].nuisance]

    def _ranking(self, names: Sequence[str]) -> Ranking:
        key = frozenset(names)
        if key not in self._rankings:
            self._rankings[key] = Ranking(self.fitter, list(self.causes.values()), self.fit(names))
        return self._rankings[key]

    def _candidates(self, names: Sequence[str], most: int) -> list[tuple[str, ...]]:
        """Causes to try adding: those fitted in closed form, and the `most` others with the largest promise."""
        least = self.rules.promise * self.material
        local = [n for n, c in self.causes.items() if n not in names and (c.local or c.course)]
        promising = [n for gain, n in self.ranked(names)[:most] if gain > least]
        return [(n,) for n in (*local, *promising)]

    def _pairs(self, names: Sequence[str]) -> list[tuple[str, ...]]:
        """Pairs whose joint promise exceeds the best single promise by more than the materiality threshold."""
        if len(self._shown(names)) > self.rules.most - 2:
            return []
        ranking = self._ranking(names)
        alone = {n: gain for gain, n in self.ranked(names)}
        best = max(alone.values(), default=0.0)
        gains = [(ranking.gain([a, b]), (a, b)) for i, a in enumerate(alone) for b in list(alone)[i + 1 :]]
        promising = sorted((g for g in gains if g[0] > best + self.material), reverse=True)
        return [pair for _, pair in promising[: self.rules.pairs]]

    def _added(self, chosen: tuple[str, ...]) -> tuple[str, ...]:
        if len(self._shown(chosen)) >= self.rules.most:
            return chosen
        sets = [(*chosen, *extra) for extra in (*self._candidates(chosen, self.rules.contest), *self._pairs(chosen))]
        self._fit_all(sets, self.fit(chosen))
        promised = {name: gain for gain, name in self.ranked(chosen)}
        begun = len(self._shown(chosen)) < AFRESH
        doubtful = [names for names in sets if begun and self._falls_short(chosen, names, promised)]
        parallel_map(self._begun_afresh, doubtful, self._jobs)
        better = [names for names in sets if self.objective(names) < self.objective(chosen)]
        kept = [names for names in better if all(self.evidence(names, n).kept for n in names if n not in chosen)]
        return next(iter(self._by_merit(kept)), chosen)

    def _exchanged(self, chosen: tuple[str, ...]) -> tuple[str, ...]:
        """The set after replacing causes by others with a smaller held-out error."""
        for name in self._shown(chosen):
            rest = tuple(n for n in chosen if n != name)
            self.fit(rest, self.fit(chosen))
            sets = [(*rest, *extra) for extra in self._candidates(rest, self.rules.contest - 1) if extra != (name,)]
            self._fit_all(sets, self.fit(rest))
            best = self._by_merit([chosen, *sets])[0]
            if best != chosen and self.evidence(best, best[-1]).kept:
                return self._exchanged(best) if len(best) == len(chosen) else best
        return chosen

    def _dropped(self, chosen: tuple[str, ...], exact: bool = False) -> tuple[str, ...]:
        """The set without the causes that fail the test; the weakest is dropped first."""
        while True:
            if exact:  # each takes many fits
                parallel_map(self.exact, [self.without(chosen, name) for name in self._shown(chosen)], self._jobs)
            failed = [e for n in self._shown(chosen) if not (e := self.evidence(chosen, n, exact)).kept]
            if not failed:
                return chosen
            weakest = min(failed, key=lambda e: e.share).name
            chosen = tuple(n for n in chosen if n != weakest)

    def _by_merit(self, sets: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
        """The sets in order of preference.

        Sets whose causes have only a few parameters each and whose objective is within the materiality threshold of the
        best come first, the one with the fewest parameters leading. The others follow by objective.
        """
        least = min(map(self.objective, sets), default=0.0) + self.material

        def merit(names: tuple[str, ...]) -> tuple[float, float]:
            numbers = sum(len(self.causes[n].parameters(self.problem)) for n in names)
            left = self.objective(names)
            return (numbers, left) if left < least and self._is_plain(names) else (np.inf, left)

        return sorted(sets, key=merit)

    def _is_plain(self, names: tuple[str, ...]) -> bool:
        """Whether each cause of the set has only a few parameters."""
        return all(
            self.causes[n].local is None and (self.causes[n].nuisance or not self.causes[n].course) for n in names
        )

    def _falls_short(self, chosen: tuple[str, ...], names: tuple[str, ...], promised: Mapping[str, float]) -> bool:
        """Whether a fit gains much less than its new cause promised, as when another cause absorbs its effect."""
        promise = promised.get(names[-1], 0.0) if len(names) == len(chosen) + 1 else 0.0
        gain = float((self.fit(chosen).heldout - self.fit(names).heldout).sum())
        return promise > self.material and gain < self.rules.delivered * promise

    def _begun_afresh(self, names: tuple[str, ...]) -> None:
        """Refit a set from its causes' own starts, the newest cause first, and keep the better fit."""
        again = self.fitter.fit([self.causes[n] for n in reversed(names)])
        if again.energy.sum() < self.fit(names).energy.sum():
            self._fits[frozenset(names)] = again

    def _fit_all(self, sets: Sequence[tuple[str, ...]], start: Fit) -> None:
        parallel_map(lambda names: self.fit(names, start), sets, self._jobs)


def owned_constant(problem: Problem, fit: Fit) -> FloatArray:
    """``(pads, 3, rows, cols)`` N, the part of a fitted offset that other causes of the set own by convention.

    A field need not be zero in the pose at the start of the recording, so it owns a plane plus a multiple of its
    amplitudes.
    """
    zeros = fit.zeros
    constant = next((zeros[c.name][0] for c in courses_of(fit.causes) if c.nuisance), np.zeros(problem.alive.shape))
    fields = [zeros[c.name] for c in courses_of(fit.causes) if c.planes]
    if not fields:
        return np.zeros_like(constant)
    amounts = np.concatenate(fields)
    plane, amounts = problem.planes(constant), amounts - problem.planes(amounts)
    basis = (amounts * problem.alive).reshape(len(amounts), -1).T
    shares = np.linalg.lstsq(basis, ((constant - plane) * problem.alive).ravel(), rcond=1e-6)[0]
    return np.asarray(plane + np.tensordot(shares, amounts, 1), dtype=np.float64)
