"""Swapped taxels: pairs of taxels on a pad are swapped; read off the streams.

A reversal or transposition that fits all the taxels it moves is a `layout` fault. The layout is read first and takes
precedence: on pads of two taxels, of three in a row, or of 2x2, some layout faults swap only two taxels.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import mixes_alike
from paxisim.diagnose.causes.kinds import DetectedCause, Reading
from paxisim.diagnose.data.problem import FloatArray, Problem, with_noise
from paxisim.diagnose.rules import CHECKS


def _read(problem: Problem) -> Reading | None:
    """Return the pairs in which each taxel reads the other's force clearly better than its own."""
    pairs = [pair for pad in range(len(problem.alive)) for pair in _pairs(problem, pad)]
    if not pairs:
        return None
    fault = augment.SwappedTaxels(tuple(pairs))
    return Reading(fault, {}, with_noise(replace(problem, simulated=fault(problem.simulated))))


def _pairs(problem: Problem, pad: int) -> list[tuple[int, int, int, int, int]]:
    """Return the swapped pairs of a pad.

    The normal force that a taxel of a pair reads best must be the other's, in most episodes that decide, and the shear
    must not contradict the swap.
    """
    residual, load = _residuals(problem, pad, 2)
    shear = _residuals(problem, pad, 0)[0] + _residuals(problem, pad, 1)[0]
    total, certain, cols = residual.sum(axis=0), CHECKS.certain**2, problem.alive.shape[-1]
    best = np.argmin(total, axis=1)
    pairs = []
    for one, other in enumerate(best):
        own, its = (one, other), (other, one)
        if one >= other or best[other] != one or max(load[one], load[other]) <= CHECKS.pair_load * load.max():
            continue
        gain, shear_gain = (each[:, own, own] - each[:, own, its] for each in (residual, shear))  # (episodes, 2)
        decides = np.abs(gain) > certain
        fits = np.all(total[own, its] < CHECKS.residual * total[own, own]) and shear_gain.sum() > -certain
        agrees = np.all(np.sum(gain > certain, axis=0) >= CHECKS.most * decides.sum(axis=0))
        if fits and agrees and decides.any(axis=1).sum() >= CHECKS.repeats:
            pairs.append((pad, *map(int, divmod(one, cols)), *map(int, divmod(other, cols))))
    return pairs


def _residuals(problem: Problem, pad: int, axis: int) -> tuple[FloatArray, FloatArray]:
    """Fit the reading of each taxel of a pad by the force on each taxel, with a gain that all episodes share.

    Returns:
        Squared residuals in noise units, ``(episodes, taxels, taxels)`` with the reading taxel first, and the squared
        forces (N^2), ``(taxels,)``.
    """
    sums = []
    for span in problem.episodes:
        streams = problem.simulated[span, pad, axis], problem.measured[span, pad, axis]
        x, y = ((values - values.mean(axis=0)).reshape(len(values), -1) for values in streams)
        sums.append((y.T @ x, np.sum(x * x, axis=0)[None], np.sum(y * y, axis=0)[:, None]))
    product, force, reading = (np.array(each) for each in zip(*sums, strict=True))
    gain = product.sum(axis=0) / np.maximum(force.sum(axis=0), 1e-12)
    noise = np.median(problem.noise.sigma[:, pad, axis], axis=0).reshape(-1, 1)
    return (reading - 2 * gain * product + gain**2 * force) / noise**2, force.sum(axis=(0, 1))


SWAPPED_TAXELS = DetectedCause(
    name="swapped_taxels",
    order=1,
    excites="probe",
    read=_read,
    barred=mixes_alike,
    words="Pairs of taxels are swapped.",
    picture="mapping",
)
