"""Swapped taxels: taxels of a pad read each other's force, in pairs or in larger rings; read off the streams.

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
    """Return the rings in which each taxel reads the force of the next one clearly better than its own."""
    rings = [ring for pad in range(len(problem.alive)) for ring in _rings(problem, pad)]
    if not rings:
        return None
    fault = augment.SwappedTaxels(tuple(rings))
    return Reading(fault, {}, with_noise(replace(problem, simulated=fault(problem.simulated))))


def _rings(problem: Problem, pad: int) -> list[tuple[int, ...]]:
    """Return the rings of a pad: each taxel reads best the normal force of the next, in most episodes that decide.

    The shear must not contradict this. A ring begins with its first taxel.
    """
    residual, load = _residuals(problem, pad, 2)
    shear = _residuals(problem, pad, 0)[0] + _residuals(problem, pad, 1)[0]
    total, certain, cols, rings = residual.sum(axis=0), CHECKS.certain**2, problem.alive.shape[-1], []
    best = np.argmin(total, axis=1).tolist()
    for start in range(len(best)):
        ring = [start]
        while (after := best[ring[-1]]) > start and after not in ring:
            ring.append(after)
        if after != start or len(ring) < 2 or load[ring].max() <= CHECKS.pair_load * load.max():
            continue
        its = [*ring[1:], start]
        gain, shear_gain = (each[:, ring, ring] - each[:, ring, its] for each in (residual, shear))  # (episodes, ring)
        decides = np.abs(gain) > certain
        fits = np.all(total[ring, its] < CHECKS.residual * total[ring, ring]) and shear_gain.sum() > -certain
        agrees = np.all(np.sum(gain > certain, axis=0) >= CHECKS.most * decides.sum(axis=0))
        if fits and agrees and decides.any(axis=1).sum() >= CHECKS.repeats:
            rings.append((pad, *(number for taxel in ring for number in divmod(taxel, cols))))
    return rings


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
    words="Taxels are swapped, in pairs or in larger rings.",
    picture="mapping",
)
