"""Checks: causes that are read off the data, without a search: layout, rounding and dead taxels."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from paxisim import augment
from paxisim.augment.transform import Transform
from paxisim.diagnose.problem import FloatArray, Problem

CLEARLY = 0.05  # by how much a correlation must be better for a fault of the layout to be named
WITHIN = 15.0  # times what is tolerated of its place, that a contact must press on a taxel to be on it
CLEAR = 0.6  # N, beyond any dead band
FRAMES = 8  # in which a taxel is pressed so, at least
FAINT = 0.3  # of a shear, that a taxel that lives surely reads
CONSISTENT = 1.6  # times the root of the sum of their squares, that the episodes' answers must add up to
FAR = 4.0  # times what others read at rest, and what does not matter
MISSING = 8.0  # times the noise that the answer of a stuck taxel must be missing
STILL = 1.8  # times the noise that it may move
UNMOVED = 0.2  # of what the others of its pad and axis move
LATE = 0.1  # s, of a taxel that answers late


@dataclass(frozen=True, eq=False)
class Reading:
    """A cause that was read off the data.

    Attributes:
        transform: What it does.
        values: Its figures by name.
    """

    transform: Transform
    values: Mapping[str, float | FloatArray] = field(default_factory=dict)


def read_layout(problem: Problem) -> Reading | None:
    """The layout by which the streams agree clearly better than by the one given, if there is one.

    Taxels and pads are told by the normal force, either way round, axes and signs by the forces that are then left.
    """
    normal, wanted = problem.measured[:, :, 2], problem.simulated[:, :, 2]
    pads, rows, cols = wanted.shape[1:]
    orders = list(itertools.permutations(range(pads))) if pads <= 3 else [tuple(range(pads))]

    def alike_either_way(simulated: FloatArray) -> FloatArray:
        """As `_alike`, of a normal force whose sign may be reversed."""
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
        if alike.mean() > most.mean() + 1e-9 and alike.mean() > base.mean() + CLEARLY:
            best, most = fault, alike
    if best and (most > base)[most != base].mean() < 0.8:
        best = {}
    if best.get("pad_order") == tuple(range(pads)):
        best["pad_order"] = None
    moved = augment.LayoutFault(**best)(problem.simulated)
    signs, order = _axes(problem, moved)
    if not best and signs == (1, 1, 1) and order == (0, 1, 2):
        return None
    fault = augment.LayoutFault(**best, axis_signs=signs, axis_order=order)
    return Reading(fault)


def _alike(measured: FloatArray, simulated: FloatArray, problem: Problem) -> FloatArray:
    """The correlation in each episode that has something to compare, about each taxel's rest."""
    out = []
    least = max(0.1 * float(np.abs(simulated).max()), problem.step)
    for span in problem.episodes:
        a, b = measured[span], simulated[span]
        if np.abs(b).max() > least:
            a = a - np.median(measured, axis=0)
            out.append(np.sum(a * b) / np.sqrt(np.sum(a * a) * np.sum(b * b) + 1e-12))
    return np.array(out or [0.0])


def _axes(problem: Problem, simulated: FloatArray) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Signs and order of the axes: of x and y, each by how it goes with the simulated ones."""

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
        opposed = len(strong) and strong.mean() < -0.4 and (strong < 0).mean() >= 0.8
        if opposed and (axis == 2 or _turned(problem, simulated, axis, order[axis])):
            signs[axis] = -1
    return (signs[0], signs[1], signs[2]), order


def _turned(problem: Problem, simulated: FloatArray, axis: int, other: int) -> bool:
    """Whether a shear goes against the simulated one beside what of it goes with the normal force.

    A sensor that reads part of the normal force as shear may drown the little shear of a press.
    """
    shear, normal = simulated[:, :, other].ravel(), simulated[:, :, 2].ravel()
    measured = problem.measured[:, :, axis] - np.median(problem.measured[:, :, axis], axis=0)
    both = np.stack([shear, normal])
    return bool(np.linalg.lstsq(both @ both.T, both @ measured.ravel(), rcond=None)[0][0] < 0)


def read_rounding(problem: Problem, device_step: float) -> Reading | None:
    """A step of the readings that is coarser than the device's own (N)."""
    if problem.step < 1.2 * device_step:
        return None
    return Reading(augment.Quantisation((problem.step,) * 3), {"step": problem.step})


