"""Dead taxels: those that do not answer, or are stuck at a level; read off the recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim import augment
from paxisim.diagnose.cause import Cause, Reading
from paxisim.diagnose.causes.read_only import not_made
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.silent import CLEAR, FRAMES, pressed_beyond

FAINT = 0.3  # of a shear, that a taxel that lives surely reads
CONSISTENT = 1.6  # times the root of the sum of their squares, that the episodes' answers must add up to
FAR = 4.0  # times what others read at rest, and what does not matter
MISSING = 8.0  # times the noise that the answer of a stuck taxel must be missing
STILL = 1.8  # times the noise that it may move
UNMOVED = 0.2  # of what the others of its pad and axis move
LATE = 0.1  # s, of a taxel that answers late


def _read(problem: Problem) -> Reading | None:
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
    fault = augment.DeadTaxels((dead & ~stuck).astype(float), stuck.astype(float), level * stuck[:, None])
    values = {"dead": fault.dead, "stuck": fault.stuck, "value": fault.value}
    return Reading(fault, values, replace(problem, alive=problem.alive & ~dead[:, None]))


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


DEAD_TAXELS = Cause("dead_taxels", 95, not_made("dead_taxels"), "places", read=_read)
