"""Search: causes are added, exchanged and dropped, and each set is scored by what it leaves on held-out episodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paxisim.diagnose.cause import Cause, courses_of
from paxisim.diagnose.fitting import Fit, Fitter
from paxisim.diagnose.folds import Folds
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.ranking import Ranking
from paxisim.diagnose.rules import Rules
from paxisim.parallel import parallel_map

AFRESH = 2  # causes, from which on no fit is repeated from the causes' own starts
SEARCHED, PREDICTS = 0.45, 0.8  # of the work, when the search and the predictions of held-out episodes are done
FITTED, PREDICTED = 0.96, 0.8  # of what is left of them, after one more fit
ROUNDS = 6  # of adding, exchanging and dropping at most


@dataclass(frozen=True, eq=False)
class Evidence:
    """What speaks for a cause: the model with it against the model fitted again without it.

    Attributes:
        name: Of the cause.
        gain: ``(units,)`` energy that it takes away on held-out units, in units of the noise.
        needed: Energy that it must take away: what is material, and what the misfit of the other causes may leave.
        amount: How large its values are, in units of the smallest size of interest.
        kept: Whether it passes the test.
    """

    name: str
    gain: FloatArray
    needed: float
    amount: float
    kept: bool

    @property
    def share(self) -> float:
        """What it gains as a share of what it must."""
        return float(self.gain.sum()) / max(self.needed, 1e-12)


class Search:
    """A search for the causes of a recording, with the fits that it has made.

    Attributes:
        problem: The recording.
        folds: What is held out together.
        rules: What decides.
        material: Energy that a cause must take away to matter.
    """

    def __init__(
        self, problem: Problem, causes: Iterable[Cause], folds: Folds, rules: Rules, jobs: int = 1,
        tell: Callable[[str, float], None] = lambda stage, share: None,
    ) -> None:  # fmt: skip
        """Nothing is fitted yet."""
        self.problem, self.folds, self.rules, self._jobs, self._tell = problem, folds, rules, jobs, tell
        self.material = (rules.material + rules.replayed * problem.excused) * problem.samples
        self.causes = {c.name: c for c in causes}
        self.fitter = Fitter(problem, folds)
        self._fits: dict[frozenset[str], Fit] = {}
        self._rankings: dict[frozenset[str], Ranking] = {}
        self._bare: dict[frozenset[str], Fit] = {}  # of sets, without their nuisance but for what the others own of it
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
            # a zero that shows only under load takes up what other causes do: it must be worth its price as they must
            bare = self._climbed(tuple(n for n in nuisances if self.causes[n].tacit))
            found = min(found, bare, key=lambda names: self.objective(names, nuisances=True))
        return found

    def _climbed(self, chosen: tuple[str, ...]) -> tuple[str, ...]:
        """The set that adding, exchanging and dropping lead to."""
        seen: set[frozenset[str]] = set()
        for _ in range(ROUNDS):
            self._beside = f"looking for a cause beside {', '.join(self._shown(chosen)) or 'none'}"
            self._say()
            better = self._dropped(self._exchanged(self._added(chosen)))
            if frozenset(better) in seen or set(better) == set(chosen):
                break
            seen.add(frozenset(better))
            chosen = better
        return chosen

    def fit(self, names: Sequence[str], start: Fit | None = None) -> Fit:
        """The fit of a set of causes, made once."""
        key = frozenset(names)
        if key not in self._fits:
            self._fits[key] = self.fitter.fit([self.causes[n] for n in names], start)
            self._say()
        return self._fits[key]

    def exact(self, fit: Fit) -> Fit:
        """A fit with folds that are fitted on their own, see `Fitter.exact`; made once."""
        if fit not in self._exact:
            self._exact[fit] = self.fitter.exact(fit)
            self._say()
        return self._exact[fit]

    def without(self, names: Sequence[str], name: str) -> Fit:
        """The fit of a set without one of its causes; the constant that the others own stays without a nuisance."""
        fewer = [n for n in names if n != name]
        if not self.causes[name].nuisance:
            return self.fit(fewer, self.fit(names))
        key = frozenset(names)
        if key not in self._bare:
            constant = owned_constant(self.problem, self.fit(names))
            self._bare[key] = self.fitter.fit([self.causes[n] for n in fewer], self.fit(names), constant)
        return self._bare[key]

    def confirmed(self, chosen: tuple[str, ...]) -> tuple[str, ...]:
        """The causes that pass the test with folds that are fitted on their own, the weakest dropped first."""
        return self._dropped(chosen, exact=True)

    def evidence(self, names: Sequence[str], name: str, exact: bool = False) -> Evidence:
        """What speaks for one cause of a set."""
        item = self.causes[name]
        fit, without = self.fit(names), self.without(names, name)
        if exact:
            fit, without = self.exact(fit), self.exact(without)
        gain = without.heldout - fit.heldout
        needed = item.price * self.material
        needed += sum(self.causes[n].misfit * energy for n, energy in fit.effects.items() if n != name)
        amount = np.inf
        if item.course is None:
            amount = item.amount(fit.whole.values[name], self.problem)
        total = float(gain.sum())
        apart = self.folds.independent(gain)
        z_score = total / max(float(np.linalg.norm(apart)), 1e-12)
        kept = total > needed and z_score >= self.rules.consistency and amount >= 1
        return Evidence(name, gain, needed, amount, kept)

    def ranked(self, names: Sequence[str]) -> list[tuple[float, str]]:
        """What each other cause with starts promises beside a set, largest first."""
        ranking = self._ranking(names)
        others = [n for n in ranking.causes if n not in names]
        return sorted(((ranking.gain([n]), n) for n in others), reverse=True)

    def objective(self, names: Sequence[str], nuisances: bool = False) -> float:
        """What is left on held-out units, and what the causes must bring: the less, the better the set.

        Args:
            names: The set.
            nuisances: Whether they must bring something, too.
        """
        price = sum(self.causes[n].price for n in names if nuisances or not self.causes[n].nuisance)
        return float(self.fit(names).heldout.sum()) + self.material * price

    def near_misses(self, names: Sequence[str]) -> dict[str, float]:
        """Causes that were fitted beside a set and fall short, with what they gain as a share of what they must."""
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
        """Say what is done; how many fits will be needed is not known, so that each is a share of what is left."""
        if self._exact:
            left = PREDICTED ** len(self._exact)
            self._tell("predicting held-out episodes", PREDICTS - (PREDICTS - SEARCHED) * left)
        elif self._beside:
            self._tell(self._beside, SEARCHED * (1 - FITTED ** len(self._fits)))

    def _shown(self, names: Sequence[str]) -> list[str]:
        return [n for n in names if not self.causes[n].nuisance]

    def _ranking(self, names: Sequence[str]) -> Ranking:
        key = frozenset(names)
        if key not in self._rankings:
            self._rankings[key] = Ranking(self.fitter, list(self.causes.values()), self.fit(names))
        return self._rankings[key]

    def _candidates(self, names: Sequence[str], most: int) -> list[tuple[str, ...]]:
        """Causes that may be added: those fitted in closed form, and those that promise most."""
        least = self.rules.promise * self.material
        local = [n for n, c in self.causes.items() if n not in names and (c.local or c.course)]
        promising = [n for gain, n in self.ranked(names)[:most] if gain > least]
        return [(n,) for n in (*local, *promising)]

    def _pairs(self, names: Sequence[str]) -> list[tuple[str, ...]]:
        """Pairs that promise more together than each with the best of the others alone."""
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
        """With each cause replaced by another that leaves less."""
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
        """Without the causes that fail the test, the weakest first."""
        while True:
            if exact:  # each is many fits
                parallel_map(self.exact, [self.without(chosen, name) for name in self._shown(chosen)], self._jobs)
            failed = [e for n in self._shown(chosen) if not (e := self.evidence(chosen, n, exact)).kept]
            if not failed:
                return chosen
            weakest = min(failed, key=lambda e: e.share).name
            chosen = tuple(n for n in chosen if n != weakest)

    def _by_merit(self, sets: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
        """Sets by what they leave; of those that leave as little as the best but for what is material, the simplest."""
        least = min(map(self.objective, sets), default=0.0) + self.material

        def merit(names: tuple[str, ...]) -> tuple[float, float]:
            numbers = sum(len(self.causes[n].parameters(self.problem)) for n in names)
            left = self.objective(names)
            return (0.0, numbers) if left < least and self._is_plain(names) else (1.0, left)

        return sorted(sets, key=merit)

    def _is_plain(self, names: tuple[str, ...]) -> bool:
        """Whether all causes have a few numbers each."""
        return all(
            self.causes[n].local is None and (self.causes[n].nuisance or not self.causes[n].course) for n in names
        )

    def _falls_short(self, chosen: tuple[str, ...], names: tuple[str, ...], promised: Mapping[str, float]) -> bool:
        """Whether a fit gains much less than its new cause promised: another cause may hold its place."""
        promise = promised.get(names[-1], 0.0) if len(names) == len(chosen) + 1 else 0.0
        gain = float((self.fit(chosen).heldout - self.fit(names).heldout).sum())
        return promise > self.material and gain < self.rules.delivered * promise

    def _begun_afresh(self, names: tuple[str, ...]) -> None:
        """Fit a set from its causes' own starts, the newest first, and keep the better fit."""
        again = self.fitter.fit([self.causes[n] for n in reversed(names)])
        if again.energy.sum() < self.fit(names).energy.sum():
            self._fits[frozenset(names)] = again

    def _fit_all(self, sets: Sequence[tuple[str, ...]], start: Fit) -> None:
        parallel_map(lambda names: self.fit(names, start), sets, self._jobs)


def owned_constant(problem: Problem, fit: Fit) -> FloatArray:
    """``(pads, 3, rows, cols)`` N, the part of a fitted offset that other causes of the set bring by convention.

    A field need not be zero in the pose in which the recording begins, so it owns a plane and a multiple of its
    amounts.
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
