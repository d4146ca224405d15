"""Dead taxels: taxels that never respond, stop responding or are stuck at a level; read off the streams."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim import augment
from paxisim.diagnose.causes.channels import loaded_taxels
from paxisim.diagnose.causes.failures import failures_of
from paxisim.diagnose.causes.kinds import DetectedCause, Reading
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import CHECKS


def _read(problem: Problem) -> Reading | None:
    """Return the taxels that do not respond on any axis although they are pressed in the simulation."""
    simulated, measured = problem.simulated, problem.measured
    level, noise = np.median(measured, axis=0), np.median(problem.noise.sigma, axis=0)
    floor = max(CHECKS.count * problem.noise.step, 0.03)
    dead = loaded_taxels(problem).sum(axis=0) >= CHECKS.samples
    # a late response may rise after the press has ended
    rise = np.quantile(measured[:, :, 2] - level[:, 2], 0.998, axis=0)
    dead &= rise < np.maximum(0.4 * np.quantile(simulated[:, :, 2], 0.998, axis=0), 3.5 * noise[:, 2])
    for axis in range(3):
        x, y = simulated[:, :, axis], measured[:, :, axis] - level[:, axis]
        x = x - x.mean(axis=0)
        energy = np.sum(x**2, axis=0)
        each = np.stack([np.sum(x[span] * y[span], axis=0) for span in problem.episodes])
        slope = each.sum(axis=0) / np.maximum(energy, 1e-12)
        excited = energy > (40 * noise[:, axis]) ** 2  # otherwise noise alone would decide
        if axis < 2:  # slow noise may resemble a faint response, but not consistently in all episodes
            shared = np.abs(each.sum(axis=0)) > CHECKS.consistent * np.sqrt(np.sum(each**2, axis=0))
            excited &= shared | (np.abs(slope) > CHECKS.responds)
        dead &= ~excited | (np.abs(slope) < CHECKS.silent)
        if axis == 2:
            dead &= excited
    if dead.any():
        dead &= ~_answers_late(problem, level, noise)
    dead |= _still(problem, level, noise, floor)
    gone = np.broadcast_to(dead[:, None], problem.alive.shape)
    since = np.where(gone, 0.0, np.inf)
    failures = failures_of(problem)
    if failures is not None:  # a taxel that failed early may seem to have been dead all along
        gone = np.where(failures.failed.any(axis=1, keepdims=True), failures.failed, gone)
        since = np.where(gone, np.where(failures.failed, failures.since, 0.0), np.inf)
        level = np.where(failures.failed, failures.level, level)
    if not gone.any():
        return None
    dead = gone.any(axis=1)
    stuck = dead & (np.abs(level * gone).max(axis=1) > floor)
    fault = augment.DeadTaxels((dead & ~stuck).astype(float), stuck.astype(float), level * stuck[:, None])
    values = {"dead": fault.dead, "stuck": fault.stuck, "value": fault.value}
    if failures is not None:
        fault = augment.FailingTaxels(fault.dead, fault.stuck, fault.value, np.where(dead[:, None], since, 0.0))
        values["since"] = np.where(dead, since.min(axis=1), 0.0)
    return Reading(fault, values, replace(problem, alive=problem.alive & ~gone))


def _still(problem: Problem, level: FloatArray, noise: FloatArray, floor: float) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels that are stuck at an unusual level on all axes while pressed, however lightly.

    Light presses suffice if the force spans a count, because no dead band suppresses a non-zero reading.
    """
    usual = np.median(np.abs(level), axis=(2, 3), keepdims=True)
    far = (np.abs(level) > CHECKS.unusual * (usual + floor)).any(axis=1) | _unmoved(problem, floor)
    if not far.any():
        return far
    x, y = (
        np.concatenate([values[span] - values[span].mean(axis=0) for span in problem.episodes]) / noise
        for values in (problem.simulated, problem.measured)
    )
    energy, both = np.sum(x**2, axis=(0, 2)), np.sum(x * y, axis=(0, 2))
    missing = (energy - both) / np.sqrt(np.maximum(energy, 1e-12))  # z-score of the missing response
    still = ((problem.measured - level) / noise).std(axis=0) < CHECKS.quiet
    reached = np.quantile(np.abs(problem.simulated), 0.998, axis=0).max(axis=1) > problem.noise.step
    return far & (both < 0.25 * energy) & (missing > CHECKS.certain) & still.all(axis=1) & reached


def _unmoved(problem: Problem, floor: float) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels whose reading before contact stays constant while that of the others drifts."""
    spans = [span for span in problem.episodes if problem.untouched[span].any()]
    if len(spans) < 2:
        return np.zeros_like(problem.alive[:, 0])
    levels = [np.mean(problem.measured[span][problem.untouched[span]], axis=0) for span in spans]
    moved = np.std(levels, axis=0)
    usual = np.median(moved, axis=(2, 3), keepdims=True)
    drifting = usual > floor
    return drifting.any() & (~drifting | (moved < CHECKS.unmoved * usual)).all(axis=1)


def _answers_late(problem: Problem, level: FloatArray, noise: FloatArray) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels that respond with a delay of some tenths of a second."""
    late = problem.run(augment.LowPass(CHECKS.late), problem.simulated)[:, :, 2]
    x, y = late - late.mean(axis=0), problem.measured[:, :, 2] - level[:, 2]
    energy, both = np.sum(x**2, axis=0), np.sum(x * y, axis=0)
    return (both > CHECKS.responds * energy) & (both > CHECKS.certain * noise[:, 2] * np.sqrt(energy))


DEAD_TAXELS = DetectedCause(
    name="dead_taxels",
    order=95,
    excites="places",
    read=_read,
    words="Some taxels do not respond to force, or stop responding.",
    picture="silent_map",
)