def read_taxels(problem: Problem) -> Reading | None:
    """Taxels that do not answer on any axis while the simulation says that they are pressed."""
    simulated, measured = problem.simulated, problem.measured
    level, noise = np.median(measured, axis=0), np.median(problem.sigma, axis=0)
    floor = max(0.6 * problem.step, 0.03)
    loaded = pressed_beyond(problem, max(0.06 * problem.peak, CLEAR))[:, :, 2] & (simulated[:, :, 2] > 0)
    dead = loaded.sum(axis=0) >= FRAMES
    # one that answers late rises when it is no longer pressed
    rise = np.quantile(measured[:, :, 2] - level[:, 2], 0.998, axis=0)
    dead &= rise < np.maximum(0.4 * np.quantile(simulated[:, :, 2], 0.998, axis=0), 3.5 * noise[:, 2])
    for axis in range(3):
        x, y = simulated[:, :, axis], measured[:, :, axis] - level[:, axis]
        x = x - x.mean(axis=0)
        energy = np.sum(x**2, axis=0)
        each = np.stack([np.sum(x[span] * y[span], axis=0) for span in problem.episodes])
        slope = each.sum(axis=0) / np.maximum(energy, 1e-12)
        told = energy > (40 * noise[:, axis]) ** 2  # else noise alone decides
        if axis < 2:  # slow noise may look like a faint answer, but not like the same in all episodes
            shared = np.abs(each.sum(axis=0)) > CONSISTENT * np.sqrt(np.sum(each**2, axis=0))
            told &= shared | (np.abs(slope) > FAINT)
        dead &= ~told | (np.abs(slope) < 0.12)
        if axis == 2:
            dead &= told
    if dead.any():
        dead &= ~_answers_late(problem, level, noise)
    dead |= _still(problem, level, noise, floor)
    if not dead.any():
        return None
    stuck = dead & (np.abs(level).max(axis=1) > floor)
    value = level * stuck[:, None]
    fault = augment.DeadTaxels((dead & ~stuck).astype(float), stuck.astype(float), value)
    return Reading(fault, {"dead": (dead & ~stuck).astype(float), "stuck": stuck.astype(float), "value": value})


def pressed_beyond(problem: Problem, least: float) -> NDArray[np.bool_]:
    """``(T, pads, 3, rows, cols)`` where a force is larger than `least` (N), and its contact surely on the taxel."""
    variance = problem.sigma**2
    tolerated = np.sqrt(variance - variance.min(axis=0))  # large at a contact's edge, which may be beside the taxel
    return np.abs(problem.simulated) > np.maximum(least, WITHIN * tolerated)


def _still(problem: Problem, level: FloatArray, noise: FloatArray, floor: float) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels that stay where no other is, on all axes, while they are pressed however little.

    That is enough of one that reads something, which no dead band holds back, if the next count is within reach.
    """
    usual = np.median(np.abs(level), axis=(2, 3), keepdims=True)
    far = (np.abs(level) > FAR * (usual + floor)).any(axis=1) | _unmoved(problem, floor)
    if not far.any():
        return far
    x, y = (
        np.concatenate([values[span] - values[span].mean(axis=0) for span in problem.episodes]) / noise
        for values in (problem.simulated, problem.measured)
    )
    energy, both = np.sum(x**2, axis=(0, 2)), np.sum(x * y, axis=(0, 2))
    missing = (energy - both) / np.sqrt(np.maximum(energy, 1e-12))  # of the answer, in units of its noise
    still = ((problem.measured - level) / noise).std(axis=0) < STILL
    reached = np.quantile(np.abs(problem.simulated), 0.998, axis=0).max(axis=1) > problem.step
    return far & (both < 0.25 * energy) & (missing > MISSING) & still.all(axis=1) & reached


def _unmoved(problem: Problem, floor: float) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels that are read alike in all episodes before a contact, where others drift away."""
    spans = [span for span in problem.episodes if problem.untouched[span].any()]
    if len(spans) < 2:
        return np.zeros_like(problem.alive[:, 0])
    levels = [np.mean(problem.measured[span][problem.untouched[span]], axis=0) for span in spans]
    moved = np.std(levels, axis=0)
    usual = np.median(moved, axis=(2, 3), keepdims=True)
    drifting = usual > floor
    return drifting.any() & (~drifting | (moved < UNMOVED * usual)).all(axis=1)


def _answers_late(problem: Problem, level: FloatArray, noise: FloatArray) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels that answer to what pressed them some tenths of a second ago, as after a tap."""
    late = problem.run(augment.LowPass(LATE), problem.simulated)[:, :, 2]
    x, y = late - late.mean(axis=0), problem.measured[:, :, 2] - level[:, 2]
    energy, both = np.sum(x**2, axis=0), np.sum(x * y, axis=0)
    return (both > 0.3 * energy) & (both > 8 * noise[:, 2] * np.sqrt(energy))
