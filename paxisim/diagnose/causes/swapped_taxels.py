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

    The normal force that a taxel of a pair reads best must be the other's, and the shear must not contradict the swap.
    """
    cols = problem.alive.shape[-1]
    left, load = _left(problem, pad, 2)
    own = np.diagonal(left, axis1=1, axis2=2)
    total, own_total = left.sum(axis=0), own.sum(axis=0)
    best = np.argmin(total, axis=1)
    shear = _left(problem, pad, 0)[0] + _left(problem, pad, 1)[0]
    loaded = load > CHECKS.pair_load * load.max()
    pairs = []
    for one, other in enumerate(best):
        if one >= other or best[other] != one or not (loaded[one] or loaded[other]):
            continue
        both = ((one, other), (other, one))
        fits = all(total[i, j] < CHECKS.residual * own_total[i] for i, j in both)
        if fits and all(own_total[i] - total[i, j] > CHECKS.certain**2 for i, j in both):
            takes = np.array([own[:, i] - left[:, i, j] for i, j in both])
            tells = np.abs(takes) > CHECKS.certain**2
            most = np.all(np.sum(takes > CHECKS.certain**2, axis=1) >= CHECKS.most * tells.sum(axis=1))
            turned = sum(float(np.sum(shear[:, i, i] - shear[:, i, j])) for i, j in both)
            if most and tells.any(axis=0).sum() >= CHECKS.repeats and turned > -(CHECKS.certain**2):
                pairs.append((pad, *map(int, divmod(one, cols)), *map(int, divmod(other, cols))))
    return pairs


def _left(problem: Problem, pad: int, axis: int) -> tuple[FloatArray, FloatArray]:
    """Fit the reading of each taxel of a pad by the force on each taxel.

    The gain of a fit is free but shared by all episodes. Where the gain of another taxel's force is outside the range
    of a working taxel, the whole reading counts as residual. A motion in which all forces are proportional, such as
    presses at one place, therefore decides nothing.

    Returns:
        Squared residuals in noise units, ``(episodes, taxels, taxels)`` with the reading taxel first, and the squared
        forces (N^2), ``(taxels,)``.
    """
    noise = np.median(problem.noise.sigma[:, pad, axis], axis=0).ravel()
    products, forces, readings = [], [], []
    for span in problem.episodes:
        x, y = (
            (values[span, pad, axis] - values[span, pad, axis].mean(axis=0)).reshape(span.stop - span.start, -1)
            for values in (problem.simulated, problem.measured)
        )
        products.append(y.T @ x)
        forces.append(np.sum(x * x, axis=0))
        readings.append(np.sum(y * y, axis=0))
    product, force, reading = np.array(products), np.array(forces)[:, None], np.array(readings)[:, :, None]
    gain = product.sum(axis=0) / np.maximum(force.sum(axis=0), 1e-12)
    own = np.eye(len(noise), dtype=bool)
    gain = np.where(own | ((gain > CHECKS.responds) & (gain < 1 / CHECKS.responds)), gain, 0.0)
    left = (reading - 2 * gain * product + gain**2 * force) / noise[:, None] ** 2
    return left, np.sum(force[:, 0], axis=0)


SWAPPED_TAXELS = DetectedCause(
    name="swapped_taxels",
    order=1,
    excites="probe",
    read=_read,
    barred=mixes_alike,
    words="Pairs of taxels are swapped.",
    picture="mapping",
)
