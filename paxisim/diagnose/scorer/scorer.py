"""Scorer: fits sets of causes, and says what each set and each of its causes gains on held-out samples."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from paxisim.diagnose.causes.kinds import BaselineCause, Cause, FittedCause, baseline_causes
from paxisim.diagnose.causes.parameters import CausePart
from paxisim.diagnose.data.folds import Folds, folds_of
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.scorer.fitting import Fit, Fitter
from paxisim.diagnose.scorer.ranking import Ranking
from paxisim.parallel import parallel_map

SEARCH_END, PREDICTION_END = 0.45, 0.8  # progress at the end of the search, and of the predictions of held-out episodes
SEARCH_FACTOR, PREDICTION_FACTOR = 0.96, 0.8  # factor of each fit on the remaining progress of these two stages


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


class Scorer:
    """Fits, held-out errors and evidence of sets of causes; nothing is fitted twice.

    A set is a sequence of names in any order.

    Attributes:
        problem: The recording.
        causes: The causes by name.
        folds: The folds.
        rules: Thresholds and limits.
        jobs: Number of processors.
        fitter: Fits a set of causes.
        material: Materiality threshold: the energy that a cause must remove to matter, in units of the noise.
    """

    def __init__(
        self, problem: Problem, causes: Iterable[Cause], rules: Rules, folds: Folds | None = None, jobs: int = 1,
        tell: Callable[[str, float], None] = lambda stage, share: None,
    ) -> None:  # fmt: skip
        """Prepare the fits; nothing is fitted yet. The default folds are those that suit the recording and causes."""
        self.problem, self.rules, self.jobs, self._tell = problem, rules, jobs, tell
        self.causes = {c.name: c for c in causes}
        if folds is None:
            thin = problem.thinned
            shown = (effect for c in self.causes.values() for effect in c.effects(thin, thin.simulated))
            folds = folds_of(problem, shown, rules)
        self.folds = folds
        self.material = (rules.material + rules.replayed * problem.noise.excused) * problem.samples
        self.fitter = Fitter(problem, folds, jobs)
        self._stage = ""
        self._fits: dict[frozenset[str], Fit] = {}
        self._rankings: dict[frozenset[str], Ranking] = {}
        self._bare: dict[frozenset[str], Fit] = {}  # by set: fit without its nuisance
        self._lacking: dict[tuple[frozenset[str], str, tuple[str, ...]], Fit] = {}  # by set, cause and parts left out
        self._exact: dict[Fit, Fit] = {}

    def shown(self, names: Sequence[str]) -> list[str]:
        """The causes of a set that are no nuisances."""
        return [n for n in names if not self.causes[n].nuisance]

    def fit(self, names: Sequence[str], start: Fit | None = None) -> Fit:
        """The fit of a set of causes; cached."""
        key = frozenset(names)
        if key not in self._fits:
            self._fits[key] = self.fitter.fit([self.causes[n] for n in names], start)
            self._say()
        return self._fits[key]

    def fit_all(self, sets: Sequence[tuple[str, ...]], start: Fit) -> None:
        """Fit several sets in parallel, so that each fit is cached."""
        parallel_map(lambda names: self.fit(names, start), sets, self.jobs)

    def fit_afresh(self, sets: Sequence[tuple[str, ...]]) -> None:
        """Refit sets from their causes' own starts, the newest cause first, and keep the better fits."""

        def refit(names: tuple[str, ...]) -> None:
            again = self.fitter.fit([self.causes[n] for n in reversed(names)])
            if again.energy.sum() < self.fit(names).energy.sum():
                self._fits[frozenset(names)] = again

        parallel_map(refit, sets, self.jobs)

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

    def lacking(self, names: Sequence[str], name: str, parts: Sequence[CausePart]) -> Fit:
        """The fit of a set without some parts of one of its causes; cached."""
        key = frozenset(names), name, tuple(part.name for part in parts)
        if key not in self._lacking:
            start = self.fit(names)
            for part in parts:
                start = start.lacking(name, part, self.problem)
            self._lacking[key] = self.fitter.fit(start.causes, start)
        return self._lacking[key]

    def leave_out(self, names: Sequence[str], part_name: str) -> None:
        """Replace a cause of a set by the cause without one of its parts."""
        items = [c for c in map(self.causes.__getitem__, names) if isinstance(c, FittedCause)]
        self.put(next(c.lacking(part) for c in items for part in c.parts if part.name == part_name))

    def put(self, item: Cause) -> None:
        """Replace the cause of this name, and forget the fits that contain it."""
        name = item.name
        self.causes[name] = item
        for cache in (self._fits, self._bare, self._rankings):
            for key in [key for key in cache if name in key]:
                del cache[key]
        self._lacking = {key: fit for key, fit in self._lacking.items() if name not in key[0]}

    def ranking(self, names: Sequence[str]) -> Ranking:
        """Linearised gains of the causes that could be added to a set; cached."""
        key = frozenset(names)
        if key not in self._rankings:
            self._rankings[key] = Ranking(self.fitter, list(self.causes.values()), self.fit(names), self.rules)
        return self._rankings[key]

    def ranked(self, names: Sequence[str]) -> list[tuple[float, str]]:
        """Linearised gain and name of each cause that could be added to a set, largest first."""
        ranking = self.ranking(names)
        return sorted(((ranking.gain([n]), n) for n in ranking.causes), reverse=True)

    def objective(self, names: Sequence[str], nuisances: bool = False, exact: bool = False) -> float:
        """Score of a set, lower is better: the held-out error plus the materiality threshold times the causes' prices.

        Args:
            names: Names of the causes in the set.
            nuisances: Whether to include the prices of nuisances.
            exact: Whether to use independently fitted folds.
        """
        fit = self.exact(self.fit(names)) if exact else self.fit(names)
        prices = (self._price(n) for n in names if nuisances or not self.causes[n].nuisance)
        return float(fit.heldout.sum()) + sum(prices)

    def evidence(self, names: Sequence[str], name: str, exact: bool = False) -> Evidence:
        """Test one cause of a set; `exact` uses independently fitted folds."""
        item = self.causes[name]
        fit, without = self.fit(names), self.without(names, name)
        if isinstance(item, FittedCause) and item.parts:
            # what its calibration convention owns is not enough to name it
            without = min(without, self.lacking(names, name, item.parts), key=lambda own: own.heldout.sum())
        if exact:
            fit, without = self.exact(fit), self.exact(without)
        gain = without.heldout - fit.heldout
        needed = self._price(name) + self._misfit(fit, name)
        is_offset = isinstance(item, BaselineCause)
        amount = np.inf if is_offset else item.amount(fit.whole.values[name], self.problem)
        kept = self._passes(gain, needed, amount) and not (is_offset and self._is_contradicted(fit, name))
        return Evidence(name, gain, needed, amount, kept)

    def evidence_of_parts(self, names: Sequence[str], name: str) -> list[Evidence]:
        """Test each part of a cause of a set: the model compared with the model refitted without the part."""
        item, fit = self.causes[name], self.fit(names)
        if not isinstance(item, FittedCause) or len(item.parts) < 2:
            return []
        needed = self.material + self._misfit(fit, name) + self.rules.tie * fit.effects[name]
        out = []
        for part in item.parts:
            amount = item.amount_of(part, fit.whole.values[name], self.problem)
            gain = self.lacking(names, name, [part]).heldout - fit.heldout
            out.append(Evidence(part.name, gain, needed, amount, self._passes(gain, needed, amount)))
        return out

    def near_misses(self, names: Sequence[str]) -> dict[str, float]:
        """Gain relative to the required gain of each cause that was added to a set and failed the test."""
        more = [key.difference(names) for key in self._fits if key > set(names)]
        tests = [self.evidence([*names, name], name) for added in more if len(added) == 1 for name in added]
        return {test.name: test.share for test in tests if not test.kept and test.amount >= 1}

    def _price(self, name: str) -> float:
        """Energy that a cause must gain to matter."""
        return self.material * self.causes[name].price * self.causes[name].copies(self.problem)

    def _misfit(self, fit: Fit, name: str) -> float:
        """Energy that the forms of the other causes may leave unexplained, which a cause could gain."""
        return sum(self.causes[n].misfit * energy for n, energy in fit.effects.items() if n != name)

    def _passes(self, gain: FloatArray, needed: float, amount: float) -> bool:
        total = float(gain.sum())
        z_score = total / max(float(np.linalg.norm(self.folds.independent(gain))), 1e-12)
        return total > needed and z_score >= self.rules.consistency and amount >= 1

    def _is_contradicted(self, fit: Fit, name: str) -> bool:
        """Whether the samples at rest speak against an offset: it is there without contact, too.

        An offset that is only the mean of what another form leaves over helps under load and does harm at rest.
        """
        rows = self.fitter.rows(fit.causes, fit.shapes)
        rest, zero = rows.at_rest, fit.whole.zero
        assert rows.curves is not None
        curves, own = rows.curves.values, rows.curves.owned_by(name)
        whole = np.tensordot(curves.T[rest], zero, 1) + fit.constant
        without = whole - np.tensordot(curves[own].T[rest], zero[own], 1)
        errors = [
            float(np.sum((rows.weight[rest] * (rows.measured[rest] - rows.read(offset))) ** 2))
            for offset in (whole, without)
        ]
        return (errors[0] - errors[1]) * self.fitter.samples > self.material

    def begin(self, stage: str) -> None:
        """Name the stage whose progress is reported from now on."""
        self._stage = stage
        self._say()

    def _say(self) -> None:
        """Report progress; as the number of fits is unknown, each fit advances it by a share of the remainder."""
        if self._exact:
            left = PREDICTION_FACTOR ** len(self._exact)
            self._tell("predicting held-out episodes", PREDICTION_END - (PREDICTION_END - SEARCH_END) * left)
        elif self._stage:
            self._tell(self._stage, SEARCH_END * (1 - SEARCH_FACTOR ** len(self._fits)))


def owned_constant(problem: Problem, fit: Fit) -> FloatArray:
    """``(pads, 3, rows, cols)`` N, the part of a fitted offset that other causes of the set own by convention.

    A field need not be zero in the pose at the start of the recording, so it owns a plane plus a multiple of its
    amplitudes.
    """
    zeros = fit.zeros
    causes = baseline_causes(fit.causes)
    constant = next((zeros[c.name][0] for c in causes if c.nuisance), np.zeros(problem.alive.shape))
    fields = [zeros[c.name] for c in causes if c.planes]
    if not fields:
        return np.zeros_like(constant)
    amounts = np.concatenate(fields)
    plane, amounts = problem.baseline.planes(constant), amounts - problem.baseline.planes(amounts)
    basis = (amounts * problem.alive).reshape(len(amounts), -1).T
    shares = np.linalg.lstsq(basis, ((constant - plane) * problem.alive).ravel(), rcond=1e-6)[0]
    return np.asarray(plane + np.tensordot(shares, amounts, 1), dtype=np.float64)
