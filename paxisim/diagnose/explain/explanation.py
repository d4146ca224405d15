"""Explanation: the causes that a search has kept, the extended model, and its in-sample and held-out predictions."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paxisim import augment
from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.detected import ReadOff, read_off
from paxisim.diagnose.causes.kinds import BaselineCause, Cause, FittedCause, PerChannelCause, baseline_causes
from paxisim.diagnose.causes.parameters import CausePart
from paxisim.diagnose.causes.vocabulary import CAUSES
from paxisim.diagnose.data.folds import Folds
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.scorer.fitting import Fit, Fitter, Part, with_curves
from paxisim.diagnose.scorer.model import Model, in_order
from paxisim.diagnose.scorer.scorer import Evidence, Scorer
from paxisim.diagnose.search import confirmed
from paxisim.parallel import parallel_map


@dataclass(frozen=True, eq=False)
class Named:
    """A cause supported by the recording.

    Attributes:
        cause: The cause.
        transform: The cause's transform with the fitted values.
        values: Fitted parameters and arrays by name, in the units of the cause's parameters, or N.
        evidence: Evidence for a fitted cause; None for a cause that a deterministic check detected.
    """

    cause: Cause
    transform: Transform
    values: Mapping[str, float | FloatArray]
    evidence: Evidence | None

    @property
    def name(self) -> str:
        """Name of the cause."""
        return self.cause.name

    @property
    def parts(self) -> tuple[CausePart, ...]:
        """Parts of the cause, if it has any."""
        return self.cause.parts if isinstance(self.cause, FittedCause) else ()


@dataclass(frozen=True, eq=False)
class Explanation:
    """The causes found in a recording, with the extended model.

    Attributes:
        off: Result of the deterministic checks.
        scorer: The scorer, with its fits.
        chosen: Causes that were fitted and kept, including the nuisances fitted with them.
        fit: Their fit.
        named: All named causes, including those detected by the checks, in chain order.
        model: The extended model, to be applied to the recording's simulated stream.
        prediction: ``(T, pads, 3, rows, cols)`` N, output of the model before rounding.
        heldout: The same, with each sample predicted by the fit that left its fold out.
    """

    off: ReadOff
    scorer: Scorer
    chosen: tuple[str, ...]
    fit: Fit
    named: tuple[Named, ...]
    model: augment.Chain
    prediction: FloatArray
    heldout: FloatArray

    @property
    def problem(self) -> Problem:
        """The recording that was explained, after the deterministic checks."""
        return self.off.problem

    @property
    def folds(self) -> Folds:
        """The folds."""
        return self.scorer.folds

    @property
    def fitted(self) -> tuple[Named, ...]:
        """The named causes that were fitted."""
        return tuple(named for named in self.named if named.evidence is not None)


def explanation_of(
    off: ReadOff, scorer: Scorer, chosen: Sequence[str], jobs: int = 1, rejected: Collection[str] = ()
) -> Explanation:
    """Build the explanation from the result of the checks and the causes that a search selected.

    Args:
        off: Result of the checks.
        scorer: The scorer.
        chosen: Names of the selected causes.
        jobs: Number of processors.
        rejected: Names of causes that are not to be named. A nuisance among them is still fitted with the others,
            which need it.
    """
    problem = off.problem
    chosen = confirmed(scorer, [n for n in chosen if n not in rejected or scorer.causes[n].nuisance])
    evidence = {name: scorer.evidence(chosen, name, exact=True) for name in chosen if not scorer.causes[name].tacit}
    asked = {item.name for item in off.causes}.difference(rejected)
    dropped = [n for n, own in evidence.items() if scorer.causes[n].nuisance and not (own.kept and n in asked)]
    fit = scorer.exact(scorer.without(chosen, dropped[0]) if dropped else scorer.fit(chosen))
    every = [Named(item, *_fitted(item, fit, problem), evidence.get(item.name)) for item in fit.causes]
    detected = [(item, off.readings[item.name]) for item in off.causes if item.name in off.readings]
    every += [Named(item, reading.transform, reading.values, None) for item, reading in detected]
    every.sort(key=lambda named: named.cause.order)
    members = [(named.cause.order, named.name, named.transform) for named in every if not named.cause.in_scene]
    if np.any(fit.constant):  # the offset that the causes own by convention
        nuisance = next(c for c in baseline_causes(CAUSES) if c.nuisance)
        members.append((nuisance.order, nuisance.name, nuisance.make(np.asarray(fit.constant), (), problem)))
        members.sort(key=lambda member: member[0])
    return Explanation(
        off,
        scorer,
        chosen,
        fit,
        named=tuple(named for named in every if not named.cause.tacit),
        model=in_order([(name, transform) for _, name, transform in members]),
        prediction=off.with_dead(predicted(problem, fit.causes, fit.whole, fit.constant)),
        heldout=off.with_dead(heldout_of(problem, scorer.folds, fit, jobs)),
    )


def _fitted(item: Cause, fit: Fit, problem: Problem) -> tuple[Transform, dict[str, float | FloatArray]]:
    """The transform of a fitted cause, and its values by name."""
    if isinstance(item, BaselineCause):
        shape = fit.shapes[item.name]
        amounts = np.where(problem.alive, fit.zeros[item.name], 0.0)
        amounts = amounts[0] if len(amounts) == 1 else amounts
        return item.make(amounts, shape, problem), {
            item.amounts: amounts,
            **dict(zip(item.numbers, shape, strict=True)),
        }
    values = fit.whole.values[item.name]
    if isinstance(item, PerChannelCause):
        return item.make(values, problem), {item.array: values}
    assert isinstance(item, FittedCause)
    names = [free.name for free in item.parameters(problem)]
    return item.transform(values, problem), dict(zip(names, map(float, values), strict=True))


def predicted(problem: Problem, causes: Sequence[Cause], part: Part, constant: FloatArray | float) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` N, prediction of a fit for every sample of a recording, before rounding."""
    rows = replace(with_curves(problem, causes, part.shapes), constant=constant)
    return Model(rows, causes, rows).run(part.values, part.zero)


