"""Explanation: the causes that a search has kept, the extended model, and its in-sample and held-out predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from paxisim import augment
from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.detected import ReadOff, read_off
from paxisim.diagnose.causes.kinds import BaselineCause, Cause, CausePart, FittedCause, PerChannelCause, baseline_causes
from paxisim.diagnose.causes.vocabulary import CAUSES
from paxisim.diagnose.data.folds import Folds
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.scorer.fitting import Fit, Part, with_curves
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


def explanation_of(off: ReadOff, scorer: Scorer, chosen: Sequence[str], jobs: int = 1) -> Explanation:
    """Build the explanation from the result of a search.

    Args:
        off: Result of the deterministic checks.
        scorer: The scorer.
        chosen: Names of the causes that the search selected.
        jobs: Number of processors.
    """
    chosen = confirmed(scorer, chosen)
    asked = {item.name for item in off.causes}
    tacit = {name for name in chosen if scorer.causes[name].tacit}
    evidence = {name: scorer.evidence(chosen, name, exact=True) for name in chosen if name not in tacit}
    dropped = [n for n in evidence if scorer.causes[n].nuisance and not (evidence[n].kept and n in asked)]
    fit = scorer.exact(scorer.without(chosen, dropped[0]) if dropped else scorer.fit(chosen))
    prediction = off.with_dead(predicted(off.problem, fit.causes, fit.whole, fit.constant))
    heldout = off.with_dead(heldout_of(off.problem, scorer.folds, fit, jobs))
    members, named = _members(off, fit, evidence)
    for name, reading in off.readings.items():
        item = next(c for c in off.causes if c.name == name)
        named.append(Named(item, reading.transform, reading.values, None))
        members.append((item.order, name, reading.transform))
    ordered = sorted(members, key=lambda member: member[0])
    model = in_order([(name, transform) for _, name, transform in ordered])
    named.sort(key=lambda item: item.cause.order)
    return Explanation(off, scorer, chosen, fit, tuple(named), model, prediction, heldout)


def _members(
    off: ReadOff, fit: Fit, evidence: Mapping[str, Evidence]
) -> tuple[list[tuple[float, str, Transform]], list[Named]]:
    """The members of the model with their positions in the chain, and the fitted causes."""
    members, named = [], []
    for item in fit.causes:
        values: dict[str, float | FloatArray]
        if isinstance(item, BaselineCause):
            shape = fit.shapes[item.name]
            amounts = np.where(off.problem.alive, fit.zeros[item.name], 0.0)
            amounts = amounts[0] if len(amounts) == 1 else amounts
            values = {item.amounts: amounts, **dict(zip(item.numbers, shape, strict=True))}
            transform = item.make(amounts, shape, off.problem)
        elif isinstance(item, PerChannelCause):
            values = {item.array: fit.whole.values[item.name]}
            transform = item.make(fit.whole.values[item.name], off.problem)
        else:
            assert isinstance(item, FittedCause)
            numbers = fit.whole.values[item.name]
            values = {f.name: float(v) for f, v in zip(item.parameters(off.problem), numbers, strict=True)}
            transform = item.transform(numbers, off.problem)
        if not item.in_scene:  # a cause inside the scene is not part of the sensor model
            members.append((item.order, item.name, transform))
        if not item.tacit:
            named.append(Named(item, transform, values, evidence[item.name]))
    if np.any(fit.constant):  # the offset that the causes own by convention
        nuisance = next(c for c in baseline_causes(CAUSES) if c.nuisance)
        members.append((nuisance.order, nuisance.name, nuisance.make(np.asarray(fit.constant), (), off.problem)))
    return members, named


def predicted(problem: Problem, causes: Sequence[Cause], part: Part, constant: FloatArray | float) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` N, prediction of a fit for every sample of a recording, before rounding."""
    rows = replace(with_curves(problem, causes, part.shapes), constant=constant)
    return Model(rows, causes, rows).run(part.values, part.zero)


def heldout_of(problem: Problem, folds: Folds, fit: Fit, jobs: int = 1) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` N, prediction of each sample by the fit to the other folds."""
    out = np.empty_like(problem.simulated)
    fold = folds.of_sample

    def fill(number: int) -> None:
        mine = fold == number
        out[mine] = predicted(problem, fit.causes, fit.folds[number], fit.constant)[mine]

    parallel_map(fill, range(len(fit.folds)), jobs)
    return out


def without_each(found: Explanation, jobs: int = 1) -> dict[str, tuple[Problem, FloatArray]]:
    """By cause, the problem and the held-out prediction of the model refitted without it.

    Args:
        found: The explanation.
        jobs: Number of processors.
    """
    out = {}
    for named in found.named:
        if named.evidence is None:
            out[named.name] = _unread(found, named, jobs)
            continue
        prediction = heldout_of(found.problem, found.folds, _refitted_without(found, named), jobs)
        out[named.name] = found.problem, found.off.with_dead(prediction)
    return out


def without_each_part(found: Explanation, named: Named, jobs: int = 1) -> dict[CausePart, FloatArray]:
    """By part of a cause with several, the held-out prediction of the model refitted without the part."""
    out = {}
    for part in named.parts if len(named.parts) > 1 else ():
        start = found.fit.lacking(named.name, part, found.problem)
        fit = found.scorer.exact(found.scorer.fitter.fit(start.causes, start, found.fit.constant))
        out[part] = found.off.with_dead(heldout_of(found.problem, found.folds, fit, jobs))
    return out


def _refitted_without(found: Explanation, named: Named) -> Fit:
    """The model refitted without one of its causes."""
    scorer, names = found.scorer, [c.name for c in found.fit.causes]
    if not np.any(found.fit.constant):
        return scorer.exact(scorer.without(names, named.name))
    fewer = [c for c in found.fit.causes if c.name != named.name]
    return scorer.fitter.exact(scorer.fitter.fit(fewer, found.fit, found.fit.constant))


def _unread(found: Explanation, named: Named, jobs: int) -> tuple[Problem, FloatArray]:
    """The same for a cause that a check detected: the streams are compared without that check."""
    others = [c for c in found.off.causes if c.name != named.name]
    problem = read_off(found.off.raw, others).problem
    if found.off.readings[named.name].rounds:
        return replace(problem, noise=replace(problem.noise, step=0.0, clips=False)), found.heldout
    scorer = Scorer(problem, found.scorer.causes.values(), found.scorer.rules, found.folds)
    fit = scorer.fitter.exact(scorer.fitter.fit(found.fit.causes, found.fit, found.fit.constant))
    return problem, heldout_of(problem, found.folds, fit, jobs)
