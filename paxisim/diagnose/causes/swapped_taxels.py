"""Swapped taxels: pairs of taxels of a pad have changed places; read off the streams.

A reversal or transposition that fits all the taxels it moves is a fault of the `layout`, which is read first and keeps
its name: on pads of two taxels, of three in a line, or of 2x2, some of them swap but two.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paxisim import augment
from paxisim.diagnose.cause import Cause, Reading
from paxisim.diagnose.causes.channel_curve import mixes_alike
from paxisim.diagnose.causes.read_only import not_made
from paxisim.diagnose.problem import FloatArray, Problem, with_noise

LOADED = 0.1  # of the energy of the pad's most loaded taxel, that one of a pair has: edges depend on where a contact is
LEAVES = 0.5  # of what a taxel's own force leaves of its reading, that the other's force leaves at most
GAINS = (0.3, 3.0)  # of a taxel that reads the other's force
TOLD = 8.0  # times the noise: root of the energy that a swap takes away at least, also in an episode that tells
MOST = 0.8  # share of the episodes that tell, in which the swap is better
TWICE = 2  # episodes that must tell: in one the contact may be elsewhere than simulated


def _read(problem: Problem) -> Reading | None:
    """The pairs of which each taxel reads the other's force clearly better than its own, on all axes that tell."""
    pairs = [pair for pad in range(len(problem.alive)) for pair in _pairs(problem, pad)]
    if not pairs:
        return None
    fault = augment.SwappedTaxels(tuple(pairs))
    return Reading(fault, {}, with_noise(replace(problem, simulated=fault(problem.simulated))))


def _pairs(problem: Problem, pad: int) -> list[tuple[int, int, int, int, int]]:
    """The pairs of a pad; both taxels of one must read the other's normal force best of all."""
    cols = problem.alive.shape[-1]
    left, load = _left(problem, pad, 2)
    own = np.diagonal(left, axis1=1, axis2=2)
    total, own_total = left.sum(axis=0), own.sum(axis=0)
    best = np.argmin(total, axis=1)
    shear = _left(problem, pad, 0)[0] + _left(problem, pad, 1)[0]
    loaded = load > LOADED * load.max()
    pairs = []
    for one, other in enumerate(best):
        if one >= other or best[other] != one or not (loaded[one] or loaded[other]):
            continue
        both = ((one, other), (other, one))
        if all(total[i, j] < LEAVES * own_total[i] and own_total[i] - total[i, j] > TOLD**2 for i, j in both):
            takes = np.array([own[:, i] - left[:, i, j] for i, j in both])
            tells = np.abs(takes) > TOLD**2
            most = np.all(np.sum(takes > TOLD**2, axis=1) >= MOST * tells.sum(axis=1))
            turned = sum(float(np.sum(shear[:, i, i] - shear[:, i, j])) for i, j in both)
            if most and tells.any(axis=0).sum() >= TWICE and turned > -(TOLD**2):
                pairs.append((pad, *map(int, divmod(one, cols)), *map(int, divmod(other, cols))))
    return pairs


def _left(problem: Problem, pad: int, axis: int) -> tuple[FloatArray, FloatArray]:
    """Squares that the force on one taxel leaves of another's reading, in noise units, and those of the forces (N^2).

    They are ``(episodes, taxels, taxels)``, the taxel that reads first, and ``(taxels,)``. The gain is free, but one
    for all episodes; where that of another taxel is beyond `GAINS`, all of the reading is left. So a motion in which
    forces go together, as of presses at one place, tells nothing.
    """
    noise = np.median(problem.sigma[:, pad, axis], axis=0).ravel()
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
    gain = np.where(own | ((gain > GAINS[0]) & (gain < GAINS[1])), gain, 0.0)
    left = (reading - 2 * gain * product + gain**2 * force) / noise[:, None] ** 2
    return left, np.sum(force[:, 0], axis=0)


SWAPPED_TAXELS = Cause(
    "swapped_taxels",
    1,
    not_made("swapped_taxels"),
    "probe",
    read=_read,
    barred=mixes_alike,
    words="Pairs of taxels have changed places.",
    picture="mapping",
)
