"""Tangent: what every cause would do to the residual while it is small, as the sums that least squares needs.

For each episode the products of all effects with one another and with the residual are kept; with them any set of
causes is fitted on some episodes and judged on others by solving a small linear system, without touching the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.cause import GAIN_PRIOR, TAXEL_GAIN, Cause
from paxisim.diagnose.problem import FloatArray, Problem


@dataclass(frozen=True, eq=False)
class Tangent:
    """Sums over each episode, in units of the noise.

    Attributes:
        owner: ``(D,)`` the cause that each effect belongs to.
        products: ``(episodes, D, D)`` of the effects with one another.
        projections: ``(episodes, D)`` of the effects with the residual.
        energy: ``(episodes,)`` of the residual.
        trust: ``(episodes, D)`` what each episode counts when values are fitted: little for a taxel at the edge of its
            contacts, where what is tolerated of the contact's place is as large as the force, sample after sample.
        samples: Numbers compared.
    """

    owner: NDArray[np.str_]
    products: FloatArray
    projections: FloatArray
    energy: FloatArray
    trust: FloatArray
    samples: int

    def gain(self, causes: Sequence[str], held_out: bool = True, trusting: bool = False) -> FloatArray:
        """``(episodes,)`` energy that `causes` explain in each episode, fitted on all the others, or on all.

        Args:
            causes: Their names.
            held_out: Fit on the other episodes.
            trusting: Let every episode count alike, whatever `trust` says.
        """
        which = np.flatnonzero(np.isin(self.owner, list(causes)))
        if not len(which):
            return np.zeros(len(self.energy))
        products = self.products[:, which[:, None], which]
        projections = self.projections[:, which]
        trust = np.ones_like(projections) if trusting else self.trust[:, which]
        counted, right = products * trust[..., None], projections * trust
        total = counted.sum(axis=0)
        prior = np.where(self.owner[which] == TAXEL_GAIN, 1 / GAIN_PRIOR**2, 0.0)
        ridge = np.diag(prior + 1e-6 * np.diag(total) + 1e-9)
        out = 1.0 if held_out else 0.0
        values = np.linalg.solve(total - out * counted + ridge, (right.sum(axis=0) - out * right)[..., None])
        explained = 2 * projections[:, None] @ values - np.swapaxes(values, 1, 2) @ products @ values
        return explained[:, 0, 0]


def tangent_of(problem: Problem, causes: Sequence[Cause], x: FloatArray, prediction: FloatArray) -> Tangent:
    """The tangent about a model.

    Args:
        problem: The recording.
        causes: Whose effects to consider.
        x: What the effects act on: the model's output, or the simulation itself while there is no model.
        prediction: What the residual is taken against.
    """
    every, x, prediction = problem.samples, problem.at_thinned(x), problem.at_thinned(prediction)
    whole = problem.thinned
    problem = whole.compared
    probes = [(item, values) for item in causes if item.probes is not None for values in item.probes(problem)]
    effects = np.empty((len(probes), *problem.measured.shape))
    prediction = whole.at_compared(prediction)
    was_read = problem.read(prediction)

    def read(change: FloatArray) -> FloatArray:
        return change if problem.counting.reads_all else problem.read(prediction + change) - was_read

    for row, (item, values) in enumerate(probes):
        effects[row] = problem.weigh(read(whole.at_compared(whole.run(item.make(values, whole), x) - x)))
    x = whole.at_compared(x)
    residual = problem.residual(prediction)
    with_gains = any(item.name == TAXEL_GAIN for item in causes)
    taxels = x.shape[1] * x.shape[3] * x.shape[4] if with_gains else 0
    loads = problem.weigh(read(0.1 * x) / 0.1)
    shared, size = len(effects), len(effects) + taxels
    products = np.zeros((len(problem.episodes), size, size))
    projections = np.zeros((len(problem.episodes), size))
    energy = np.zeros(len(problem.episodes))
    trust = np.ones((len(problem.episodes), size))
    own = np.arange(shared, size)
    for number, span in enumerate(problem.episodes):
        r = residual[span]
        rows = effects[:, span].reshape(shared, r.size)
        products[number, :shared, :shared] = rows @ rows.T
        projections[number, :shared] = rows @ r.ravel()
        energy[number] = np.sum(r**2)
        if with_gains:
            load = loads[span]
            tolerated = 1 - (problem.sigma[span].min(axis=0) * problem.weight[span]) ** 2
            trust[number, shared:] = 1 / (1 + np.sum(tolerated, axis=(0, 2)).ravel())
            products[number, own, own] = np.sum(load**2, axis=(0, 2)).ravel()
            projections[number, shared:] = np.sum(load * r, axis=(0, 2)).ravel()
            for row in range(shared):
                across = np.einsum("tpkij,tpkij->pij", load, effects[row, span]).ravel()
                products[number, row, shared:] = products[number, shared:, row] = across
    names = np.array([item.name for item, _ in probes] + [TAXEL_GAIN] * taxels)
    part = problem.samples / every  # the sums stand for those of all frames
    return Tangent(names, products / part, projections / part, energy / part, trust, every)