def heldout_of(problem: Problem, folds: Folds, fit: Fit, jobs: int = 1) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` N, prediction of each sample by the fit to the other folds, if it is in one."""
    fold = folds.of_sample
    out = np.empty_like(problem.simulated)

    def fill(number: int) -> None:
        mine = fold == number
        part = fit.whole if number < 0 else fit.folds[number]
        out[mine] = predicted(problem, fit.causes, part, fit.constant)[mine]

    parallel_map(fill, np.unique(fold).tolist(), jobs)
    return out


def reading_without(found: Explanation, named: Named, part: CausePart | None = None, jobs: int = 1) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` N, held-out mean reading of the model refitted without a cause or a part of it.

    Without a cause that a check detected, the model is fitted to the streams as they are without that check.
    """
    if named.evidence is not None:
        prediction = heldout_of(found.problem, found.folds, _fit_without(found, named, part), jobs)
        return found.problem.read(found.off.with_dead(prediction))
    problem = read_off(found.off.raw, [c for c in found.off.causes if c.name != named.name]).problem
    if found.off.readings[named.name].rounds:
        return replace(problem.noise, step=0.0, clips=False).read(found.heldout)
    fitter = Fitter(problem, found.folds, jobs)
    fit = fitter.exact(fitter.fit(found.fit.causes, found.fit, found.fit.constant))
    return problem.read(heldout_of(problem, found.folds, fit, jobs))


def _fit_without(found: Explanation, named: Named, part: CausePart | None) -> Fit:
    """The fit, with independently fitted folds, without a fitted cause or one of its parts."""
    scorer, fit = found.scorer, found.fit
    if part is None and not np.any(fit.constant):  # known from the search
        return scorer.exact(scorer.without(fit.names, named.name))
    start = fit if part is None else fit.lacking(named.name, part, found.problem)
    causes = [c for c in start.causes if part is not None or c.name != named.name]
    return scorer.fitter.exact(scorer.fitter.fit(causes, start, fit.constant))
