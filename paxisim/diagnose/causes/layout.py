"""Layout: taxels, axes or pads are swapped or reversed; read off the correlations of the streams."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import mixes_alike
from paxisim.diagnose.causes.kinds import DetectedCause, Reading
from paxisim.diagnose.data.problem import FloatArray, Problem, with_noise
from paxisim.diagnose.rules import CHECKS


def _read(problem: Problem) -> Reading | None:
    """Return the layout under which the streams correlate clearly better than under the given one, if there is one.

    The order of taxels and pads is found from the normal force regardless of its sign, that of the axes from all three
    forces.
    """
    normal, wanted = problem.measured[:, :, 2], problem.simulated[:, :, 2]
    pads, rows, cols = wanted.shape[1:]
    orders = list(itertools.permutations(range(pads))) if pads <= 3 else [tuple(range(pads))]

    def alike_either_way(simulated: FloatArray) -> FloatArray:
        """Like `_alike`, for a normal force whose sign may be reversed."""
        alike = _alike(normal, simulated, problem)
        return -alike if alike.mean() < 0 else alike

    best, most = {}, alike_either_way(wanted)
    base = most
    for order, flip_rows, flip_cols, transpose in itertools.product(
        orders, (False, True), (False, True), (False, True) if rows == cols else (False,)
    ):
        fault = {"flip_rows": flip_rows, "flip_cols": flip_cols, "transpose": transpose, "pad_order": order}
        moved = augment.LayoutFault(**fault)(problem.simulated)[:, :, 2]
        alike = alike_either_way(moved)
        if alike.mean() > most.mean() + 1e-9 and alike.mean() > base.mean() + CHECKS.better:
            best, most = fault, alike
    if best and (most > base)[most != base].mean() < CHECKS.most:
        best = {}
    if best and not _fits_all(normal, wanted, augment.LayoutFault(**best)(problem.simulated)[:, :, 2]):
        best = {}
    if best.get("pad_order") == tuple(range(pads)):
        best["pad_order"] = None
    moved = augment.LayoutFault(**best)(problem.simulated)
    signs, order = _axes(problem, moved)
    if not best and signs == (1, 1, 1) and order == (0, 1, 2):
        return None
    fault = augment.LayoutFault(**best, axis_signs=signs, axis_order=order)
    return Reading(fault, {}, with_noise(replace(problem, simulated=fault(problem.simulated))))


def _fits_all(measured: FloatArray, given: FloatArray, moved: FloatArray) -> bool:
    """Whether most moved taxels correlate as well at their new place, not only the few that carry most of the load."""

    def each(simulated: FloatArray) -> FloatArray:
        a, b = measured - measured.mean(axis=0), simulated - simulated.mean(axis=0)
        return np.abs(np.sum(a * b, axis=0)) / np.sqrt(np.sum(a * a, axis=0) * np.sum(b * b, axis=0) + 1e-12)

    load = np.maximum(np.ptp(given, axis=0), np.ptp(moved, axis=0))
    loaded = (load > CHECKS.load * load.max()) & np.any(given != moved, axis=0) & (np.ptp(measured, axis=0) > 0)
    return float(np.mean((each(moved) > each(given) - CHECKS.equal)[loaded])) > CHECKS.moved


def _alike(measured: FloatArray, simulated: FloatArray, problem: Problem) -> FloatArray:
    """Correlation in each episode that has a load; the median of each taxel is subtracted from the measurement.

    Taxels that never change are left out: a dead one says nothing of its place.
    """
    out = []
    least = max(0.1 * float(np.abs(simulated).max()), problem.noise.step)
    changes = np.ptp(measured, axis=0) > 0
    measured = (measured - np.median(measured, axis=0))[:, changes]
    for span in problem.episodes:
        if np.abs(simulated[span]).max() > least:
            a, b = measured[span], simulated[span][:, changes]
            out.append(np.sum(a * b) / np.sqrt(np.sum(a * a) * np.sum(b * b) + 1e-12))
    return np.array(out or [0.0])


def _axes(problem: Problem, simulated: FloatArray) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Signs and order of the axes, from their correlations with the simulated axes."""

    def alike(i: int, j: int) -> FloatArray:
        return _alike(problem.measured[:, :, i], simulated[:, :, j], problem)

    signs, order = [1, 1, 1], (0, 1, 2)
    straight = np.mean([np.abs(alike(0, 0)).mean(), np.abs(alike(1, 1)).mean()])
    crossed = np.mean([np.abs(alike(0, 1)).mean(), np.abs(alike(1, 0)).mean()])
    if crossed > straight + 0.4:
        order = (1, 0, 2)
    for axis in range(3):
        each = alike(axis, order[axis])
        strong = each[np.abs(each) > 0.2]
        opposed = len(strong) and strong.mean() < -0.4 and (strong < 0).mean() >= CHECKS.most
        if opposed and (axis == 2 or _turned(problem, simulated, axis, order[axis])):
            signs[axis] = -1
    return (signs[0], signs[1], signs[2]), order


def _turned(problem: Problem, simulated: FloatArray, axis: int, other: int) -> bool:
    """Whether a shear reading has the opposite sign of the simulated shear, with the normal force regressed out.

    Leakage of the normal force into the shear reading may exceed the small shear of a press.
    """
    shear, normal = simulated[:, :, other].ravel(), simulated[:, :, 2].ravel()
    measured = problem.measured[:, :, axis] - np.median(problem.measured[:, :, axis], axis=0)
    both = np.stack([shear, normal])
    return bool(np.linalg.lstsq(both @ both.T, both @ measured.ravel(), rcond=None)[0][0] < 0)


LAYOUT = DetectedCause(
    name="layout",
    order=0,
    excites="corners",
    read=_read,
    barred=mixes_alike,
    words="Taxels, axes or pads are swapped or reversed.",
    picture="mapping",
)
