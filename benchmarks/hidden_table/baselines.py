"""Baselines: selection of causes without held-out data, on the same effects, noise and tolerances.

Each effect of the diagnosis' own vocabulary is linearised about the bare simulation. Layout, rounding and dead taxels
are read off the data by the diagnosis' own checks, so only the selection of the other causes differs:

- BIC: forward selection by the Bayesian information criterion, assuming independent samples;
- Wald: a fit of all effects at once, naming causes whose joint Wald test has p < 0.01.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from hidden_table.tasks import BASELINES
from paxisim.diagnose.cause import Cause
from paxisim.diagnose.problem import Problem, problem_of
from paxisim.diagnose.reading import read_off
from paxisim.diagnose.vocabulary import cause, known_causes
from paxisim.recording import Recording

Floats = NDArray[np.floating]
DRIFT_TAU = 200.0  # s
ALPHA = 0.01


@dataclass(frozen=True, eq=False)
class Linear:
    """A recording as sums for least squares, in units of the noise.

    Attributes:
        read: Causes that were read off the data.
        owner: ``(D,)`` cause of each effect.
        products: ``(episodes, D, D)`` inner products of the effects.
        projections: ``(episodes, D)`` inner products of the effects with the residual.
        energy: ``(episodes,)`` energy of the residual.
        samples: Number of values compared.
        before: Energy of the residual before anything was read off the data.
        floor: Energy that the hidden effects themselves would leave; None if unknown.
    """

    read: tuple[str, ...]
    owner: NDArray[np.str_]
    products: Floats
    projections: Floats
    energy: Floats
    samples: int
    before: float
    floor: float | None


def baselines(recording: Recording, ideal: Floats | None) -> tuple[dict[str, tuple[str, ...]], dict[str, float | None]]:
    """Return the causes that each baseline names, and its held-out share of the headroom.

    Args:
        recording: The recording of the case.
        ideal: ``(T, pads, 3, rows, cols)`` result of applying the hidden effects to the simulation (N).
    """
    linear = linear_of(recording, ideal)
    named = dict(zip(BASELINES, (by_bic(linear), by_wald(linear)), strict=True))
    shares = {name: share_of(linear, causes) for name, causes in named.items()}
    return {name: (*linear.read, *causes) for name, causes in named.items()}, shares


def linear_of(recording: Recording, ideal: Floats | None = None) -> Linear:
    """Compute the sums for each episode."""
    read, raw, problem = _read(recording)
    probes = [(c, values) for c in _searched(problem) for values in c.starts(problem)]
    shape = problem.simulated.shape[1:]
    channels = int(np.prod(shape))
    taxel = np.broadcast_to(np.arange(channels // 3).reshape(shape[0], 1, *shape[2:]), shape).ravel()
    owner = (
        [c.name for c, _ in probes] + ["taxel_gain"] * (channels // 3) + ["offset"] * channels + ["drift"] * channels
    )
    dense, size = len(probes), len(owner)
    gains = np.arange(dense, dense + channels // 3)
    offsets = np.arange(size - 2 * channels, size - channels)
    drifts = np.arange(size - channels, size)
    products, projections = np.zeros((len(problem.episodes), size, size)), np.zeros((len(problem.episodes), size))
    energy = np.zeros(len(problem.episodes))
    for number in range(len(problem.episodes)):
        part = problem.select([number])
        weight = part.weight.reshape(-1, channels)
        x = part.simulated
        effects = [problem_effect(part, problem, c, values) * part.weight for c, values in probes]
        rows = np.stack([effect.reshape(-1, channels) for effect in effects]).astype(np.float32)
        residual = (part.measured - part.read(x)).reshape(-1, channels) * weight
        load = x.reshape(-1, channels) * weight
        curve = -np.expm1(-(part.time - problem.time[0]) / DRIFT_TAU)[:, None]
        flat, a = rows.reshape(dense, -1), products[number]
        a[:dense, :dense] = flat @ flat.T
        across = np.einsum("dtc,tc->dc", rows, load, optimize=True)
        np.add.at(a[:dense].T, gains[taxel], across.T)
        a[:dense, offsets] = np.einsum("dtc,tc->dc", rows, weight, optimize=True)
        a[:dense, drifts] = np.einsum("dtc,tc->dc", rows, weight * curve, optimize=True)
        np.add.at(a, (gains[taxel], gains[taxel]), np.sum(load**2, axis=0))
        a[gains[taxel], offsets] = np.sum(load * weight, axis=0)
        a[gains[taxel], drifts] = np.sum(load * weight * curve, axis=0)
        a[offsets, offsets] = np.sum(weight**2, axis=0)
        a[offsets, drifts] = np.sum(weight**2 * curve, axis=0)
        a[drifts, drifts] = np.sum((weight * curve) ** 2, axis=0)
        products[number] = np.triu(a) + np.triu(a, 1).T
        b = projections[number]
        b[:dense] = flat @ residual.ravel()
        np.add.at(b, gains[taxel], np.sum(load * residual, axis=0))
        b[offsets] = np.sum(weight * residual, axis=0)
        b[drifts] = np.sum(weight * curve * residual, axis=0)
        energy[number] = np.sum(residual**2)
    comparable = ideal is not None and not {"quantisation", "dead_taxels"} & set(read)
    return Linear(
        read, np.array(owner), products, projections, energy, problem.samples,
        float(np.sum(((raw.measured - raw.read(raw.simulated)) * problem.weight) ** 2)),
        float(np.sum(((raw.measured - ideal) * problem.weight) ** 2)) if comparable else None,
    )  # fmt: skip


def problem_effect(part: Problem, problem: Problem, item, values) -> Floats:  # type: ignore[no-untyped-def]
    """Return the ``(T, pads, 3, rows, cols)`` change that a probe makes to an episode (N)."""
    return part.run(item.make(values, problem), part.simulated) - part.simulated


def by_bic(linear: Linear) -> tuple[str, ...]:
    """Return causes in the order in which the information criterion selects them."""
    a, b, energy = linear.products.sum(axis=0), linear.projections.sum(axis=0), float(linear.energy.sum())
    n = linear.samples

    def criterion(names: Sequence[str]) -> float:
        which = np.flatnonzero(np.isin(linear.owner, names))
        gain = float(b[which] @ _solved(a[np.ix_(which, which)], b[which])) if len(which) else 0.0
        return n * np.log(max(energy - gain, 1e-9) / n) + len(which) * np.log(n)

    chosen: list[str] = []
    best = criterion(chosen)
    left = list(dict.fromkeys(map(str, linear.owner)))
    while left:
        scores = {name: criterion([*chosen, name]) for name in left}
        name = min(scores, key=lambda name: scores[name])
        if scores[name] >= best:
            break
        chosen.append(name)
        left.remove(name)
        best = scores[name]
    return tuple(chosen)


def by_wald(linear: Linear) -> tuple[str, ...]:
    """Return causes whose coefficients, with all effects fitted at once, differ significantly from 0 jointly."""
    a, b = linear.products.sum(axis=0), linear.projections.sum(axis=0)
    scale = np.sqrt(np.maximum(np.diag(a), 1e-12))
    covariance = np.linalg.pinv(a / np.outer(scale, scale), rcond=1e-7, hermitian=True) / np.outer(scale, scale)
    values = covariance @ b
    variance = float(linear.energy.sum() - b @ values) / (linear.samples - len(b))
    named = []
    for name in dict.fromkeys(map(str, linear.owner)):
        which = np.flatnonzero(linear.owner == name)
        block = covariance[np.ix_(which, which)]
        statistic = values[which] @ np.linalg.pinv(block, hermitian=True) @ values[which] / variance
        if chi2.sf(statistic, len(which)) < ALPHA:
            named.append(name)
    return tuple(named)


def share_of(linear: Linear, causes: Sequence[str]) -> float | None:
    """Return the share of the headroom that these causes explain in leave-one-episode-out cross-validation.

    None if the headroom is unknown or negligible.
    """
    if linear.floor is None or linear.before - linear.floor < 0.02 * linear.floor:
        return None
    after = float(linear.energy.sum())
    which = np.flatnonzero(np.isin(linear.owner, causes))
    if len(which):
        a, b = linear.products[:, which[:, None], which], linear.projections[:, which]
        for one in range(len(a)):
            values = _solved(a.sum(axis=0) - a[one], b.sum(axis=0) - b[one])
            after -= float(2 * b[one] @ values - values @ a[one] @ values)
    return (linear.before - after) / (linear.before - linear.floor)


def _solved(a: Floats, b: Floats) -> Floats:
    return np.linalg.solve(a + np.diag(1e-7 * np.diag(a) + 1e-9), b)


def _searched(problem: Problem) -> list[Cause]:
    """Return the causes that can be fitted to this recording; gains and zeros of taxels are summed separately."""
    causes = [cause(name) for name in known_causes()]
    return [c for c in causes if not c.barred(problem) and (not c.covariate or c.covariate in problem.covariates)]


def _read(recording: Recording) -> tuple[tuple[str, ...], Problem, Problem]:
    """Return the causes read off the data, the problem before that, and the problem after it."""
    raw = problem_of(recording)
    off = read_off(raw, [cause(name) for name in known_causes() if not cause(name).barred(raw)])
    return tuple(off.readings), raw, off.problem
